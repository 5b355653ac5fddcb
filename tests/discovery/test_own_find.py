"""Discovery on models of one's own: the right answer set up well, and a warning where it is set up less well."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import signal

from tests.discovery.own_models import (
    LAG_S,
    NOISE,
    line,
    move_spring,
    read_sensor,
    sensor_candidates,
    sensor_parameters,
    sensor_record,
    spring_candidates,
    spring_parameters,
    spring_record,
)
from torsight.core.errors import ConfigError, InputError
from torsight.discovery import Findings, Reading, candidate, find_missing, model_problem, parameter
from torsight.discovery.own.model.evaluate import Evaluator, Model
from torsight.discovery.own.own_records import Record
from torsight.discovery.own.prepare import prepare


def sensor(observed: Any, **changes: Any) -> Any:
    given = {"candidates": sensor_candidates(), "output": "y", **changes}
    return model_problem(read_sensor, observed, sensor_parameters(), given.pop("candidates"), **given)


def springs(**changes: Any) -> Any:
    records = [spring_record(1, 2.0), spring_record(2, -1.0), spring_record(3, 0.5)]
    given = {
        "output": "x_mm",
        "initial": ["x0_mm"],
        "reading": Reading(sigma=0.02),
        "predict": move_spring,
        "observed": records,
    }
    given |= changes
    return model_problem(given.pop("predict"), given.pop("observed"), spring_parameters(), spring_candidates(), **given)


@pytest.fixture(scope="module")
def three_springs() -> Findings:
    return find_missing(springs())


def warned(found: Findings, words: str) -> bool:
    return any(words in one for one in found.warnings)


def test_a_slow_sensor_is_found_though_its_fit_begins_far_off() -> None:
    found = find_missing(sensor(sensor_record(lag_s=LAG_S)))
    assert found.verdict == "identified"
    assert found.effects == ("sensor_lag",)
    low, high = found.parameters["lag_s"].ci95
    assert low < LAG_S < high
    # The noise of 600 readings is known to 1/√1200 of itself; a block that is not seen adds what two values cost.
    assert found.errors["y"][1].rmse_held_out == pytest.approx(NOISE, rel=0.1)
    assert found.errors["y"][0].rmse_held_out > 10.0 * NOISE


def _missed(u: np.ndarray, place: float) -> np.ndarray:
    return np.exp(-0.5 * ((u - place) / 0.25) ** 2)


def test_a_slow_sensor_is_the_same_from_any_start() -> None:
    """At 80 s it does what a creeping offset does; what it is like is judged where it fits, at 3 s."""
    rng, t, answers = np.random.default_rng(0), 0.1 * np.arange(3000), []
    u = np.repeat(rng.uniform(-1.0, 1.0, 100), 30)
    y = 1.0 + 2.0 * signal.lsim(([1.0], [3.0, 1.0]), u, t, interp=False)[1] + rng.normal(0.0, 0.02, 3000)
    free = [*sensor_parameters(), *(parameter(name, 0.0, fixed=True) for name in ("cubic", "drift"))]
    for start in (0.02, 80.0):
        lag = candidate("sensor_lag", parameter("lag_s", start, lower=0.0, upper=100.0, null=0.0))
        found = find_missing(model_problem(read_sensor, {"time_s": t, "u": u, "y": y}, free, lag, output="y"))
        answers.append((found.verdict, found.effects, [name for name, _ in found.drivers]))
        # The model begins where the signal is, and the record does not: for a while they are apart.
        assert found.parameters["lag_s"].value == pytest.approx(3.0, rel=0.01)
    assert answers == [("unknown", ("sensor_lag",), ["time_s", "u"])] * 2


def test_a_value_that_ends_at_its_bound_is_told() -> None:
    for upper in (8.0, 60.0):
        lag = candidate("sensor_lag", parameter("lag_s", 4.0, lower=0.0, upper=upper, null=0.0))
        found = find_missing(sensor(sensor_record(lag_s=LAG_S), candidates=[lag, *sensor_candidates()[1:]]))
        assert "sensor_lag" in found.effects
        assert warned(found, "'lag_s' ends at its bound 8:") == (upper < LAG_S)


def test_a_value_of_the_model_itself_that_ends_at_its_bound_is_told() -> None:
    """A gain of 2 that was declared in thousandths, and bounded there."""
    u = np.linspace(0.0, 1.0, 200)
    record = {
        "time_s": 0.1 * np.arange(200),
        "u": u,
        "y": 2.0 * u + 0.01 * np.random.default_rng(8).standard_normal(200),
    }
    for lower in (1000.0, 1.0):
        gain = parameter("gain", 2.0 * lower, lower=lower, upper=5.0 * lower)
        found = find_missing(model_problem(lambda p, record: p.gain * record.u, record, [gain], output="y"))
        assert warned(found, "'gain' ends at its bound 1000: ") == (lower > 1.0)


class Tanks:
    """Two tanks, the upper of which runs over into the lower one; the model does not know it and starts far off."""

    ROWS = 1000

    @staticmethod
    def level(p: Any, record: Any) -> np.ndarray:
        """Return the level of the lower tank by Euler's rule."""
        upper, lower, found = p.upper_0, p.lower_0, []
        for pumped in record.pump.tolist():
            found.append(lower)
            through, over = p.out_1 * max(upper, 0.0) ** 0.5, p.spill * max(upper - p.rim, 0.0)
            upper = upper + p.gain * pumped - through - over
            lower = lower + through + p.into * over - p.out_2 * max(lower, 0.0) ** 0.5
        return np.array(found)

    @classmethod
    def record(cls, seed: int) -> dict[str, np.ndarray]:
        """Return a record by Heun's rule, four steps a row."""
        rng, level, found = np.random.default_rng(seed), np.array([4.0, 4.0]), []
        pump = np.repeat(rng.uniform(0.0, 4.0, cls.ROWS // 25), 25)

        def rates(x: np.ndarray, pumped: float) -> np.ndarray:
            over, through = 0.2 * max(x[0] - 9.0, 0.0), 0.06 * np.sqrt(max(x[0], 0.0))
            return np.array([0.09 * pumped - through - over, through + over - 0.055 * np.sqrt(max(x[1], 0.0))])

        for pumped in pump:
            found.append(level[1])
            for _ in range(4):
                first = rates(level, pumped)
                level = level + 0.125 * (first + rates(level + 0.25 * first, pumped))
        return {
            "time_s": np.arange(float(cls.ROWS)),
            "pump": pump,
            "y": np.array(found) + rng.normal(0.0, 0.02, cls.ROWS),
        }


def test_what_is_missing_is_found_though_it_has_pulled_the_model_off() -> None:
    """The plain model's best fit has an upper tank that never fills: there an overflow does nothing."""
    free = [parameter(name, 0.15, lower=0.001, upper=2.0) for name in ("gain", "out_1", "out_2")]
    begin = [parameter(name, 5.0, lower=0.0, upper=20.0) for name in ("upper_0", "lower_0")]
    spill = parameter("spill", 0.1, null=0.0, lower=0.0, upper=5.0)
    over = [spill, parameter("rim", 7.0, lower=3.0, upper=15.0), parameter("into", 0.5, lower=0.0, upper=1.0)]
    names = [one.name for one in begin]
    asked = model_problem(
        Tanks.level, Tanks.record(1), [*free, *begin], candidate("overflow", *over), output="y", initial=names
    )
    found = find_missing(asked)
    later = Tanks.record(2)
    assert found.effects == ("overflow",)
    assert found.parameters["rim"].value == pytest.approx(9.0, rel=0.02)
    # Noise is 0.02, and steps of a whole second are off by as much again.
    assert np.std(found.predict(later)["y"] - later["y"]) < 0.04


def test_a_start_in_the_wrong_valley_is_left_and_told() -> None:
    """A bump at 2.0 that is looked for at −2.0: from there no derivative leads to it."""
    made = sensor_record()
    made["y"] += 2.0 * _missed(made["u"], 2.0)

    def bump(p: Any, record: Any) -> np.ndarray:
        return line(p, record) + p.height * _missed(record.u, p.place)

    own = candidate("bump", parameter("height", 0.5, null=0.0), parameter("place", -2.0, lower=-4.0, upper=4.0))
    found = find_missing(
        model_problem(bump, made, sensor_parameters(), [own], output="y", reading=Reading(sigma=NOISE))
    )
    assert found.effects == ("bump",)
    assert found.values["place"] == pytest.approx(2.0, abs=0.1)
    assert warned(found, "the fit of 'bump' from its declared start")


@pytest.mark.parametrize("delay_s", [2.0, 6.0, 9.0])
def test_a_delay_far_from_its_start_is_found(delay_s: float) -> None:
    """Every wave of the input makes a valley of its own; the bend is what is missing."""
    rng = np.random.default_rng(4)
    t = 0.1 * np.arange(400)
    waves = zip(rng.uniform(0.15, 0.8, 6), rng.uniform(0.0, 6.3, 6), rng.normal(0.0, 1.0, 6), strict=True)
    shapes = [(hz, phase, size) for hz, phase, size in waves]

    def u_at(time_s: np.ndarray) -> np.ndarray:
        return np.sum([size * np.sin(2.0 * np.pi * hz * time_s + phase) for hz, phase, size in shapes], axis=0)

    late = u_at(np.maximum(t - delay_s, t[0]))
    record = {"time_s": t, "u": u_at(t), "y": 2.0 * late + 1.0 + 0.1 * late**2 + rng.normal(0.0, 0.05, 400)}

    def delayed(p: Any, record: Any) -> np.ndarray:
        u = np.interp(record.time_s - p.delay_s, record.time_s, record.u)
        return p.gain * u + p.offset + p.bend * u**2

    own = [*sensor_parameters(), parameter("delay_s", 0.5, lower=0.0, upper=12.0)]
    offered = [candidate("bend", parameter("bend", 0.01, null=0.0))]
    found = find_missing(model_problem(delayed, record, own, offered, output="y", reading=Reading(sigma=0.05)))
    assert (found.verdict, found.effects) == ("identified", ("bend",))
    assert found.values["delay_s"] == pytest.approx(delay_s, abs=0.02)


def test_a_start_from_which_the_fit_gets_there_is_not_told() -> None:
    made = sensor_record()
    made["y"] += 0.3 * made["u"] ** 2

    def bent(p: Any, record: Any) -> np.ndarray:
        return line(p, record) + p.bend * record.u**2

    found = find_missing(
        model_problem(
            bent, made, sensor_parameters(), [candidate("bend", parameter("bend", 0.1, null=0.0))], output="y"
        )
    )
    assert found.effects == ("bend",)
    assert not found.warnings


def test_a_base_fit_in_the_wrong_valley_is_left_and_told() -> None:
    made = sensor_record()
    made["y"] = np.sin(1.7 * made["u"] + 0.3) + np.random.default_rng(4).normal(0.0, NOISE, 600)

    def wave(p: Any, record: Any) -> np.ndarray:
        return np.sin(p.rate * record.u + p.phase)

    free = [parameter("rate", 6.0, lower=0.2, upper=8.0), parameter("phase", 0.0, lower=-3.0, upper=3.0)]
    problem, warnings = prepare(model_problem(wave, made, free, output="y", reading=Reading(sigma=NOISE)))
    assert any("has a residual" in one and "rate" in one for one in warnings)
    started = {p.name: p.value for p in problem.parameters}
    assert started["rate"] == pytest.approx(1.7, abs=0.02)


@pytest.mark.parametrize("sigma", [NOISE, None])
def test_what_no_candidate_explains_is_unknown_and_never_none(sigma: float | None) -> None:
    made = sensor_record(curve=0.3)

    def drifting(p: Any, record: Any) -> np.ndarray:
        return line(p, record) + p.drift * record.time_s / record.time_s[-1]

    own = [candidate("drift", parameter("drift", 0.1, null=0.0))]
    found = find_missing(
        model_problem(drifting, made, sensor_parameters(), own, output="y", reading=Reading(sigma=sigma))
    )
    assert found.verdict == "unknown"
    assert found.drivers[0][0] == "u"
    text = str(found)
    assert "none of the candidates explains; it depends on u" in text
    assert "Best fits" in text
    assert "drift: 1.13" in text
    # Without any candidate, too.
    bare = find_missing(model_problem(line, made, sensor_parameters(), output="y", reading=Reading(sigma=sigma)))
    assert (bare.verdict, bare.drivers[0][0]) == ("unknown", "u")


def test_nothing_is_missing_from_a_model_that_is_right() -> None:
    for offered in (sensor_candidates(), ()):
        predict = read_sensor if offered else line
        found = find_missing(model_problem(predict, sensor_record(), sensor_parameters(), offered, output="y"))
        assert found.verdict == "none"
        assert found.effects == ()
        assert not found.warnings


def test_several_records_each_begin_on_their_own(three_springs: Findings) -> None:
    found = three_springs
    assert found.verdict == "identified"
    assert found.effects == ("hardening",)
    truth = {"gain": 2.0, "tau_s": 8.0, "cubic": 0.02, "x0_mm@1": 2.0, "x0_mm@2": -1.0, "x0_mm@3": 0.5}
    assert set(found.parameters) == set(truth)
    for name, value in truth.items():
        one = found.parameters[name]
        assert abs(one.value - value) < 3.5 * one.sigma, name
    assert [label for label, _ in found.before.folds] == [0, 1, 2]


def test_an_initial_state_that_is_not_declared_is_found_out() -> None:
    found = find_missing(springs(observed=spring_record(1, 2.0, rows=400), initial=()))
    assert warned(found, "only block 0 determines 'x0_mm'")
    assert found.effects == ("hardening",)


def test_an_initial_state_that_other_records_begin_with_otherwise_is_told() -> None:
    pair = [spring_record(1, 2.0, cubic=0.0), spring_record(2, -1.0, cubic=0.0)]
    told = "with a value of 'x0_mm' for each record"
    assert warned(find_missing(springs(observed=pair, initial=())), told)
    assert not warned(find_missing(springs(observed=pair)), told)


def test_what_records_differ_by_is_no_noise() -> None:
    """Nothing that is offered explains it, and it is nine times the scatter of neighbours: that is not none."""
    rng, t = np.random.default_rng(7), 0.1 * np.arange(400)
    u = np.sin(t) + 0.5 * np.sin(0.37 * t + 1.0)
    plain = 1.5 * u + 0.3 + rng.normal(0.0, 0.05, 400)
    records = [{"time_s": t, "u": u, "y": plain + begins * np.exp(-t / 2.0)} for begins in (2.0, -3.0, 1.0)]

    def predict(p: Any, record: Any) -> np.ndarray:
        return np.asarray(p.offset + p.gain * record.u + p.begins * np.exp(-record.time_s / 2.0))

    free = [parameter("gain", 1.0), parameter("offset", 0.0), parameter("begins", 0.5)]
    found = find_missing(model_problem(predict, records, free, output="y"))
    assert found.verdict == "unknown"
    assert warned(found, "with a value of 'begins' for each record")
    found = find_missing(model_problem(predict, records, free, output="y", initial="begins"))
    assert found.verdict == "none"


def test_parameters_that_the_record_cannot_tell_apart_are_told_and_one_of_them_can_be_fixed() -> None:
    def twice(p: Any, record: Any) -> np.ndarray:
        return p.gain * p.boost * record.u + p.offset

    gain, offset = sensor_parameters()
    for fixed in (False, True):
        own = [gain, parameter("boost", 1.5, fixed=fixed), offset]
        found = find_missing(
            model_problem(twice, sensor_record(), own, output="y", drivers=[], reading=Reading(sigma=NOISE))
        )
        assert warned(found, "only combinations of gain, boost:") is not fixed
        assert ("boost" in found.parameters) is not fixed
        assert found.values["gain"] * (1.5 if fixed else found.values["boost"]) == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize(("times", "words"), [(3.0, "is too large"), (1.0, None), (1.0 / 3.0, "is too small")])
def test_a_noise_that_is_not_that_of_the_readings_is_told(times: float, words: str | None) -> None:
    found = find_missing(sensor(sensor_record(curve=0.3), reading=Reading(sigma=times * NOISE)))
    assert [one for one in found.warnings if "sigma" in one and words and words in one] or words is None
    assert words is not None or not warned(found, "sigma that was given")


def test_two_outputs_each_have_their_own_noise() -> None:
    def both(p: Any, record: Any) -> dict[str, np.ndarray]:
        x = move_spring(p, record)
        return {"x_mm": x, "reading_v": -50.0 * x}

    found = find_missing(
        springs(predict=both, output=["x_mm", "reading_v"], reading=Reading(sigma={"x_mm": 0.02, "reading_v": 1.0}))
    )
    assert found.effects == ("hardening",)
    assert found.errors["x_mm"][1].rmse_held_out == pytest.approx(0.02, rel=0.15)
    assert found.errors["reading_v"][1].rmse_held_out == pytest.approx(1.0, rel=0.15)


def test_a_model_that_fails_in_the_middle_of_a_fit_loses_nothing(
    three_springs: Findings, capsys: pytest.CaptureFixture[str]
) -> None:
    def fragile(p: Any, record: Any) -> np.ndarray:
        print("stepping", p.cubic)  # noqa: T201 - what a model may do
        if p.cubic > 0.021:
            raise ValueError("the spring is torn")
        return move_spring(p, record)

    found = find_missing(springs(predict=fragile))
    assert found.effects == ("hardening",)
    assert found.values["gain"] == pytest.approx(three_springs.values["gain"], abs=0.05)
    assert found.failed > 0
    assert warned(found, "ValueError: the spring is torn (")
    assert warned(found, "test_own_find.py, line ")
    assert warned(found, "cubic=")
    assert 'raise ValueError("the spring is torn")' in found.failures[0]
    # What it prints is told once.
    assert warned(found, "the model prints ('stepping")
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("calls", [3, 10, 40, 100])
def test_a_model_that_fails_from_some_call_on_ends_with_its_own_error(calls: int) -> None:
    """Whatever the search was at: what a licence that has run out leaves is no matrix that can be solved."""
    left = iter(range(calls))

    def licensed(p: Any, record: Any) -> np.ndarray:
        if next(left, None) is None:
            raise OSError("the licence has run out")
        return read_sensor(p, record)

    wanted = model_problem(licensed, sensor_record(curve=0.3), sensor_parameters(), sensor_candidates(), output="y")
    with pytest.raises(InputError, match="OSError: the licence has run out") as told:
        find_missing(wanted, processes=False)
    assert "next(left, None)" in str(told.value.__notes__) or 'raise OSError("the licence' in str(told.value.__notes__)


@pytest.mark.parametrize("every", [2, 5, 9])
def test_rows_without_a_reading_leave_the_noise_as_it_is(every: int) -> None:
    record = sensor_record()
    record["y"][::every] = np.nan
    assert find_missing(model_problem(line, record, sensor_parameters(), output="y")).verdict == "none"


def test_what_progress_prints_is_printed_and_not_laid_to_the_model(capsys: pytest.CaptureFixture[str]) -> None:
    found = find_missing(sensor(sensor_record()), progress=lambda step, *_: print(step))  # noqa: T201
    assert {"starts", "held-out blocks"} <= set(capsys.readouterr().out.splitlines())
    assert not found.warnings


def test_what_a_model_prints_while_progress_is_shown_is_kept_from_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def predict(p: Any, record: Any) -> np.ndarray:
        print("called")  # noqa: T201
        return read_sensor(p, record)

    slowly = model_problem(predict, sensor_record(), sensor_parameters(), sensor_candidates(), output="y")
    found = find_missing(slowly, progress=lambda *_: time.sleep(0.02))
    assert capsys.readouterr().out == ""
    assert [one for one in found.warnings if "the model prints ('called', …)" in one]


def test_the_same_question_has_the_same_answer() -> None:
    one, other = (find_missing(sensor(sensor_record(curve=0.02))).to_json() for _ in range(2))
    assert one == other


def test_a_problem_is_one_short_line() -> None:
    names = ", ".join(one.id for one in sensor_candidates())
    assert repr(sensor(sensor_record())) == f"ModelProblem(y: 600 rows in 1 record, 2 parameters, candidates: {names})"


def test_findings_show_themselves(three_springs: Findings) -> None:
    text = str(three_springs)
    assert "hardening is missing" in text
    assert "rms on held-out blocks" in text
    html = three_springs._repr_html_()
    assert "<table>" in html
    assert "data:image/png;base64," in html
    assert repr(three_springs) == "Findings(identified: hardening)"
    assert three_springs.facts()["Missing"] == "hardening is missing, or what acts alike"
    assert len(three_springs.overview().axes) == 8
    content = three_springs.to_json()
    assert content["effects"][0]["id"] == "hardening"
    assert set(content["effects"][0]["parameters"]["cubic"]) == {"value", "sigma", "ci95", "unit", "fixed"}
    assert content["outputs"]["x_mm"]["after"]["rmse_held_out"] < content["outputs"]["x_mm"]["before"]["rmse_held_out"]
    curves = three_springs.curves()
    assert list(curves) == ["record", "time_s", "x_mm", "x_mm_plain", "x_mm_extended"]
    assert {len(column) for column in curves.values()} == {600}
    frame = three_springs.to_frame()
    assert list(frame) == list(curves)
    axes = Figure().subplots()
    assert three_springs.plot(axes) is axes
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), frame["x_mm"][frame["record"] == frame["record"][0]])


