"""The engine on linear machines with known answers, and on noise alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_cases import BLOCKS, LENGTH, machine, noise, signals, usual_candidates

from torsight.core.errors import InputError
from torsight.core.parameter import Parameter
from torsight.discovery import find_missing as find_missing_of
from torsight.discovery.inference.engine import find_missing
from torsight.discovery.inference.explanation import covariance, curvature_spread, predictive_covariance
from torsight.discovery.inference.likelihood import Likelihood
from torsight.discovery.inference.noise import Stretches, correlation_samples, residual_scales
from torsight.discovery.inference.priors import outlier_cost
from torsight.discovery.inference.validate import held_out_by_refit
from torsight.discovery.settings import Settings


def test_nothing_is_named_where_nothing_is_missing() -> None:
    verdicts = [find_missing(machine(0.0, seed=seed), seed=seed).verdict for seed in range(12)]
    assert verdicts == ["none"] * 12


@pytest.mark.parametrize("name", sorted(usual_candidates()))
def test_one_missing_effect_is_named_with_its_value(name: str) -> None:
    column = next(iter(usual_candidates()[name].values()))
    size = 0.3 / np.sqrt(np.mean((column - column.mean()) ** 2))
    findings = find_missing(machine(size * column, seed=3))
    assert findings.verdict == "identified"
    ((named, chosen),) = findings.decision.named.values()
    assert named == name
    index = [p.name for p in chosen.fit.parameters].index(next(iter(usual_candidates()[name])))
    sigma = np.sqrt(covariance(chosen)[index, index])
    assert abs(chosen.fit.solution.x[index] - size) < 4.0 * sigma
    assert sigma < 0.2 * size


def test_values_lie_within_the_covariance_that_predictions_use() -> None:
    squares = []
    for seed in range(24):
        chosen = find_missing(machine(0.0, seed=seed, candidates={})).decision.chosen
        spread, off = predictive_covariance(chosen), chosen.fit.solution.x - np.array([2.0, 1.0])
        squares.append(off @ np.linalg.solve(spread, off))
        # Nowhere less than the posterior's curvature says.
        assert np.linalg.eigvals(np.linalg.solve(curvature_spread(chosen), spread)).real.min() > 1.0 - 1e-6
    # χ² of two values has the mean 2, its mean over so many records a standard deviation of 0.4.
    assert 1.2 < np.mean(squares) < 3.2


def test_two_missing_effects_are_both_named() -> None:
    s = signals()
    extra = 0.3 * np.sign(s["speed"]) + 0.06 * (s["warm"] - 20.0)
    findings = find_missing(machine(extra, seed=5))
    assert findings.verdict == "identified"
    assert {name for name, _ in findings.decision.named.values()} == {"coulomb", "warmth"}


@pytest.mark.parametrize("sigma", [0.05, 0.0])
def test_what_no_column_explains_is_unknown_and_never_none(sigma: float) -> None:
    s = signals()
    wave = 2.0 * np.sin(s["time"] / 5.0)
    problem = machine(wave, candidates={"coulomb": {"coulomb_n": np.sign(s["speed"])}}, tau=1.0, sigma=sigma)
    found = find_missing_of(replace(problem, drivers={"warm": s["warm"]}))
    assert (found.verdict, found.effects) == ("unknown", ())
    assert find_missing(replace(problem, drivers={"warm": s["warm"]})).verdict == "unknown"
    assert find_missing_of(machine(0.0, tau=1.0, sigma=sigma)).verdict == "none"


@pytest.mark.parametrize(("size", "named"), [(0.0, ()), (0.02, ()), (0.15, ("coulomb",))])
def test_what_noise_hides_gets_no_name(size: float, named: tuple[str, ...]) -> None:
    problem = machine(size * np.sign(signals()["speed"]), seed=3, tau=6.0)
    assert tuple(name for name, _ in find_missing(problem).decision.named.values()) == named


def test_values_of_which_a_record_says_nothing_do_not_hide_that_others_are_pulled() -> None:
    made = machine(0.4, seed=7, tau=1.0, sigma=0.06, candidates={})

    def pulled(silent: int) -> float:
        held = [Parameter("gain", 2.0, "", sigma=0.1), Parameter("offset", 1.0, "", sigma=0.1)]
        held += [Parameter(f"unseen_{k}", 0.0, "", sigma=1.0) for k in range(silent)]
        columns = {**made.columns, **{p.name: np.zeros(BLOCKS * LENGTH) for p in held[2:]}}
        return find_missing(replace(made, parameters=tuple(held), columns=columns)).field.plain.pulled

    # Half the cost of an offset that is four standard deviations off, less the one unit that is expected of each value.
    assert pulled(0) == pytest.approx(0.5 * (outlier_cost(np.array(4.0)) - 2.0), abs=0.5)
    assert pulled(40) == pytest.approx(pulled(0), abs=0.01)


def test_values_of_a_law_do_not_count_as_pulled() -> None:
    """The size of a law's prior follows the record: what its values cost is no sign that something else is missing."""
    s = signals()
    extra = 0.4 * s["speed"] + 0.5 * np.sin(2.0 * np.pi * s["position"] / 0.3)
    made = machine(extra, seed=7, tau=1.0, sigma=0.06)
    held = (Parameter("gain", 2.0, "", sigma=0.1), Parameter("offset", 1.0, "", sigma=0.1))
    found = find_missing(replace(made, parameters=held, candidates=())).field.explanations["position",]
    assert found.pulled == pytest.approx(0.5 * (outlier_cost(np.array(4.0)) - 2.0), abs=1.0)


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


