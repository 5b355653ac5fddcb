"""Laws in models of one's own: measured through the model, given names by what does as much, and predicted with."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from torsight.core.errors import ConfigError, InputError
from torsight.discovery import Candidate, Findings, Reading, candidate, find_missing, law, model_problem, parameter
from torsight.discovery.own.answer.laws import beyond, widened
from torsight.discovery.own.answer.saved import SavedModel
from torsight.discovery.own.model.check import check_problem
from torsight.discovery.own.model.evaluate import Called
from torsight.discovery.own.model.values import Curve
from torsight.discovery.own.prepare import prepare
from torsight.report.figures.own import figures_of

NOISE = 0.05
Table = dict[str, np.ndarray]


def waves(*, seed: int = 5, rows: int = 600, **sizes: float) -> Table:
    """Return y = 1 + 2 v and terms in u and in time, with noise of 0.05."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(rows))
    u = np.sin(t / 20.0) + rng.normal(0.0, 0.3, rows)
    v = np.cos(t / 33.0) + rng.normal(0.0, 0.3, rows)
    terms = {"slope": u, "bow": u**2, "ripple": np.sin(4.0 * u), "drift": t / 1000.0}
    y = 1.0 + 2.0 * v + sum(size * terms[name] for name, size in sizes.items()) + rng.normal(0.0, NOISE, rows)
    return {"time_s": t, "u": u, "v": v, "w": rng.normal(0.0, 1.0, rows), "y": y}


def read_waves(p: Any, record: Any) -> np.ndarray:
    """Return the reading with whatever was offered."""
    u = record.u
    terms = {"slope": u, "twin": u + 1e-3 * record.w, "bow": u**2, "drift": record.time_s / 1000.0}
    return p.offset + p.gain * record.v + sum(p.get(name, 0.0) * values for name, values in terms.items())


def offered(*names: str, **options: Any) -> list[Candidate]:
    return [candidate(name, parameter(name, 0.1, null=0.0), **options) for name in names]


def found_in(record: Table, *names: str) -> Findings:
    free = [parameter("gain", 1.0), parameter("offset", 0.0)]
    return find_missing(model_problem(read_waves, record, free, offered(*names), output="y"))


def test_a_candidate_that_does_what_a_law_does_gives_it_its_name() -> None:
    found = found_in(waves(slope=0.3), "slope", "drift")
    assert {one.id: one.laws for one in found.problem.candidates} == {"slope": ("y(u)",), "drift": ("y(time_s)",)}
    assert (found.verdict, found.effects, found.alternatives) == ("identified", ("slope",), ())
    low, high = found.parameters["slope"].ci95
    assert low < 0.3 < high


def test_candidates_that_do_the_same_are_both_told() -> None:
    found = found_in(waves(slope=0.3), "slope", "twin")
    assert found.verdict == "ambiguous"
    assert {found.effects, *found.alternatives} == {("slope",), ("twin",)}
    assert "this record cannot tell them apart" in str(found)
    # Both are 0.3 u but for 0.3e-3 w: nothing on this record, three noises of a reading where w is 500 times as large.
    later = waves(seed=8, slope=0.3)
    differ = {}
    for times in (1.0, 500.0):
        planned = later | {"w": times * later["w"]}
        slope, twin = (found.predict(planned, effects=[name])["y"] for name in ("slope", "twin"))
        differ[times] = np.std(slope - twin) / NOISE
    assert differ[1.0] < 0.1
    assert differ[500.0] == pytest.approx(3.0, rel=0.1)
    with pytest.raises(ConfigError, match=r"was not fitted; found ripple; allowed none.*slope"):
        found.predict(later, effects=["ripple"])


@pytest.mark.parametrize("names", [(), ("bow", "drift")])
def test_two_things_are_found_though_the_first_leaves_a_slow_one(names: tuple[str, ...]) -> None:
    found = found_in(waves(bow=0.3, drift=0.5), *names)
    if names:
        assert (found.verdict, set(found.effects)) == ("identified", {"bow", "drift"})
    else:
        assert (found.verdict, {name for name, _ in found.drivers}) == ("unknown", {"u", "time_s"})
    # 600 readings with the noise known to 1/√1200, and some ten values of laws.
    assert found.errors["y"][1].rmse_train == pytest.approx(NOISE, rel=0.1)


