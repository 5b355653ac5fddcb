"""Models that are differential equations: SciPy, the compiled stepper and closed forms agree."""

from __future__ import annotations

import inspect
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit

from tests.scripts import script
from torsight.core.errors import ConfigError, InputError
from torsight.discovery import Event, Reading, Solver, candidate, find_missing, law, model_problem, ode, parameter
from torsight.discovery.own.answer.saved import SavedModel
from torsight.discovery.own.compiled import quicken
from torsight.discovery.own.model.check import check_problem
from torsight.discovery.own.model.evaluate import CompiledPredict
from torsight.discovery.own.model.ode import Ode
from torsight.discovery.own.model.values import Curve, Values
from torsight.discovery.own.own_records import Record
from torsight.discovery.own.prepare import prepare

TIME = np.linspace(0.0, 10.0, 201)
VALUES = Values({"stiffness": 4.0, "damping": 0.4, "x0": 1.0})
WANTED = 1e-5
"""Relative tolerance 1e-7 of a step, over a few hundred steps."""


def plain(t: float, x: Any, u: Any, p: Any) -> Any:
    del t
    return x[1], u.force - p.stiffness * x[0] - p.damping * x[1]


@njit
def compiled(t: float, x: Any, u: Any, p: Any) -> Any:  # noqa: ARG001 - the signature is ode's
    return x[1], u.force - p.stiffness * x[0] - p.damping * x[1]


def closed_form() -> np.ndarray:
    """Return the free decay from 1 at rest: ω² = k − c²/4."""
    half, omega = 0.2, np.sqrt(4.0 - 0.04)
    return np.exp(-half * TIME) * (np.cos(omega * TIME) + half / omega * np.sin(omega * TIME))


@pytest.mark.parametrize("rhs", [plain, compiled], ids=["scipy", "compiled"])
def test_a_free_decay_is_the_closed_form(rhs: Any) -> None:
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    model = ode(rhs, states=("x", "v"), output="x", inputs=("force",), initial={"x": "x0", "v": 0.0})
    np.testing.assert_allclose(model(VALUES, record)["x"], closed_form(), atol=WANTED)


@pytest.mark.parametrize("rhs", [plain, compiled], ids=["scipy", "compiled"])
def test_measured_states_begin_anew_where_that_is_wanted(rhs: Any) -> None:
    """Every 2.5 s the place is read, 0.1 too high: the speed goes on, and so does the closed form."""
    record = Record({"time_s": TIME, "force": np.zeros(201), "x": closed_form() + 0.1}, "one")
    given = {"states": ("x", "v"), "inputs": ("force",), "initial": ["x0", 0.0], "solver": Solver(restart_s=2.5)}
    made = ode(rhs, output="x", **given)(VALUES, record)["x"]
    # What 0.1 more at rest becomes is the free decay from there, a tenth of the one from 1.
    more = np.where(TIME > 2.5, 0.1 * closed_form()[np.arange(201) - 50], 0.0)
    until = TIME <= 5.0
    np.testing.assert_allclose(made[until], (closed_form() + more)[until], atol=WANTED)
    with pytest.raises(InputError, match="has no state that is measured itself"):
        ode(rhs, output=lambda x, _r, _p: x.x, **given)
    missing = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    np.testing.assert_allclose(ode(rhs, output="x", **given)(VALUES, missing)["x"], closed_form(), atol=WANTED)


def test_a_model_with_many_valleys_is_fitted() -> None:
    """A pendulum that tumbles through 50 rad forgets in seconds where it began."""
    valleys = script("benchmarks/discovery/valleys.py")
    model = ode(valleys.pendulum, states=("angle", "rate"), output="angle", inputs="force", initial=(0.5, 0.0))
    free = [parameter("pull", 2.0), parameter("drag", 1.0)]
    pair = [valleys.record(seed, 2.0) for seed in (3, 4)]
    problem = model_problem(model, pair, free, output="angle", reading=Reading(sigma=0.01))
    begun = prepare(problem)[0]
    values = {p.name: p.value for p in begun.parameters}
    assert list(values.values()) == pytest.approx([6.0, 0.3], rel=0.005)
    # With values that are wrong by 4e-6 the whole record is missed by 1.4 rad; what is left has to be noise.
    assert np.nanstd(begun.predict(values, ()) - begun.observed) < 0.03