def test_what_has_no_name_is_a_law_over_what_it_depends_on() -> None:
    s = signals()
    extra = 0.5 * np.sin(2.0 * np.pi * s["position"] / 0.3)
    findings = find_missing(machine(extra, seed=4, candidates={"drift": usual_candidates()["drift"]}))
    assert findings.verdict == "unknown"
    assert [name for name, _ in findings.drivers] == ["position"]
    (law,) = findings.decision.chosen.laws
    truth = 0.5 * np.sin(2.0 * np.pi * law.law.nodes / 0.3)
    # Over 1200 samples of noise 0.05 with correlation 6, 25 nodes: 0.05 √(25 · 6 / 1200) = 0.018, and the base's
    # offset and gain may take a constant and a slope from it.
    left = law.form.values(findings.decision.chosen.fit.values) - truth
    left -= np.polyval(np.polyfit(law.law.nodes, left, 1), law.law.nodes)
    assert np.sqrt(np.mean(left**2)) < 0.06


def test_a_usual_form_of_a_law_gives_it_its_name() -> None:
    """The law over the position explains what a spring does as well: both are one answer, by the name of the form."""
    made = machine(0.5 * signals()["position"], seed=7)
    named = tuple(replace(c, laws=("position",)) if c.id == "spring" else c for c in made.candidates)
    findings = find_missing(replace(made, candidates=named))
    assert findings.verdict == "identified"
    assert [name for name, _ in findings.decision.named.values()] == ["spring"]


def test_the_same_seed_gives_the_same_answer() -> None:
    extra = 0.3 * np.sign(signals()["speed"])
    one, two = (find_missing(machine(extra, seed=6), seed=1) for _ in range(2))
    assert one.decision.probability == two.decision.probability
    assert np.array_equal(one.decision.chosen.fit.solution.x, two.decision.chosen.fit.solution.x)


def test_held_out_blocks_are_those_of_explicit_fits() -> None:
    problem = machine(0.0, seed=8)
    findings = find_missing(problem)
    fitter, fit = findings.field.base.fitter, findings.field.base.fit
    found = held_out_by_refit(fitter, fit)
    columns = np.column_stack([problem.columns["gain"], problem.columns["offset"]])
    root = np.sqrt(fitter.weight.each)
    for label in range(BLOCKS):
        rows = problem.block == label
        others = ~rows
        best, *_ = np.linalg.lstsq(columns[others] * root[others, None], problem.observed[others] * root[others])
        expected = problem.observed[rows] - columns[rows] @ best
        assert np.allclose(found.residual[rows], expected, atol=2e-3)
        # What the fit leaves open of its values: the covariance of a prediction under flat priors.
        known = (columns[others] * fitter.weight.each[others, None]).T @ columns[others]
        unsure = found.unsure[rows] @ found.unsure[rows].T
        assert np.allclose(unsure, columns[rows] @ np.linalg.inv(known) @ columns[rows].T, rtol=1e-3)


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