def test_a_law_without_a_name_is_a_curve_and_predicts() -> None:
    found = found_in(waves(ripple=0.5))
    assert found.verdict == "unknown"
    (curve,) = found.laws
    assert (curve.id, curve.driver, curve.effect) == ("y(u)", "u", None)
    truth = 0.5 * np.sin(4.0 * curve.nodes)
    well = curve.covered & (np.abs(curve.nodes) < 1.2)
    off = (curve.values - truth)[well]
    # Offset and law share a constant: what counts is the form.
    assert np.std(off) < 0.05
    later = waves(seed=8, ripple=0.5)
    made = found.predict(later)
    inner = np.abs(later["u"]) < 1.2
    assert np.sqrt(np.mean((made["y"] - later["y"])[inner] ** 2)) < 1.3 * NOISE


def test_a_law_of_time_holds_for_its_own_record_only() -> None:
    found = found_in(waves(drift=2.0))
    assert [name for name, _ in found.drivers] == ["time_s"]
    later = waves(seed=8)
    made = found.predict(later)
    # 2 · t / 1000 over 600 s: a spread of 1.2 / √12 that is a doubt now, and no forecast.
    assert np.std(made["y"] - 2.0 * later["v"]) < NOISE
    assert np.all(made["y_sigma"] > 0.3)


def rub(speed: np.ndarray | float) -> Any:
    return 0.8 * np.tanh(np.asarray(speed) / 0.5) + 0.4 * np.asarray(speed)