def test_what_a_tumbling_pendulum_lacks_is_found() -> None:
    """The plain model loses the record within seconds; what it lacks shows between one reading and a later one."""
    valleys = script("benchmarks/discovery/valleys.py")
    found, off_rad = valleys.lacks(3)
    assert found.drivers == (("rate", 1.0),)
    assert [curve.id for curve in found.laws] == ["friction"]
    assert any("begin anew every" in note for note in found.warnings)
    # Lines between nodes h = 2.1 rad/s apart leave h²/8 · max f'' = 0.2 rad/s² of the friction, which move the angle by
    # up to 0.09 rad in 0.94 s; the plain model is off by 0.7.
    assert off_rad < 0.09
    # What was saved begins anew, too, though the model file says nothing of it; and where it cannot, it says so.
    model, later = found.model(), valleys.record(4, 2.5)
    declared = replace(model.declared, predict=replace(model.declared.predict, solver=Solver()))
    saved = SavedModel.from_json(json.loads(json.dumps(model.to_json())), declared, where="model.json")
    np.testing.assert_allclose(saved.predict(later)["angle"], found.predict(later)["angle"], atol=WANTED)
    del later["angle"]
    assert "the record holds no angle that could begin anew every 0.938" in saved.predict(later).warnings[-1]


def test_a_bounce_is_an_event() -> None:
    """Fallen from 1 m, back up with 0.8 of the speed."""
    ball = ode(
        lambda _t, x, _u, _p: (x[1], -9.81),
        states=("height", "speed"),
        output=lambda x, _record, _p: 1000.0 * x.height,
        initial={"height": "start_m", "speed": 0.0},
        events=[Event(lambda _t, x, _u, _p: x[0], lambda _t, x, _u, _p: (0.0, -0.8 * x[1]), direction=-1)],
    )
    time = np.linspace(0.0, 1.1, 90)
    made = ball(Values({}), Record({"time_s": time, "start_m": np.ones(90)}, "ball"))
    hit = np.sqrt(2.0 / 9.81)
    up = 0.8 * 9.81 * hit
    after = up * (time - hit) - 4.905 * (time - hit) ** 2
    np.testing.assert_allclose(made, 1000.0 * np.where(time < hit, 1.0 - 4.905 * time**2, after), atol=1e-3)


def heated(rows: int = 600) -> dict[str, np.ndarray]:
    """Return a plate behind a heater that is switched every 50 rows: C dT/dt = P - h T, row by row in closed form."""
    power = np.repeat(np.random.default_rng(4).permutation([0.0, 10.0, 20.0, 35.0, 50.0, 60.0] * 2), 50)[:rows]
    plate, left = np.empty(rows), math.exp(-0.35 / 45.0 * 2.0)
    plate[0] = 0.0
    for row in range(rows - 1):
        plate[row + 1] = power[row] / 0.35 + (plate[row] - power[row] / 0.35) * left
    return {"time_s": 2.0 * np.arange(rows), "power": power, "plate": plate}


def plate(power: str = "lines") -> Ode:
    return ode(
        lambda _t, x, u, p: ((u.power - p.loss * x[0]) / p.capacity,),
        states="plate",
        output="plate",
        inputs={"power": power},
        initial=[0.0],
    )


