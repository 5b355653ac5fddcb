"""Which sets are fitted: those that explain little alone, and those that sit in the wrong valley at first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from linear_cases import BLOCKS, LENGTH, machine, noise, signals

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.core.parallel.threads import in_parallel
from torsight.core.parameter import Parameter
from torsight.core.progress import silent
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.engine import find_missing
from torsight.discovery.inference.explanation import curvature_spread, places_of
from torsight.discovery.inference.fitting import AtPoint, Fitter
from torsight.discovery.inference.law.measure import Bar
from torsight.discovery.inference.search import Search
from torsight.discovery.inference.verdict import Decision, decide
from torsight.discovery.interface import Candidate
from torsight.discovery.linear_problem import LinearProblem
from torsight.discovery.settings import Settings
from torsight.discovery.weight import Weight
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from


def hidden_pair() -> LinearProblem:
    """Return a machine that lacks two effects, one of which explains less alone than three that are not there."""
    s = signals()
    one, two, other = (value / np.std(value) for value in (np.sign(s["speed"]), s["position"], s["warm"] - 20.0))
    candidates = {
        "one": {"one_n": one},
        "two": {"two_n": two},
        "like_one": {"like_one_n": one + 0.5 * two + 0.2 * other},
    }
    candidates |= {f"decoy_{i}": {f"decoy_{i}_n": one + two + noise(20 + i, size=0.5, tau=6.0)} for i in range(2)}
    return replace(machine(0.5 * one + 0.5 * two, seed=5, candidates=candidates), drivers={})


def test_effects_that_explain_little_alone_are_found_together() -> None:
    search = Search(hidden_pair(), settings=Settings(), progress=silent)
    decision = decide(search.run(), settings=Settings(), choices=search.choices, can_hold_out=True)
    assert decision.chosen.members == ("one", "two")
    assert decision.rivals == ()


def test_what_only_extends_an_answer_is_no_other_answer() -> None:
    s = signals()
    twin = np.sign(s["speed"]) + noise(40, size=0.02, tau=6.0)
    decoys = {f"decoy_{i}": {f"decoy_{i}_n": noise(50 + i, size=1.0, tau=6.0)} for i in range(20)}
    candidates = {"coulomb": {"coulomb_n": np.sign(s["speed"])}, "twin": {"twin_n": twin}, **decoys}
    made = replace(machine(0.3 * np.sign(s["speed"]), seed=5, candidates=candidates), drivers={})
    settings = Settings(credible=0.995)
    search = Search(made, settings=settings, progress=silent)
    decision = decide(search.run(), settings=settings, choices=search.choices, can_hold_out=True)
    # Each of the twenty beside either of the two has a little of the probability: together more than the rest.
    assert sum(p for members, p in decision.probability.items() if len(members) == 1) < settings.credible
    assert {decision.chosen.members, *(one.members for one in decision.rivals)} == {("coulomb",), ("twin",)}


def test_two_springs_laws_and_the_law_of_both_say_what_any_two_of_them_say() -> None:
    """Any two of the curves of spring A, of spring B and of both make up the third: no experiment tells them apart."""
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    record = make_record({"motion": {"kind": "rig"}}, seed=5, sigma_deg=0.15).table
    problem = ActuatorProblem(ActuatorModel(spec).prepare(record), spec)
    a, b, both = (f"temperature_{spring}temp_rate_c_s" for spring in ("a_", "b_", ""))
    pairs = [places_of(problem, pair) for pair in ((a, b), (a, both), (both, b), ("sensor_lag", b))]
    assert len(set(pairs)) == 1
    alone = [places_of(problem, [one]) for one in (a, b, both)]
    assert len(set(alone)) == 3
    assert all(one < pairs[0] for one in alone)
    assert places_of(problem, [a, "winding_b_winding_deg"]) not in pairs


def test_two_members_at_one_place_are_not_what_one_of_them_is() -> None:
    """A slipped marker beside a drift of the reading is no part of a slipped clamp beside that drift."""
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    record = make_record({"motion": {"kind": "rig"}}, seed=5, sigma_deg=0.15).table
    problem = ActuatorProblem(ActuatorModel(spec).prepare(record), spec)
    drift, marker, clamp = (
        places_of(problem, ["reading_time_s", *more]) for more in ([], ["marker_slip"], ["clamp_slip"])
    )
    assert drift < marker
    assert drift < clamp
    assert not marker <= clamp
    assert places_of(problem, ["marker_slip"]) == drift


def test_what_its_extensions_hold_an_answer_holds() -> None:
    """What is as improbable as 3 % is no rival of an answer that nearly all other sets contain."""
    s = signals()
    candidates = {
        name: {f"{name}_n": noise(60 + i, size=1.0, tau=6.0)} for i, name in enumerate(("twin", "one", "two"))
    }
    candidates["coulomb"] = {"coulomb_n": np.sign(s["speed"])}
    made = replace(machine(0.3 * np.sign(s["speed"]), seed=5, candidates=candidates), drivers={})
    decision = decided_with(
        made, {("coulomb",): 0.93, ("twin",): 0.03, ("coulomb", "one"): 0.02, ("coulomb", "two"): 0.02}
    )
    assert decision.chosen.members == ("coulomb",)
    assert decision.rivals == ()
    assert decision.shared == ()


def test_what_the_credible_share_of_all_sets_holds_is_all_told() -> None:
    """Each of two is in 97 % of all sets, both together in 94 %: one alone would leave out what is as certain."""
    s = signals()
    candidates = {"coulomb": {"coulomb_n": np.sign(s["speed"])}, "drag": {"drag_n": s["speed"] * np.abs(s["speed"])}}
    both = 0.3 * np.sign(s["speed"]) + 0.3 * candidates["drag"]["drag_n"]
    made = replace(machine(both, seed=5, candidates=candidates), drivers={})
    decision = decided_with(made, {("coulomb", "drag"): 0.94, ("coulomb",): 0.03, ("drag",): 0.03})
    assert decision.chosen.members == ("coulomb", "drag")
    assert decision.rivals == ()
    decision = decided_with(made, {("coulomb", "drag"): 0.92, ("coulomb",): 0.06, ("drag",): 0.02})
    assert decision.chosen.members == ("coulomb",)


def test_a_prediction_is_unsure_of_what_only_extends_the_answer() -> None:
    s = signals()
    candidates = {name: {f"{name}_n": noise(60 + i, size=1.0, tau=6.0)} for i, name in enumerate(("one", "two"))}
    candidates["coulomb"] = {"coulomb_n": np.sign(s["speed"])}
    made = replace(machine(0.3 * np.sign(s["speed"]), seed=5, candidates=candidates), drivers={})
    decision = decided_with(made, {("coulomb",): 0.6, ("coulomb", "one"): 0.39, ("coulomb", "two"): 0.01})
    assert decision.chosen.members == ("coulomb",)
    assert decision.rivals == ()
    ((other, share),) = decision.shared
    assert other.members == ("coulomb", "one")
    assert share == pytest.approx(0.39 / 0.99)


def decided_with(problem: LinearProblem, shares: Mapping[tuple[str, ...], float]) -> Decision:
    """Return the decision where sets hold these shares of the probability, however little their predictions differ."""
    settings = Settings(most=2)
    search = Search(replace(problem, resolution=0.0), settings=settings, progress=silent)
    field = search.run()
    sets = {
        members: replace(
            one, log_evidence=float(np.log(shares.get(members, 1e-9))) + settings.price(search.choices) * len(members)
        )
        for members, one in field.explanations.items()
    }
    return decide(replace(field, explanations=sets), settings=settings, choices=search.choices, can_hold_out=False)


@pytest.mark.parametrize(("resolution", "named"), [(0.02, ["spring"]), (0.1, [])])
def test_what_changes_the_prediction_by_less_than_the_resolution_is_not_named(resolution, named) -> None:
    """However sure it is: a record without noise shows the difference between two ways to compute the same model."""
    position = signals()["position"]
    made = machine(0.05 * position / np.std(position), seed=7, resolution=resolution, tau=1.0)
    found = find_missing(replace(made, drivers={}))
    assert list(found.decision.chosen.members) == named
    assert found.verdict == ("identified" if named else "none")


def test_of_two_that_are_alike_alone_the_one_is_found_that_fits_beside_the_rest() -> None:
    """Two that explain more alone are extended; what is hidden takes the place of one of them in the best set."""
    s = signals()
    one, two = (value / np.std(value) for value in (np.sign(s["speed"]), s["position"]))
    candidates = {"one": {"one_n": one}, "two": {"two_n": two}}
    for i, part in enumerate((0.5, 0.45)):
        candidates[f"like_{i}"] = {f"like_{i}_n": one + part * two + noise(20 + i, size=0.1, tau=6.0)}
    made = replace(machine(0.5 * one + 0.2 * two, seed=5, candidates=candidates), drivers={})
    # As parts of three they would be found in any case.
    search = Search(made, settings=Settings(most=2), progress=silent)
    decision = decide(search.run(), settings=Settings(), choices=search.choices, can_hold_out=True)
    assert decision.chosen.members == ("one", "two")


def test_a_form_that_is_less_probable_than_nothing_gives_no_name() -> None:
    """Its residual may be as small as the law's where only pulled values or errors of the inputs tell the two apart."""
    made = machine(0.5 * signals()["position"], seed=7, candidates={"spring": {"spring_n": signals()["position"]}})
    search = Search(made, settings=Settings(), progress=silent)
    field, choices = search.run(), search.choices
    law = next(one for members, one in field.explanations.items() if members == ("position",))
    spring = field.explanations["spring",]
    nothing = field.base.log_evidence - spring.log_evidence
    # Probabilities are no measure of it: on records with little noise all but one of them are zero.
    for change, base, named in ((-1.0, nothing, ["spring"]), (-2e3, -5e3, ["spring"]), (nothing - 1.0, nothing, [])):
        sets = {
            (): replace(field.base, log_evidence=spring.log_evidence + base),
            law.members: replace(law, log_evidence=spring.log_evidence + 1.0),
            spring.members: replace(spring, log_evidence=spring.log_evidence + change),
        }
        decision = decide(replace(field, explanations=sets), settings=Settings(), choices=choices, can_hold_out=False)
        assert [name for name, _ in decision.named.values()] == named


