"""The engine on linear machines with known answers, and on noise alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_cases import BLOCKS, LENGTH, machine, noise, signals, usual_candidates

from torsight.core.errors import InputError
from torsight.discovery.engine import find_missing
from torsight.discovery.intervals import covariance
from torsight.discovery.noise import Stretches, correlation_samples, residual_scales
from torsight.discovery.settings import Settings
from torsight.discovery.validate import held_out_by_refit


def test_nothing_is_named_where_nothing_is_missing() -> None:
    verdicts = [find_missing(machine(0.0, seed=seed), seed=seed).verdict for seed in range(12)]
    assert verdicts == ["none"] * 12


@pytest.mark.parametrize("name", sorted(usual_candidates()))
def test_one_missing_effect_is_named_with_its_value(name: str) -> None:
    column = next(iter(usual_candidates()[name].values()))
    size = 0.3 / np.sqrt(np.mean((column - column.mean()) ** 2))
    findings = find_missing(machine(size * column, seed=3))
    chosen = findings.decision.chosen
    assert findings.verdict == "identified"
    assert chosen.effects == (name,)
    index = [p.name for p in chosen.fit.parameters].index(next(iter(usual_candidates()[name])))
    sigma = np.sqrt(covariance(findings.field, chosen)[index, index])
    assert abs(chosen.fit.solution.x[index] - size) < 4.0 * sigma
    assert sigma < 0.2 * size


def test_two_missing_effects_are_both_named() -> None:
    s = signals()
    extra = 0.3 * np.sign(s["speed"]) + 0.06 * (s["warm"] - 20.0)
    findings = find_missing(machine(extra, seed=5))
    assert findings.verdict == "identified"
    assert findings.decision.chosen.effects == ("coulomb", "warmth")


@pytest.mark.parametrize(("ripple", "named"), [(0.0, ("coulomb", "warmth")), (0.2, ("coulomb",))])
def test_beside_a_large_effect_a_small_one_must_explain_nearly_all_that_is_left(
    ripple: float, named: tuple[str, ...]
) -> None:
    s = signals()
    small = 0.1 * (s["warm"] - 20.0) + ripple * np.sin(2.0 * np.pi * s["position"] / 0.3)
    findings = find_missing(machine(3.0 * np.sign(s["speed"]) + small, seed=5))
    assert findings.decision.chosen.effects == named


@pytest.mark.parametrize(
    ("size", "ripple", "named"),
    [(0.0, 0.0, ()), (0.02, 0.0, ()), (0.15, 0.0, ("coulomb",)), (0.15, 0.15, ())],
    ids=["nothing", "below the floor", "plain", "beside another one"],
)
def test_what_is_too_small_for_a_name_gets_one_in_plain_sight(
    size: float, ripple: float, named: tuple[str, ...]
) -> None:
    s = signals()
    extra = size * np.sign(s["speed"]) + ripple * np.sin(2.0 * np.pi * s["position"] / 0.3)
    # Nobody would miss a difference of one; the noise is known to be 0.05 and white.
    problem = machine(extra, seed=3, tau=1.0, sigma=0.05, resolution=1.0)
    assert find_missing(problem).decision.chosen.effects == named
    blind = Settings(plain_over_floor=np.inf)
    assert find_missing(problem, settings=blind).decision.chosen.effects == ()


def test_a_second_effect_in_plain_sight_is_named() -> None:
    s = signals()
    extra = 5.0 * np.sign(s["speed"]) + 0.05 * (s["warm"] - 20.0)
    problem = machine(extra, seed=3, tau=1.0, sigma=0.05, resolution=1.0)
    assert find_missing(problem).decision.chosen.effects == ("coulomb", "warmth")
    blind = Settings(plain_over_floor=np.inf)
    assert find_missing(problem, settings=blind).decision.chosen.effects == ("coulomb",)


def test_effects_that_the_record_cannot_tell_apart_are_both_told() -> None:
    s = signals()
    candidates = usual_candidates()
    rng = np.random.default_rng(0)
    # The same but for a part that is small against the noise.
    candidates["twin"] = {"twin_n": np.sign(s["speed"]) + 0.01 * rng.standard_normal(BLOCKS * LENGTH)}
    findings = find_missing(machine(0.3 * np.sign(s["speed"]), seed=2, candidates=candidates))
    assert findings.verdict == "ambiguous"
    named = {findings.decision.chosen.effects, *(rival.effects for rival in findings.decision.rivals)}
    assert named == {("coulomb",), ("twin",)}
    assert sum(findings.decision.probability.values()) == pytest.approx(1.0)


def test_what_has_no_name_is_unknown_with_what_it_depends_on() -> None:
    s = signals()
    extra = 0.5 * np.sin(2.0 * np.pi * s["position"] / 0.3)
    findings = find_missing(machine(extra, seed=4, candidates={"drift": usual_candidates()["drift"]}))
    assert findings.verdict == "unknown"
    assert findings.closure is not None
    assert findings.closure.drivers[0][0] == "position"
    assert findings.closure.held_out_gain > 0.8


def test_the_same_seed_gives_the_same_answer() -> None:
    extra = 0.3 * np.sign(signals()["speed"])
    one, two = (find_missing(machine(extra, seed=6), seed=1) for _ in range(2))
    assert one.decision.threshold == two.decision.threshold
    assert np.array_equal(one.decision.chosen.fit.solution.x, two.decision.chosen.fit.solution.x)


def test_held_out_blocks_are_those_of_explicit_fits() -> None:
    problem = machine(0.0, seed=8)
    findings = find_missing(problem)
    fitter, fit = findings.field.fitter, findings.field.base.fit
    found = held_out_by_refit(fitter, fit)
    columns = np.column_stack([problem.columns["gain"], problem.columns["offset"]])
    root = np.sqrt(fitter.weight)
    for label in range(BLOCKS):
        rows = problem.block == label
        others = ~rows
        best, *_ = np.linalg.lstsq(columns[others] * root[others, None], problem.observed[others] * root[others])
        expected = problem.observed[rows] - columns[rows] @ best
        assert np.allclose(found.residual[rows], expected, atol=2e-3)


def test_one_block_is_answered_without_a_hold_out() -> None:
    problem = machine(0.4 * np.sign(signals()["speed"]), seed=1)
    single = machine(0.4 * np.sign(signals()["speed"]), seed=1)
    object.__setattr__(single, "block", np.zeros_like(problem.block))
    findings = find_missing(single)
    assert findings.before is None
    assert findings.decision.chosen.effects == ("coulomb",)


def test_a_record_without_samples_is_refused() -> None:
    problem = machine(np.nan)
    with pytest.raises(InputError, match="no sample counts"):
        find_missing(problem)


def test_correlation_time_is_that_of_the_process() -> None:
    problem = machine(0.0)
    stretches = Stretches.of(problem)
    times = [correlation_samples(noise(seed, size=1.0, tau=6.0), stretches) for seed in range(40)]
    # 1200 samples hold 200 pieces of information; a window of five times τ gives τ to about 2 √(10 / 200) / √40.
    assert np.mean(times) == pytest.approx(6.0, rel=0.15)


def test_scales_are_what_lies_beyond_the_floor() -> None:
    problem = machine(0.0)
    stretches = Stretches.of(problem)
    rng = np.random.default_rng(0)
    residual = 0.5 * rng.standard_normal(len(problem.observed))
    scales = residual_scales(residual, stretches, np.full(len(residual), 0.3))
    # √(0.5² − 0.3²) = 0.4, known to 1 / √(2 · 1200).
    assert scales.motion == pytest.approx(0.4, rel=0.1)


def test_more_can_be_asked_of_a_name() -> None:
    extra = 0.3 * np.sign(signals()["speed"])
    strict = Settings(share_explained=1.1, near_floor=0.0)
    assert find_missing(machine(extra, seed=6), settings=strict).decision.chosen.effects == ()


def test_what_nothing_explains_is_stood_in_for_by_the_mechanism_that_comes_nearest() -> None:
    resting = np.tile(np.arange(LENGTH) < 30, BLOCKS)
    # Neither is a function of anything that is known; the mechanism without a name is the larger part.
    half, rest = (np.where(resting, 0.0, noise(seed, size=1.0, tau=25.0)) for seed in (21, 22))
    made = machine(0.5 * half + 0.25 * rest, seed=4, candidates={"half": {"half_n": half}}, sigma=0.05, tau=1.0)
    nameless = tuple(replace(c, named=False, drivers=("warm",)) for c in made.candidates)
    findings = find_missing(replace(made, candidates=nameless, rest=resting))
    assert findings.verdict == "unknown"
    assert findings.decision.chosen.effects == ("half",)
    assert [name for name, _ in findings.drivers] == ["warm"]
    assert findings.closure is None
    index = [p.name for p in findings.decision.chosen.fit.parameters].index("half_n")
    assert findings.decision.chosen.fit.solution.x[index] == pytest.approx(0.5, abs=0.1)
    assert findings.after is not None
    left = [np.sqrt(np.nanmean(each.residual**2)) for each in (findings.before, findings.after) if each is not None]
    assert left[1] < 0.7 * left[0]
