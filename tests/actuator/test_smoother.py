"""The smoother by which a wire's temperature is found, against the same model solved with dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from torsight.actuator.record.conditioning import Readings
from torsight.actuator.record.smoother import smoothed

Array = NDArray[np.float64]
DEGREES, ROUNDS, AVERAGED_S, ALIKE_S, NOISE_C = 0.6, 12, 10.0, 45.0, 0.05


def uneven_log(count: int) -> tuple[Array, Array]:
    """Return times at no set rate and temperatures with a corner."""
    rng = np.random.default_rng(2)
    time_s = np.cumsum(rng.uniform(0.7, 1.3, count))
    ramp = 40.0 + 0.4 * np.minimum(time_s, 0.6 * time_s[-1]) + np.sin(time_s / 30.0)
    return time_s, ramp + NOISE_C * rng.standard_normal(count)


def responses(past_s: Array, lag_s: float) -> tuple[Array, Array, Array, Array]:
    """Return what sensors read of 1, t and t²/2 that begin at zero, and what is left of where they were."""
    t = np.maximum(past_s, 0.0)
    if lag_s == 0.0:
        return np.ones_like(t), t, 0.5 * t**2, np.zeros_like(t)
    left = np.exp(-t / lag_s)
    ramp = t - lag_s * (1.0 - left)
    return 1.0 - left, ramp, 0.5 * t**2 - lag_s * ramp, left


def dense(time_s: Array, temp_c: Array, lag_s: float) -> tuple[Array, Array, Array, float]:
    """Return value, slope and sigma of the wire: all jumps and the start as the unknowns of one linear system.

    Also return the log density of the readings after the first, with the widths of the jumps' variances.
    """
    n = len(time_s)
    one, ramp, bow, left = responses(time_s - time_s[0], lag_s)
    later = time_s[:, None] - time_s[None, :-1]
    _, jump_ramp, jump_bow, _ = responses(later, lag_s)
    t, u = time_s - time_s[0], np.maximum(later, 0.0)
    started = (later > 0.0).astype(float)
    start, start_prior, known = [one, ramp, bow], [1e4, 1e2, 1.0], [temp_c[0], 0.0, 0.0]
    wire, slope = [np.ones(n), t, 0.5 * t**2], [np.zeros(n), np.ones(n), t]
    if lag_s > 0.0:
        start, start_prior, known = [left, *start], [1e4, *start_prior], [temp_c[0], *known]
        wire, slope = [np.zeros(n), *wire], [np.zeros(n), *slope]
    reads = np.column_stack([*start, jump_ramp, jump_bow])
    wires = np.column_stack([*wire, u, 0.5 * u**2])
    slopes = np.column_stack([*slope, started, u])
    mean = np.concatenate([known, np.zeros(2 * (n - 1))])
    step_s = float(np.median(np.diff(time_s)))
    scale = np.tile(NOISE_C**2 * step_s / np.array([[AVERAGED_S**3], [AVERAGED_S**5]]), (1, n - 1))
    spread = np.ones(n - 1)
    # Each jump with those around it, the first and last as often as the window reaches over the ends.
    reach = round(ALIKE_S / step_s)
    around = np.clip(np.arange(n - 1)[:, None] + np.arange(reach) - reach // 2, 0, n - 2)
    for rounds in range(ROUNDS):
        prior = np.concatenate([start_prior, (scale * spread).ravel()])
        together = (reads * prior) @ reads.T + NOISE_C**2 * np.eye(n)
        gain = np.linalg.solve(together, reads * prior).T
        off = temp_c - reads @ mean
        found = mean + gain @ off
        covariance = np.diag(prior) - gain @ (reads * prior)
        value, rate = wires @ found, slopes @ found
        sigma = np.sqrt(np.einsum("ij,jk,ik->i", wires, covariance, wires))
        jumps = len(start)
        square = found[jumps:].reshape(2, -1) ** 2
        decided = 1.0 - np.diag(covariance)[jumps:].reshape(2, -1) / prior[jumps:].reshape(2, -1)
        if rounds:
            scale = (square / spread)[:, around].sum(axis=2) / decided[:, around].sum(axis=2)
        spread = (DEGREES + (square / scale).sum(axis=0)) / (DEGREES + decided.sum(axis=0))
        usual = 1.0 / np.mean(1.0 / spread)
        spread, scale = spread / usual, scale * usual
    density = -0.5 * (off @ np.linalg.solve(together, off) + np.linalg.slogdet(together)[1])
    density += 0.5 * (off[0] ** 2 / together[0, 0] + np.log(together[0, 0]))
    return value, rate, sigma, density - 0.5 * np.sum(np.log(DEGREES + decided.sum(axis=0)))


@pytest.mark.parametrize("lag_s", [0.0, 4.0])
def test_it_is_what_the_model_says(lag_s: float) -> None:
    time_s, temp_c = uneven_log(60)
    value, slope, sigma, log_evidence = smoothed(time_s, temp_c, NOISE_C, lag_s)
    expected = dense(time_s, temp_c, lag_s)
    # The dense system takes what is known from variances of 1e4 °C²: it gives three digits of a variance of 1e-3 °C².
    np.testing.assert_allclose(value, expected[0], rtol=0.0, atol=1e-4 * NOISE_C)
    np.testing.assert_allclose(slope, expected[1], rtol=0.0, atol=1e-4 * NOISE_C)
    np.testing.assert_allclose(sigma, expected[2], rtol=5e-3)
    assert log_evidence == pytest.approx(expected[3], abs=0.01)


@pytest.mark.parametrize("lag_s", [0.0, 3.0])
def test_errors_are_as_large_as_they_are_said_to_be(lag_s: float) -> None:
    """Wires that are drawn at random: pieces of their own slopes and bends, of 20 to 60 s."""
    rng = np.random.default_rng(7)
    pulls = []
    for _ in range(8):
        fine_s = np.arange(0.0, 400.0, 0.01)
        ends = np.cumsum(rng.uniform(20.0, 60.0, 20))
        slopes = rng.uniform(-1.0, 1.0, 21)[np.searchsorted(ends, fine_s)]
        wire = 50.0 + np.cumsum(slopes) * 0.01
        read = wire.copy()
        if lag_s > 0.0:
            for k in range(1, len(read)):
                read[k] = wire[k] + (read[k - 1] - wire[k]) * np.exp(-0.01 / lag_s)
        rows = np.arange(0, len(fine_s), 25)
        value, _, sigma, _ = smoothed(
            fine_s[rows], read[rows] + NOISE_C * rng.standard_normal(len(rows)), NOISE_C, lag_s
        )
        pulls.append(((value - wire[rows]) / sigma)[40:-40])
    # 8 logs of some ten pieces each, the errors in a piece alike: 80 pieces of information give 8 %, thrice that.
    assert np.sqrt(np.mean(np.concatenate(pulls) ** 2)) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("lag_s", [0.0, 3.0])
def test_what_stands_still_stays_as_it_is(lag_s: float) -> None:
    time_s = np.arange(0.0, 100.0, 0.25)
    value, slope, sigma, _ = smoothed(time_s, np.full(400, 23.0), 0.01, lag_s)
    np.testing.assert_allclose(value, 23.0, atol=1e-9)
    np.testing.assert_allclose(slope, 0.0, atol=1e-9)
    assert (sigma < 0.01).all()


def test_a_pause_of_the_log_leaves_the_wires_temperature_finite() -> None:
    time_s, temp_c = uneven_log(150)
    time_s = np.where(np.arange(150) < 75, time_s, time_s + 4000.0)
    wire = Readings.of(time_s, np.round(temp_c, 2)).behind(time_s, 3.0)
    assert np.isfinite(wire.temp_c).all()
    assert np.isfinite(wire.rate_c_s).all()
