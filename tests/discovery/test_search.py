"""Which sets are fitted: none that could be a rival is missing, and none stands above a part of itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from linear_cases import machine, noise, signals, usual_candidates

from torsight.core.progress import silent
from torsight.discovery.decide import decide
from torsight.discovery.fitting import EffectSet, Fit
from torsight.discovery.linear_problem import LinearProblem
from torsight.discovery.search import Search
from torsight.discovery.settings import Settings

PAIR, RIVAL = ("coulomb", "warmth"), ("warmth", "twin")


def problem() -> LinearProblem:
    """Return a machine that lacks two effects, one of which has a twin."""
    s = signals()
    candidates = usual_candidates()
    candidates["twin"] = {"twin_n": np.sign(s["speed"]) + noise(1, size=0.01, tau=6.0)}
    return machine(0.3 * np.sign(s["speed"]) + 0.06 * (s["warm"] - 20.0), seed=5, candidates=candidates)


class _Shortsighted(Search):
    """Passes over one of the rivals at first, as weights from a poor fit may."""

    def _promising(self, work: Mapping[EffectSet, tuple[Fit, str]]) -> dict[EffectSet, tuple[Fit, str]]:
        return {effects: item for effects, item in super()._promising(work).items() if effects != PAIR}


def test_a_rival_that_was_passed_over_is_found() -> None:
    found = _Shortsighted(problem(), settings=Settings(), progress=silent).run().contenders
    # The twin does as well but for its own noise.
    assert found[PAIR].cost < found[RIVAL].cost + Settings().rival_gain


def test_a_set_that_stands_above_a_part_of_itself_is_fitted_again() -> None:
    search = Search(problem(), settings=Settings(), progress=silent)
    search._fit_base()
    for size in (1, 2):
        search._grow(size)
        search._reweight()
    good = search._fits[PAIR]
    part = search._fits[PAIR[:1]]
    search._fits[PAIR] = replace(good, solution=replace(good.solution, cost=part.cost + 50.0))
    search._look_again(2)
    # The search ends where a step promises less than a per cent of a per cent.
    assert search._fits[PAIR].cost == pytest.approx(good.cost, rel=1e-3)


def test_the_few_best_extensions_are_fitted_though_they_promise_nothing() -> None:
    search = Search(machine(0.0), settings=Settings(), progress=silent)
    search._fit_base()
    search._grow(1)
    work = search._extensions(2)
    kept = search._promising(work)
    expected = search._expected(work)
    assert sorted(expected, key=lambda effects: (expected[effects], effects))[:3] == list(kept)[:3]
    assert all(work[effects][0].cost - expected[effects] < 20.0 for effects in kept)


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
    return machine(0.5 * one + 0.5 * two, seed=5, candidates=candidates)


class _Straight(Search):
    """Betters nothing."""

    def _improve(self, size: int) -> None:
        del size


def test_effects_that_explain_little_alone_are_found_together() -> None:
    assert ("one", "two") not in _Straight(hidden_pair(), settings=Settings(), progress=silent).run().contenders
    found = Search(hidden_pair(), settings=Settings(), progress=silent).run()
    assert found.of_size(2)[0].effects == ("one", "two")


def test_every_part_of_the_best_set_is_fitted() -> None:
    s = signals()
    left = s["position"] / np.std(s["position"])
    candidates = {
        "up": {"up_n": 6.0 * np.sign(s["speed"]) + left},
        "down": {"down_n": left**2 - 6.0 * np.sign(s["speed"])},
    }
    candidates |= {f"decoy_{i}": {f"decoy_{i}_n": left + left**2 + noise(20 + i, size=3.0, tau=6.0)} for i in range(3)}
    made = machine(1.5 * (left + left**2), seed=5, candidates=candidates)
    assert ("up", "down") not in _Straight(made, settings=Settings(), progress=silent).run().contenders
    found = Search(made, settings=Settings(), progress=silent).run()
    assert found.of_size(2)[0].effects == ("up", "down")


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
    kinked = _Kinked(**{**own, "parameters": bounded, "elsewhere": elsewhere})
    found = Search(kinked, settings=Settings(), progress=silent).run()
    # All that are compared: the base model, and the right effect.
    for contender in (found.base, found.contenders["coulomb",]):
        assert contender.fit.values["offset"] == pytest.approx(-2.0 if elsewhere else 2.0, abs=0.05)


def test_what_explains_best_is_told_though_it_fails_on_unseen_blocks() -> None:
    s = signals()
    candidates = usual_candidates() | {"twin": {"twin_n": np.sign(s["speed"]) + noise(1, size=0.1, tau=6.0)}}
    made = machine(0.3 * np.sign(s["speed"]), seed=5, candidates=candidates)
    field = Search(made, settings=Settings(), progress=silent).run()
    best, twin = field.contenders["coulomb",], field.contenders["twin",]
    assert best.cost < twin.cost - Settings().rival_gain
    seen = best.held_out
    best.__dict__["held_out"] = replace(seen, residual=50.0 * seen.residual, information=2500.0 * seen.information)
    decision = decide(field, settings=Settings(), seed=0)
    assert decision.chosen is twin
    assert best in decision.rivals


@pytest.mark.parametrize("worse", [1.0, 50.0])
def test_one_more_effect_in_plain_sight_is_told_though_it_fails_on_unseen_blocks(worse: float) -> None:
    s = signals()
    made = machine(0.3 * np.sign(s["speed"]) + 0.04 * (s["warm"] - 20.0), seed=5, tau=1.0, sigma=0.05)
    field = Search(made, settings=Settings(), progress=silent).run()
    assert decide(field, settings=Settings(), seed=0).chosen.effects == PAIR
    pair, single = field.contenders[PAIR], field.contenders[PAIR[:1]]
    seen = pair.held_out
    # In information, a single block may outweigh the residual of all others.
    spoilt = replace(seen, residual=worse * seen.residual, information=2500.0 * seen.information)
    pair.__dict__["held_out"] = spoilt
    decision = decide(field, settings=Settings(), seed=0)
    assert [decision.chosen, *decision.rivals] == ([single, pair] if worse > 1.0 else [pair, single])