def sledge_record(seed: int, rows: int = 400, push: float = 2.0) -> Table:
    """Return the speed of v' = f − 0.3 v − rub(v) (SciPy's LSODA)."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(rows)
    force = np.repeat(rng.uniform(-push, push, rows // 10 + 1), 10)[:rows]

    def rhs(s: float, v: np.ndarray) -> np.ndarray:
        return force[min(int(s / 0.1 + 1e-9), rows - 1)] - 0.3 * v - rub(v)

    v = solve_ivp(rhs, (0.0, t[-1]), [0.0], t_eval=t, max_step=0.02, rtol=1e-8).y[0]
    return {"time_s": t, "force": force, "speed": v + rng.normal(0.0, 0.01, rows)}


def move_sledge(p: Any, record: Any) -> np.ndarray:
    """Return the speed of the model: midpoint rule, two steps per sample."""
    v, out, h = 0.0, [], 0.05
    for f in record.force.tolist():
        out.append(v)
        for _ in range(2):
            middle = v + 0.5 * h * (f - p.viscous * v - p.friction(v))
            v += h * (f - p.viscous * middle - p.friction(middle))
    return np.array(out)


@pytest.fixture(scope="module")
def sledge() -> Findings:
    port = law("friction", driver="speed", unit="N", driver_unit="m/s", nodes=13, low=-1.5, high=1.5)
    known = [parameter("viscous", 0.3, sigma=0.01)]
    problem = model_problem(
        move_sledge, sledge_record(1), known, [port], output="speed", drivers=[], reading=Reading(sigma=0.01)
    )
    return find_missing(problem, processes=False)


def test_a_law_inside_a_differential_equation_is_measured_through_it(sledge: Findings) -> None:
    assert sledge.verdict == "unknown"
    assert [name for name, _ in sledge.drivers] == ["speed"]
    assert "friction is missing, in a form that no candidate has; it depends on speed" in str(sledge)
    (curve,) = sledge.laws
    assert (curve.id, curve.unit, curve.chosen) == ("friction", "N", True)
    off = curve.values - rub(curve.nodes)
    # Lines between nodes h = 0.25 m/s apart leave h²/8 · max f'' = 0.019 N of 0.8 N · tanh(v / 0.5 m/s).
    assert np.all(np.abs(off[curve.covered]) < 0.019 + 4.0 * curve.sigma[curve.covered])
    assert sledge.errors["speed"][1].rmse_held_out < 0.2 * sledge.errors["speed"][0].rmse_held_out
    assert set(curve.table()) == {"driver", "value", "sigma", "covered"}
    assert set(sledge.parameters) == {"viscous"}


def test_what_a_law_does_where_it_was_never_measured_is_a_doubt(sledge: Findings) -> None:
    """Pushed three times as hard, the sledge is faster than 1.5 m/s, from where friction rises on by 0.4 N s/m."""
    later = sledge_record(9, push=6.0)
    made = sledge.predict(later)
    off, sigma = made["speed"] - later["speed"], made["speed_sigma"]
    assert np.max(np.abs(off)) > 20.0 * 0.01
    assert np.mean(np.abs(off) < 1.96 * sigma) > 0.9
    assert np.max(np.abs(off) / sigma) < 4.0
    assert "beyond which" in made.warnings[0]


def test_a_prediction_shows_itself(sledge: Findings) -> None:
    made = sledge.predict(sledge_record(9))
    assert list(made) == ["time_s", "speed", "speed_sigma"] == list(made.to_frame())
    assert repr(made).startswith("PredictedOutputs(record: record 1, 400 rows, speed: ")
    assert "<td>" in made._repr_html_()
    assert made.plot().get_xlabel() == "time_s"
    (curve,) = sledge.laws
    assert repr(curve).startswith("MeasuredCurve(friction: a law of speed, from")
    assert list(curve.to_frame()) == ["driver", "value", "sigma", "covered"]
    assert curve.plot().get_xlabel() == "speed m/s"


def test_a_report_shows_every_block_and_what_was_known_beforehand(sledge: Findings) -> None:
    drawn = {one.name: one for some in figures_of(sledge).values() for one in some}
    blocks = drawn["unseen_speed"].data
    before, after = sledge.errors["speed"]
    assert blocks is not None
    assert blocks["block"] == [str(k) for k in range(1, 7)]
    for key, errors in (("before", before), ("after", after)):
        rows = np.bincount(sledge.problem.block)
        assert np.sqrt(np.average(np.square(blocks[key]), weights=rows)) == pytest.approx(errors.rmse_held_out)
    pulled = drawn["pulls"].data
    assert pulled is not None
    assert pulled["parameter"] == ["viscous"]
    assert pulled["extended_sigmas"] == [pytest.approx((sledge.values["viscous"] - 0.3) / 0.01)]


def test_a_model_with_a_law_is_the_same_after_a_file(sledge: Findings) -> None:
    model, later = sledge.model(), sledge_record(9)
    again = SavedModel.from_json(json.loads(json.dumps(model.to_json())), model.declared, where="model.json")
    made, same = model.predict(later), again.predict(later)
    for name, values in made.items():
        # Sums over arrays that lie in memory in another order.
        np.testing.assert_allclose(values, same[name], rtol=1e-8, atol=1e-12)
    assert np.sqrt(np.mean((made["speed"] - later["speed"]) ** 2)) < 4.0 * 0.01
    assert json.loads(json.dumps(sledge.to_json()))["laws"][0]["file"] == "law_friction.csv"


def test_a_law_that_changes_nothing_is_refused() -> None:
    def deaf(p: Any, record: Any) -> np.ndarray:
        p.friction(record.u)
        return p.offset + p.gain * record.v

    free = [parameter("gain", 1.0), parameter("offset", 0.0)]
    problem = model_problem(deaf, waves(), free, [law("friction", driver="u")], output="y")
    with pytest.raises(InputError, match="the law 'friction' changes nothing"):
        find_missing(problem)


def test_where_nothing_may_be_missing_much_that_is_left_is_told() -> None:
    """No candidates, no laws: the verdict rests on the noise that was given."""
    free = [parameter("gain", 1.0), parameter("offset", 0.0)]
    for size, verdict in ((0.0, "none"), (0.5, "unknown")):
        problem = model_problem(
            read_waves, waves(ripple=size), free, output="y", drivers=[], reading=Reading(sigma=NOISE)
        )
        assert not problem.laws
        assert not check_problem(problem)
        assert find_missing(problem).verdict == verdict


def bent_by_law(p: Any, record: Any) -> np.ndarray:
    return read_waves(p, record) + p.more(0.3 * record.u)


def with_port(**range_of: float) -> Any:
    free = [parameter("gain", 1.0), parameter("offset", 0.0)]
    return model_problem(bent_by_law, waves(ripple=0.5), free, [law("more", driver="u", **range_of)], output="y")


def test_a_law_over_a_column_spans_what_the_column_covers() -> None:
    u = waves(ripple=0.5)["u"]
    nodes = prepare(with_port())[0].nodes["more"]
    assert (nodes[0], nodes[-1]) == (u.min(), u.max())


def test_a_law_is_the_same_for_one_value_as_for_many() -> None:
    rng = np.random.default_rng(5)
    nodes, values = np.sort(rng.normal(size=9)), rng.normal(size=9)
    at = np.concatenate([rng.normal(0.0, 2.0, 500), nodes, [-np.inf, np.inf, np.nan]])
    law = Curve(nodes, values)
    np.testing.assert_array_equal([law(one) for one in at.tolist()], np.interp(at, nodes, values))
    assert law.asked.tolist() == [-np.inf, np.inf]
    assert [Curve()(one) for one in (-1.0, 0.0, np.nan)] == [0.0] * 3


def test_a_law_that_is_asked_for_values_beyond_its_nodes_is_told() -> None:
    told = [one for one in find_missing(with_port(low=-0.2, high=0.2)).warnings if "beyond which" in one]
    assert len(told) == 1
    low, high = (0.3 * end(waves(ripple=0.5)["u"]) for end in (np.min, np.max))
    assert told[0].startswith(
        f"the law 'more' is called with values from {low:.4g} to {high:.4g}, and has nodes from -0.2"
    )
    found = find_missing(with_port())
    assert not [one for one in found.warnings if "beyond which" in one]
    endless = Curve(np.linspace(-1.0, 1.0, 5), np.zeros(5)), Called(None, None, "", 0.0, {"more": (-np.inf, 1.0)})
    assert "from -inf to 1" in beyond([endless[1]], {"more": endless[0]})[0]
    asked = prepare(with_port())[0]
    assert widened(asked, [endless[1]], {"more": endless[0]}) is asked
    wider = waves(seed=8)
    assert not found.predict(wider).warnings
    assert "beyond which" in found.predict({**wider, "u": 4.0 * wider["u"]}).warnings[0]


def test_a_law_spans_what_the_better_model_asks_for() -> None:
    """The plain model is too slow, and asks for less than the record holds; no column says how far the law reaches."""
    free, port = [parameter("viscous", 2.0, lower=0.0)], law("friction", driver="v", nodes=13)
    reading = Reading(sigma=0.01)
    asked = model_problem(move_sledge, sledge_record(1), free, [port], output="speed", drivers=[], reading=reading)
    narrow = prepare(asked)[0].nodes["friction"]
    found = find_missing(asked, processes=False)
    speed, (curve,) = sledge_record(1)["speed"], found.laws
    assert narrow[-1] < 0.9 * speed.max() < 0.95 * curve.nodes[-1]
    assert not [one for one in found.warnings if "beyond which" in one]
    assert found.errors["speed"][1].rmse_held_out < 0.011


@pytest.mark.parametrize(("nodes", "enough"), [(20, False), (50, True)])
def test_a_law_that_bends_between_its_nodes_is_told_and_more_of_them_follow_it(nodes: int, *, enough: bool) -> None:
    """Nine waves over the range: twenty nodes are two a wave."""
    rng = np.random.default_rng(3)
    u = np.abs(np.arange(1200) / 200.0 % 2.0 - 1.0)
    record = {"u": u, "y": 2.0 * u + 0.5 * np.sin(18.0 * np.pi * u) + rng.normal(0.0, NOISE, 1200)}
    free, port = [parameter("gain", 1.0), parameter("offset", 0.0)], law("more", driver="u", nodes=nodes)

    def predict(p: Any, record: Any) -> np.ndarray:
        return np.asarray(p.offset + p.gain * record.u + p.more(record.u))

    found = find_missing(model_problem(predict, record, free, [port], output="y", drivers=[]))
    told = [one for one in found.warnings if one.startswith("the law 'more' bends between its 20 nodes")]
    assert (not told) is enough
    assert enough or "with nodes=39 it explains more" in told[0]
    assert (found.errors["y"][1].rmse_held_out < 1.2 * NOISE) is enough


def test_a_form_is_sure_only_where_a_free_law_was_measured_in_its_place() -> None:
    free = [parameter("gain", 1.0), parameter("offset", 0.0)]
    for drivers, words in ((["u"], "slope is missing"), ([], "slope is missing, or what acts alike")):
        asked = model_problem(read_waves, waves(slope=0.3), free, offered("slope"), output="y", drivers=drivers)
        found = find_missing(asked)
        assert (found.verdict, found.facts()["Missing"]) == ("identified", words)
        content = found.to_json()
        assert content["effects"][0]["form_compared"] is bool(drivers)
        assert content["drivers_offered"] == drivers


def test_where_much_is_left_beside_a_name_the_answer_is_unknown() -> None:
    """A wave of 0.5 is seven times the noise that is left beside the bow."""
    free, reading = [parameter("gain", 1.0), parameter("offset", 0.0)], Reading(sigma=NOISE)
    for ripple, verdict in ((0.5, "unknown"), (0.0, "identified")):
        record = waves(bow=0.8, ripple=ripple)
        found = find_missing(
            model_problem(read_waves, record, free, offered("bow"), output="y", drivers=[], reading=reading)
        )
        assert (found.verdict, found.effects) == (verdict, ("bow",))
        assert ("times the noise is left that nothing offered explains" in str(found)) is (verdict == "unknown")