@dataclass(frozen=True, eq=False)
class _Warmed(LinearProblem):
    """A machine in which one effect makes errors of an input matter."""

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        return np.full(len(self.observed), 0.3 * abs(values["warmth_n"]) if "warmth" in effects else 0.0)


@dataclass(frozen=True, eq=False)
class _Jumping(LinearProblem):
    """A machine that jumps at one sample; with one effect it is expected to jump at the next."""

    def input_noise(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        del values
        return np.where(np.arange(len(self.observed)) == (101 if "warmth" in effects else 100), 5.0, 0.0)


def test_an_extended_set_is_no_less_probable_than_its_part_because_a_jump_is_expected_elsewhere() -> None:
    s = signals()
    jump = np.where(np.arange(len(s["speed"])) == 100, 5.0, 0.0)
    made = machine(0.3 * np.sign(s["speed"]) + 0.02 * (s["warm"] - 20.0) + jump, seed=5, sigma=0.05)
    jumping = _Jumping(**{field.name: getattr(made, field.name) for field in fields(made)})
    search = Search(replace(jumping, drivers={}), settings=Settings(), progress=silent)
    part = search.fits.with_effect(search.fits.plain(), "coulomb")
    whole = search.fits.with_effect(part, "warmth")
    assert whole.members == ("coulomb", "warmth")
    assert whole.log_evidence > part.log_evidence


@pytest.mark.parametrize(("sigmas", "followed"), [(0.5, False), (3.0, True)])
def test_a_start_where_a_set_would_lose_nothing_is_not_followed(
    monkeypatch: pytest.MonkeyPatch, *, sigmas: float, followed: bool
) -> None:
    search = Search(machine(0.0), settings=Settings(), progress=silent)
    plain, asked = search.fits.plain(), []
    search._keep([plain])
    name = plain.fit.parameters[0].name
    away = plain.fit.values[name] + sigmas * curvature_spread(plain)[0, 0] ** 0.5
    predict = LinearProblem.predict
    monkeypatch.setattr(LinearProblem, "predict", lambda *given: asked.append(1) or predict(*given))
    again = search._from_elsewhere((plain, {name: away}))
    assert (len(asked) > 0, again is not plain) == (followed, followed)


@pytest.mark.parametrize("name", ["coulomb", "direction"])
def test_what_cannot_come_within_reach_is_left_with_less_work_and_all_else_is_fitted_as_ever(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    search, asked = Search(machine(0.3 * np.sign(signals()["speed"]), seed=5), settings=Settings(), progress=silent), []
    plain, laws = search.fits.plain(), {law.id: law for law in search.fits.plain().fitter.problem.laws}
    predict = LinearProblem.predict
    monkeypatch.setattr(LinearProblem, "predict", lambda *given: asked.append(1) or predict(*given))

    def extended(least: float) -> tuple[float, int]:
        asked.clear()
        more = {"bar": Bar(least, least - plain.log_posterior)}
        found = (
            search.fits.with_law(plain, laws[name], **more)
            if name in laws
            else search.fits.with_effect(plain, name, **more)
        )
        return found.log_evidence, len(asked)

    # What is worked out once is not counted.
    extended(-np.inf)
    whole, work = extended(-np.inf)
    assert extended(plain.log_posterior + whole - plain.log_evidence) == (whole, work)
    left, less_work = extended(plain.log_posterior + 1e6)
    assert left <= whole + 1e-6
    assert less_work < work


def test_a_law_gains_what_a_linear_model_promises_of_it_and_nothing_is_promised_where_all_is_explained() -> None:
    search = Search(machine(0.3 * np.sign(signals()["speed"]), seed=5), settings=Settings(), progress=silent)
    plain = search.fits.plain()
    search._keep([plain])
    promised, columns = search._promised(((), "direction"))
    found = search.fits.with_law(plain, search._laws["direction"], columns=columns)
    assert found.log_posterior - plain.log_posterior == pytest.approx(promised, rel=0.2)
    search._keep([found])
    for name in ("position", "warm"):
        assert abs(search._promised((("direction",), name))[0]) < 3.0


def test_a_set_s_cost_is_that_at_its_present_weights() -> None:
    search = Search(hidden_pair(), settings=Settings(), progress=silent)
    for one in search.run().explanations.values():
        assert one.cost == pytest.approx(one.fitter.weighed(one.fit).cost, rel=1e-9)


def test_what_errors_of_the_inputs_do_is_each_set_s_own() -> None:
    s = signals()
    made = machine(0.3 * np.sign(s["speed"]) + 0.1 * (s["warm"] - 20.0), seed=5, sigma=0.05)
    warmed = _Warmed(**{field.name: getattr(made, field.name) for field in fields(made)})
    found = Search(replace(warmed, drivers={}), settings=Settings(), progress=silent).run().explanations
    for members in [("coulomb",), ("warmth",), ("coulomb", "warmth")]:
        one = found[members]
        own = np.hypot(0.05, 0.3 * one.fit.values["warmth_n"] if "warmth" in members else 0.0)
        assert one.likelihood.floor == pytest.approx(np.full(len(made.observed), own), rel=1e-6)


@dataclass(frozen=True, eq=False)
class _Kinked(LinearProblem):
    """A machine whose offset follows a value with a kink: from 0 upwards it ends at 0.6, below −1 it goes on to 1."""

    elsewhere: tuple[Mapping[str, float], ...] = ()

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        given = values["offset"]
        offset = 0.3 * given if given > -1.0 else -1.6 - 1.3 * given
        return super().predict({**values, "offset": offset}, effects)


@pytest.mark.parametrize("elsewhere", [(), ({"offset": 1.5}, {"offset": -1.9})])
def test_a_fit_leaves_the_wrong_side_of_a_kink_where_the_problem_says_where_to_look(elsewhere) -> None:
    plain = machine(0.3 * np.sign(signals()["speed"]), seed=5)
    bounded = tuple(replace(p, lower=-2.0, upper=2.0) if p.name == "offset" else p for p in plain.parameters)
    own = {field.name: getattr(plain, field.name) for field in fields(plain)}
    kinked = _Kinked(**{**own, "parameters": bounded, "elsewhere": elsewhere, "drivers": {}})
    found = Search(kinked, settings=Settings(), progress=silent).run()
    # All that are compared: the plain model, and the right effect.
    for one in (found.base, found.explanations["coulomb",]):
        assert one.fit.values["offset"] == pytest.approx(-2.0 if elsewhere else 2.0, abs=0.05)


@dataclass(frozen=True, eq=False)
class _Stepped(LinearProblem):
    """A machine whose output may step once, by an amount and at a time."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        plain = super().predict(values, [name for name in effects if name != "step"])
        # A step within four samples, so that a fit can move it.
        gone = 0.5 + 0.5 * np.tanh(self.time_s - values["at_s"]) if "step" in effects else 0.0
        return plain + gone * values.get("step", 0.0)


def test_another_form_of_a_law_is_tried_beside_what_was_found_with_the_law() -> None:
    """Alone, a small step is looked for at the wrong time: where what the law explains changes most."""
    position = signals()["position"]
    extra = 4.0 * position + 0.15 * np.sin(25.0 * position) - 0.15 * (signals()["time"] > 700.0)
    # Of pairs with the law more are better than a pair with its form and the wrong time.
    decoys = {f"decoy_{i}": {f"decoy_{i}_n": noise(30 + i, size=1.0, tau=2.0)} for i in range(5)}
    made = machine(extra, seed=3, candidates={"spring": {"spring_n": position}, **decoys}, tau=2.0)
    step = Candidate(
        "step",
        "",
        (Parameter("step", 0.1, "", null=0.0), Parameter("at_s", 600.0, "s", lower=0.0, upper=1200.0)),
        scales={"at_s": 4.0},
        event="at_s",
    )
    own = {field.name: getattr(made, field.name) for field in fields(made)}
    stepped = _Stepped(**{**own, "candidates": (*made.candidates, step), "drivers": {"position": position}})
    found = Search(stepped, settings=Settings(most=2), progress=silent).run().explanations
    assert abs(found["step",].fit.values["at_s"] - 700.0) > 50.0
    for members in [("position", "step"), ("spring", "step")]:
        assert found[members].fit.values["at_s"] == pytest.approx(700.0, abs=10.0)


@dataclass(frozen=True, eq=False)
class _Late(LinearProblem):
    """A machine with a steep flank in the middle of each block, read by a late clock or a late sensor."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        late_s = values["clock_s"] + (values["lag_s"] if "lag" in effects else 0.0)
        return values["offset"] + np.tanh(self.time_s % LENGTH - 0.5 * LENGTH - late_s)


def test_an_effect_promises_the_return_of_a_value_that_made_up_for_it() -> None:
    """From the effect's own start, with the value still off, a linear model misses the flanks altogether."""
    parts = {field.name: getattr(machine(0.0), field.name) for field in fields(LinearProblem)}
    clock = Parameter("clock_s", 0.0, "s", sigma=0.5)
    lag = Candidate("lag", "sensor", (Parameter("lag_s", 20.0, "s", null=0.0),), scales={"lag_s": clock.sigma})
    parts |= {"parameters": (Parameter("offset", 0.0, ""), clock), "candidates": (lag,), "drivers": {}}
    read = _Late(**parts).predict({"offset": 1.0, "clock_s": 0.0, "lag_s": 3.0}, ["lag"])
    problem = _Late(**{**parts, "observed": read + noise(3, size=0.05, tau=1.0)})
    fitter = Fitter(problem, Weight.of(np.full(LENGTH * BLOCKS, 1.0 / 0.05**2)))
    plain = fitter.base()
    off = plain.values["clock_s"] / clock.sigma
    assert off == pytest.approx(6.0, rel=0.1)
    assert fitter.promise(plain, "lag") == pytest.approx(off**2, rel=0.1)


@dataclass(frozen=True, eq=False)
class _Bent(LinearProblem):
    """A machine with friction that a value sets: 0.9 of it at most next to 1, all of it only far beyond 3."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        value = values.get("bent", 0.0)
        share = 0.9 * np.exp(-((value - 1.0) ** 2)) if value < 3.0 else 1.0 - np.exp(3.0 - value)
        return super().predict(values, ()) + ("bent" in effects) * 3.0 * share * np.sign(signals()["speed"])


def test_a_set_is_fitted_from_an_effect_s_other_starts_where_a_short_look_chose_the_wrong_one() -> None:
    own = {
        field.name: getattr(machine(3.0 * np.sign(signals()["speed"]), seed=5), field.name)
        for field in fields(LinearProblem)
    }
    # Gauss-Newton goes from 3 in steps of 1: after two of them 0.86 of the friction is there, less than from 0.5.
    value = Parameter("bent", 0.5, "", lower=-1.0, upper=20.0, null=-1.0)
    bent = Candidate("bent", "", (value,), starts=({"bent": 3.0},), scales={"bent": 1.0})
    made = _Bent(**{**own, "candidates": (bent,), "drivers": {}})
    found = Search(made, settings=Settings(), progress=silent).run().explanations
    assert found["bent",].fit.values["bent"] > 6.0


def test_a_member_that_fails_on_unseen_blocks_is_left_out() -> None:
    s = signals()
    made = machine(0.3 * np.sign(s["speed"]) + 0.06 * (s["warm"] - 20.0), seed=5)
    search = Search(replace(made, drivers={}), settings=Settings(), progress=silent)
    field = search.run()
    pair = field.explanations["coulomb", "warmth"]
    assert decide(field, settings=Settings(), choices=search.choices, can_hold_out=True).chosen is pair
    worse = replace(pair)
    worse.__dict__["held_out"] = replace(pair.held_out, residual=50.0 * pair.held_out.residual)
    field.explanations["coulomb", "warmth"] = worse
    decision = decide(field, settings=Settings(), choices=search.choices, can_hold_out=True)
    assert decision.chosen.members in {("coulomb",), ("warmth",)}


@dataclass(frozen=True, eq=False)
class _Sticking(LinearProblem):
    """A machine that starts late in each block, by so many samples."""

    def predict(self, values: Mapping[str, float], effects: Sequence[str]) -> np.ndarray:
        start = np.zeros(len(self.observed))
        if "sticking" in effects:
            start = 40.0 * values["excess"] * (1.0 + 0.5 * self.block) / (1.0 + 0.1 * self.block * values["power"])
        return values["offset"] + (self.time_s % LENGTH >= np.floor(start))


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_an_effect_that_jumps_is_found_by_trials(seed: int) -> None:
    own = (Parameter("excess", 0.2, "", lower=0.0, null=0.0), Parameter("power", 1.0, "", lower=0.1, sigma=0.5))
    parts = {field.name: getattr(machine(0.0), field.name) for field in fields(LinearProblem)}
    base = tuple(p for p in parts["parameters"] if p.name == "offset")
    made = replace(_Sticking(**parts), parameters=base, candidates=(Candidate("sticking", "", own),), drivers={})
    true = made.predict({"offset": 1.0, "excess": 0.7, "power": 1.4}, ("sticking",))
    made = replace(made, observed=true + noise(seed, size=0.05, tau=2.0))

    def left(problem: LinearProblem) -> float:
        fitter = Fitter(problem, Weight.of(np.full(len(true), 1.0 / 0.05**2)))
        fit = fitter.extend(fitter.base(), "sticking")
        return float(np.sqrt(np.mean((true - fit.solution.prediction) ** 2)))

    # The derivatives are zero all but everywhere: a start at the third of the truth is left where it is.
    assert left(made) > 0.3
    assert left(replace(made, candidates=(replace(made.candidates[0], jumps=True),))) < 0.05


def test_fits_that_nobody_waits_for_any_more_end_with_their_next_prediction() -> None:
    """Asked to end, a discovery does not wait for fits that are under way."""
    problem = hidden_pair()
    predict = AtPoint(problem, [p.name for p in problem.parameters], ())
    start, most = np.array([p.value for p in problem.parameters]), 20000
    predicted = [0]

    def work(item: int) -> None:
        for _ in range(item * most):
            predict(start)
            predicted[0] += 1

    def asked(_step: str, done: float, _total: float | None) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        in_parallel([0, 1], work, progress=asked)
    assert 0 <= predicted[0] < most