def test_another_record_is_predicted_with_its_doubt(three_springs: Findings) -> None:
    later = spring_record(9, 1.5)
    clean = spring_record(9, 1.5)["x_mm"]
    free = three_springs.predict(later)
    told = three_springs.predict(later, initial={"x0_mm": 1.5})
    for made in (free, told):
        assert list(made) == ["time_s", "x_mm", "x_mm_sigma"]
        off = (made["x_mm"] - clean) / made["x_mm_sigma"]
        # Errors are of one sigma: three quarters to five quarters of it over 200 readings with their noise.
        assert 0.75 < float(np.sqrt(np.mean(off**2))) < 1.25
    with pytest.raises(ConfigError, match="'gain' is no initial state"):
        three_springs.predict(later, initial={"gain": 1.0})


def test_every_point_is_asked_once_and_a_record_only_for_what_it_sees() -> None:
    problem = springs()
    values = {p.name: p.value for p in problem.parameters}
    first = problem.predict(values, ())
    assert problem.evaluator.calls == 3
    problem.predict({**values, "cubic": 0.0}, ("hardening",))
    assert problem.evaluator.calls == 3
    moved = problem.predict({**values, "x0_mm@2": 0.3}, ())
    assert problem.evaluator.calls == 4
    assert np.array_equal(first[:200], moved[:200])
    assert not np.array_equal(first[201:401], moved[201:401])


def test_processes_answer_as_one_does() -> None:
    table = spring_record(1, 2.0)
    record = Record(table, "one")

    def asked(p: Any, of: Record) -> np.ndarray:
        if p.gain > 5.0:
            print("far")  # noqa: T201 - what a model may do
            raise ValueError(f"gain {p.gain}")
        return p.gain * of.u

    points = [([{"gain": float(gain)}], {}) for gain in range(8)]
    here, there = (Evaluator(Model(asked, (record,), ("x_mm",))) for _ in range(2))
    with there.processes(wanted=True) as used:
        assert used
        sent = there.many(points)
    assert there.printed == "far\nfar\n"
    for (one,), (other,) in zip(here.many(points), sent, strict=True):
        if one.outputs is None:
            assert (one.failure.message, one.failure.place) == (other.failure.message, other.failure.place)
        else:
            np.testing.assert_array_equal(one.outputs, other.outputs)
    assert here.calls == there.calls == 8