@pytest.mark.parametrize("make", [lambda model: model, Ode.compiled], ids=["scipy", "compiled"])
def test_an_input_that_is_held_keeps_its_value_until_the_next_row(make: Any) -> None:
    record = heated()
    given = Values({"loss": 0.35, "capacity": 45.0}), Record(record, "plate")
    np.testing.assert_allclose(make(plate("held"))(*given)["plate"], record["plate"], rtol=WANTED, atol=WANTED)
    # Lines between the rows are half a row early at every switch.
    assert np.abs(make(plate())(*given)["plate"] - record["plate"]).max() > 0.5
    # A command of one row while everything rests is not stepped over: 60 W for 2 s, and what is left of it.
    record["power"] = np.where(np.arange(600) == 400, 60.0, 0.0)
    after = 60.0 / 0.35 * (1.0 - math.exp(-0.7 / 45.0)) * np.exp(-0.35 / 45.0 * 2.0 * np.arange(199))
    made = make(plate("held"))(given[0], Record(record, "plate"))["plate"]
    np.testing.assert_allclose(made, np.r_[np.zeros(401), after], atol=WANTED)


@pytest.mark.parametrize("make", [lambda model: model, Ode.compiled], ids=["scipy", "compiled"])
def test_a_jump_of_a_held_input_may_be_an_event(make: Any) -> None:
    counter = ode(
        lambda _t, x, _u, _p: (0.0 * x[0],),
        states="count",
        output="count",
        inputs={"switch": "held"},
        initial=[0.0],
        events=Event(lambda _t, _x, u, _p: u.switch - 0.5, lambda _t, x, _u, _p: (x[0] + 1.0,), direction=1),
    )
    switch = (np.arange(40) // 10) % 2.0
    made = make(counter)(Values({}), Record({"time_s": np.arange(40.0), "switch": switch}, "switch"))["count"]
    # Switched on in rows 10 and 30; a row shows what was before.
    np.testing.assert_allclose(made, np.repeat([0.0, 1.0, 2.0], [11, 20, 9]), atol=WANTED)


def test_a_clean_record_with_a_switched_input_lacks_nothing_where_it_is_held() -> None:
    record = heated()
    record["plate"] = record["plate"] + 0.05 * np.random.default_rng(5).standard_normal(600)
    free = [parameter("capacity", 40.0), parameter("loss", 0.3)]
    found = {
        held: find_missing(model_problem(plate(held), record, free, output="plate", reading=Reading(sigma=0.05)))
        for held in ("held", "lines")
    }
    assert found["held"].verdict == "none"
    assert not any("'held'" in one for one in found["held"].warnings)
    assert found["held"].parameters["capacity"].value == pytest.approx(45.0, rel=0.01)
    # Lines are another model, and a note says what may be the cause.
    assert found["lines"].verdict != "none"
    assert any(
        "'power' stands still and jumps" in one and "inputs={'power': 'held'}" in one for one in found["lines"].warnings
    )


@pytest.mark.parametrize("per_s", [0.5, 3.0, 7.0])
def test_events_lie_between_rows_or_at_them(per_s: float) -> None:
    """A counter that begins anew at one; with seven in a second three events lie between two rows."""
    counter = ode(
        lambda _t, x, _u, p: (p.per_s + 0.0 * x[0],),
        states=("count",),
        output=lambda x, _record, _p: x.count,
        initial={"count": 0.0},
        events=[Event(lambda _t, x, _u, _p: x[0] - 1.0, lambda _t, _x, _u, _p: (0.0,), direction=1)],
    )
    time = 0.5 * np.arange(80) + 0.01 * (np.arange(80) % 3)
    made = counter(Values({"per_s": per_s}), Record({"time_s": time}, "counter"))
    off = (made - per_s * time + 0.5) % 1.0 - 0.5
    np.testing.assert_allclose(off, 0.0, atol=1e-5)


def test_what_is_not_declared_is_told() -> None:
    with pytest.raises(InputError, match=r"ode, inputs, force: cannot be used.*'lines' or 'held'"):
        ode(plain, states=("x", "v"), output="x", inputs={"force": "hold"})
    with pytest.raises(InputError, match="'y' is no state"):
        ode(plain, states=("x", "v"), output="y")
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    with pytest.raises(InputError, match="how state 'v' begins is not known"):
        ode(plain, states=("x", "v"), output="x", inputs=("force",), initial={"x": "x0"})(VALUES, record)


def test_what_numba_cannot_compile_is_told() -> None:
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    how = {"states": ("x", "v"), "output": "x", "inputs": ("force",), "initial": {"x": "x0", "v": 0.0}}
    with pytest.raises(InputError, match=r"numba cannot compile the right-hand side: .*format"):
        ode(njit(lambda _t, x, _u, _p: (float("{}".format(x[1])), x[0])), **how)(VALUES, record)  # noqa: UP032
    with pytest.raises(AttributeError, match="'push' is not declared; there is force"):
        ode(njit(lambda _t, x, u, p: (x[1], u.push - p.stiffness * x[0])), **how)(VALUES, record)


def drag(speed: float, size: float) -> float:
    return size * math.tanh(speed / 0.05)


def cart(_t: float, x: Any, u: Any, p: Any) -> Any:
    return x[1], u.force - drag(x[1], p.friction_n) - p.stiffness * x[0] - p.more(x[1])


CART = ode(
    cart,
    states=("x", "v"),
    output="v",
    inputs=("force",),
    initial={"x": 0.0, "v": 0.0},
    events=[Event(lambda _t, x, _u, p: x[0] - p.stop, lambda _t, x, _u, _p: (x[0], -0.5 * x[1]))],
)


def cart_record(rows: int = 400) -> dict[str, np.ndarray]:
    force = np.repeat(np.random.default_rng(1).uniform(-3.0, 3.0, rows // 20), 20)
    return {"time_s": 0.05 * np.arange(rows), "force": force}


def test_a_compiled_model_is_the_plain_one_with_events_laws_and_helpers() -> None:
    record, nodes = Record(cart_record(), "cart"), np.linspace(-1.0, 1.0, 9)
    laws = [Curve(nodes, 0.2 * nodes**3) for _ in range(2)]
    numbers = {"friction_n": 0.5, "stiffness": 0.4, "stop": 0.8}
    plain, quick = (
        model(Values({**numbers, "more": one}), record)["v"]
        for model, one in zip((CART, CART.compiled()), laws, strict=True)
    )
    # A stop is hit some ten times, and each multiplies what two integrators differ by.
    np.testing.assert_allclose(plain, quick, atol=1e-4)
    # Steps that were too long went further than the model does.
    np.testing.assert_allclose(laws[0].asked, laws[1].asked, atol=0.1)
    assert np.ptp(plain) > 2.0


def test_what_sticks_is_integrated_though_its_derivative_jumps() -> None:
    """Thrown at 1 m/s against a pull of 0.2 and friction of 0.5: stands after 1 / 0.3 s and 1 / 0.6 m."""
    record = Record({"time_s": TIME, "pull": np.full(201, 0.2)}, "one")
    model = ode(
        lambda _t, x, u, p: (x[1], u.pull - p.friction * np.sign(x[1])) if x[0] > -1.0 else (0, x[1]),
        states=("x", "v"),
        output=("x", "v"),
        inputs="pull",
        initial={"x": 0.0, "v": 1.0},
    )
    made = model(Values({"friction": 0.5}), record)
    moves = TIME < 1.0 / 0.3
    tremble = 0.7 * 0.05 / 50
    np.testing.assert_allclose(made["v"], np.where(moves, 1.0 - 0.3 * TIME, 0.0), atol=2.0 * tremble)
    way = np.where(moves, TIME - 0.15 * TIME**2, 1.0 / 0.6)
    np.testing.assert_allclose(made["x"], way, atol=10.0 * tremble)


def test_an_integration_that_goes_well_takes_few_of_the_steps_that_are_allowed() -> None:
    calls = 0

    def counting(*given: Any) -> Any:
        nonlocal calls
        calls += 1
        return cart(*given)

    record = Record(cart_record(), "cart")
    replace(CART, rhs=counting)(Values({"friction_n": 0.5, "stiffness": 0.4, "stop": 0.8, "more": Curve()}), record)
    # Every row is a corner of the input; friction at rest and the stop are hard work.
    assert 5 * record.rows_ < calls < 30 * record.rows_


@pytest.mark.parametrize("make", [lambda model: model, Ode.compiled], ids=["scipy", "compiled"])
def test_a_model_that_diverges_ends(make: Any) -> None:
    model = make(ode(lambda _t, x, _u, p: (p.rate * x[0] ** 2,), states=("x",), output="x", initial={"x": 1.0}))
    ends = pytest.raises(ArithmeticError, match=r"gave up at t = (0.99|1).*as where a model diverges")
    with np.errstate(over="ignore"), ends:
        model(Values({"rate": 1.0}), Record({"time_s": TIME}, "one"))


def asked_at(model: Any, force: Any) -> Any:
    """Return the problem of a cart that its own model made, checked."""
    record = cart_record()
    record["v"] = force
    free = [parameter("friction_n", 0.5), parameter("stiffness", 0.4)]
    stop = candidate("stop", parameter("stop", 0.8, null=1e9))
    problem = model_problem(model, record, free, [stop, law("more", driver="speed")], output="v")
    check_problem(problem)
    return problem


@pytest.fixture
def always_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quicken, "WORTH_S", 0.0)


@pytest.mark.usefixtures("always_worth_it")
def test_the_search_compiles_a_plain_model() -> None:
    values = Values({"friction_n": 0.5, "stiffness": 0.4, "stop": 0.8, "more": Curve()})
    clean = CART(values, Record(cart_record(), "cart"))["v"]
    problem = quicken.quickened(asked_at(CART, clean))
    assert problem.model.predict.stepper is not None
    assert problem.evaluator.model is problem.model
    # Where the model itself raises, the plain one says where.
    torn = ode(lambda _t, _x, _u, p: (math.sqrt(p.left),), states=("v",), output="v", initial={"v": 0.0}).compiled()
    assert torn(Values({"left": 4.0}), Record(cart_record(), "cart"))["v"][-1] == pytest.approx(2.0 * 19.95)
    with pytest.raises(ValueError, match="math domain"):
        torn(Values({"left": -4.0}), Record(cart_record(), "cart"))


def by_steps(p: Any, record: Any) -> np.ndarray:
    made, v, x = [], 0.0, 0.0
    for force in record.force.tolist():
        made.append(v)
        for _ in range(20):
            v += 0.0025 * (force - drag(v, p.friction_n) - p.stiffness * x - p.more(v) - max(x - p.stop, 0.0))
            x += 0.0025 * v
    return np.array(made)


@pytest.mark.usefixtures("always_worth_it")
@pytest.mark.parametrize(
    ("words", "why_not"),
    [
        ("", None),
        ("    v = p.get('none', 0.0) + p['stop'] + record['force'][0]\n", None),
        ("    v = float('{}'.format(v))\n", "numba says: "),
        ("    print(v)\n", "'by_steps' calls itself, or prints"),
    ],
)
def test_a_loop_over_rows_is_compiled_where_numba_can_and_else_told_why(words: str, why_not: str | None) -> None:
    source = inspect.getsource(by_steps).replace("    return", f"{words}    return")
    scope = dict(globals())
    exec(compile(source, "by_steps.py", "exec"), scope)  # noqa: S102 - the same function with one line more
    problem = asked_at(by_steps, by_steps_alone())
    problem = replace(problem, model=replace(problem.model, predict=scope["by_steps"]))
    quick = quicken.quickened(problem)
    assert isinstance(quick.model.predict, CompiledPredict) is (why_not is None)
    told = quick.warnings[len(problem.warnings) :]
    assert len(told) == (why_not is not None)
    assert all(why_not in one and "by_steps.py, line 1, by_steps) was not compiled" in one for one in told)


def by_steps_alone() -> np.ndarray:
    values = Values({"friction_n": 0.5, "stiffness": 0.4, "stop": 1e9, "more": Curve()})
    return by_steps(values, Record(cart_record(), "cart"))


@pytest.mark.usefixtures("always_worth_it")
def test_what_is_another_model_once_it_is_compiled_stays_plain() -> None:
    """Numbers from outside are frozen by numba when it compiles."""
    outside = {"calls": np.zeros(1)}
    calls = outside["calls"]

    def counting(p: Any, record: Any) -> np.ndarray:
        calls[0] += 1.0
        return p.friction_n * record.force + p.stiffness + p.more(0.0) + min(p.stop, 0.0) + 1e-9 * calls[0]

    problem = asked_at(by_steps, by_steps_alone())
    problem = replace(problem, model=replace(problem.model, predict=counting))
    plain = quicken.quickened(problem)
    assert plain.model.predict is counting
    assert "numba says: " in plain.warnings[-1]

    def whole(p: Any, record: Any) -> np.ndarray:
        big = 2 ** int(70.0 + min(p.stop, 0.0))  # whole numbers of Python have no end, those of machines have 64 bits
        return 1e-21 * big * record.force + p.friction_n + p.stiffness + p.more(0.0)

    own = quicken.quickened(replace(problem, model=replace(problem.model, predict=whole)))
    assert own.model.predict is whole
    assert "compiled it gives other results" in own.warnings[-1]


def test_the_first_reading_of_a_measured_state_has_an_error_and_does_not_make_a_law() -> None:
    """Free decays with little damping: the error of the first reading remains in every later row of the solution."""
    noise, omega, rng = 0.01, 2.0, np.random.default_rng(11)
    time = 0.05 * np.arange(600)
    swing = np.exp(-0.01 * time) * (np.cos(omega * time) + 0.01 / omega * np.sin(omega * time))
    records, errors = [], []
    for size in (1.0, 0.6):
        error = rng.normal(0.0, noise, time.size)
        # Twice and three times the noise: by chance every twentieth and four-hundredth reading is so far off.
        error[0] = (2.0 if size == 1.0 else -3.0) * noise
        records.append({"time_s": time, "x": size * swing + error})
        errors.append(error[0])
    free = [parameter("stiffness", 3.0, lower=0.5, upper=10.0), parameter("damping", 0.05, lower=0.0, upper=1.0)]
    model = ode(
        lambda _t, x, _u, p: (x[1], -p.stiffness * x[0] - p.damping * x[1] - p.more(x[1])),
        states=("x", "v"),
        output="x",
        initial={"v": 0.0},
    )
    found = find_missing(model_problem(model, records, free, law("more", driver="v"), output="x"))
    assert found.verdict == "none"
    for name, truth in (("stiffness", omega**2 + 0.01**2), ("damping", 0.02)):
        assert abs(found.parameters[name].value - truth) < 4.0 * found.parameters[name].sigma
    for k, error in enumerate(errors, 1):
        estimate = found.parameters[f"x_start_error@{k}"]
        assert abs(estimate.value + error) < 4.0 * estimate.sigma < noise
    later = {"time_s": time, "x": 0.8 * swing + rng.normal(0.0, noise, time.size)}
    assert np.std(found.predict(later).to_frame()["x"] - 0.8 * swing) < 0.5 * noise
    planned = found.predict({"time_s": time}, initial={"x": 0.8})
    np.testing.assert_allclose(planned.to_frame()["x"], 0.8 * swing, atol=0.5 * noise)
    with pytest.raises(ConfigError, match="'x_start' is no initial state; allowed x"):
        found.predict(later, initial={"x_start": 0.8})