def test_correlation_time_is_that_of_what_samples_say() -> None:
    problem = machine(0.0)
    stretches = Stretches.of(problem)
    rng = np.random.default_rng(3)
    floor = np.full(len(problem.observed), 0.1)
    # One sample in fifteen, beside a jump say, is known fifty times less well, and says as much less.
    floor[rng.random(len(floor)) < 1.0 / 15.0] = 5.0
    residuals = [
        noise(seed, size=0.1, tau=6.0) * np.where(floor > 1.0, 0.0, 1.0) + np.where(floor > 1.0, floor, 0.0) * white
        for seed, white in enumerate(rng.standard_normal((20, len(floor))))
    ]
    likelihood = Likelihood.of(stretches, floor, 1.0)
    raw = [correlation_samples(residual, stretches) for residual in residuals]
    said = [correlation_samples(likelihood.in_scales(residual), stretches) for residual in residuals]
    assert np.mean(raw) < 1.3
    # The rest of the variance is white, the other samples' correlation is that of the process.
    assert np.mean(said) == pytest.approx(1.0 + 5.0 * (14.0 / 15.0) ** 2, rel=0.15)


def test_a_step_between_rests_of_one_level_is_no_error_of_the_inputs() -> None:
    # Motion, a rest, a few rows of seeming motion, a rest; the inputs' noise is that of where it came to rest.
    n = 60
    rest, block = np.arange(n) >= 20, np.zeros(n, np.int64)
    rest[38:42] = False
    record = SimpleNamespace(valid=np.ones(n, bool), rest=rest, block=block, share=np.ones(n), opening_blocks=())
    stretches = Stretches.of(record)
    inputs = np.where(np.arange(n) < 20, np.linspace(0.05, 0.38, n), 0.4)
    level, step = np.where(rest, 0.5, 0.0), np.where(np.arange(n) > 40, 0.8, 0.0)

    def log(residual: np.ndarray) -> float:
        lasting = stretches.lasting(inputs, block)
        floor = np.hypot(0.02, np.where(lasting.any(axis=1), 0.0, inputs))
        likelihood = Likelihood.of(stretches, floor, 1.0, least=0.1, shared=0.4 * lasting, levels=0.3 * lasting)
        return likelihood.log(residual)

    # An error of the level is no surprise; the step is one of 0.8 over √2 times the least discrepancy.
    assert log(np.zeros(n)) - log(level) < 2.0
    assert log(level) - log(level + step) > 0.3 * (0.8 / 0.1) ** 2 / 2.0


@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_pieces_of_information_are_those_of_a_mixture(part: float) -> None:
    """The variance of a mean is that of as many independent samples as there are pieces of information."""
    problem = machine(0.0)
    stretches = Stretches.of(problem)
    rows = slice(int(stretches.start[0]), int(stretches.stop[0]))
    n, step_s, alike_s = rows.stop - rows.start, float(problem.time_s[1] - problem.time_s[0]), 8.0
    white, inputs = stretches.counts(1.0), np.full(len(problem.observed), part)
    count = stretches.counts_with(white, inputs, problem.time_s, np.full(len(white), alike_s))[rows]
    # An exponential correlation of the same integrated time.
    keep = (alike_s / step_s - 1.0) / (alike_s / step_s + 1.0)
    rows_apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = part * keep**rows_apart + (1.0 - part) * np.eye(n)
    assert 1.0 / np.sum(count) == pytest.approx(float(np.mean(covariance)), rel=0.1)


def test_a_clock_that_stands_still_between_samples_takes_no_information() -> None:
    """Loggers with coarse clocks give several samples one time; without slow errors they count as before."""
    problem = machine(0.0)
    stretches, n = Stretches.of(problem), len(problem.observed)
    white, coarse_s = stretches.counts(1.0), np.floor(problem.time_s / 5.0) * 5.0
    count = stretches.counts_with(white, np.zeros(n), coarse_s, np.zeros(n))
    np.testing.assert_allclose(count, white)
    slow = stretches.counts_with(white, np.ones(n), coarse_s, np.full(n, 8.0))
    assert np.all(slow > 0.0)


def test_scales_are_what_lies_beyond_the_floor() -> None:
    problem = machine(0.0)
    stretches = Stretches.of(problem)
    rng = np.random.default_rng(0)
    residual = 0.5 * rng.standard_normal(len(problem.observed))
    scales = residual_scales(residual, stretches, np.full(len(residual), 0.3))
    # √(0.5² − 0.3²) = 0.4, known to 1 / √(2 · 1200).
    assert scales.motion == pytest.approx(0.4, rel=0.1)


def test_more_can_be_asked_before_anything_is_said() -> None:
    problem = machine(0.02 * np.sign(signals()["speed"]), seed=6, tau=1.0)
    least = find_missing(problem).decision.missing
    strict = Settings(certain=0.5 * (1.0 + least))
    assert find_missing(problem, settings=strict).decision.chosen.effects == ()
