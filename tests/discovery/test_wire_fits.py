"""The local fits by which discovery goes back behind a slow sensor: against plain least squares."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.actuator.record.conditioning import condition
from torsight.actuator.record.local_fits import _decays, _fit, _grow

K, REACH = 60, 40


def uneven_log() -> tuple[np.ndarray, np.ndarray]:
    """Return times of no set rate, in samples, and temperatures."""
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.7, 1.3, 150))
    return time, 40.0 + 0.05 * time + 3.0 * np.sin(time / 30.0) + 0.02 * rng.standard_normal(len(time))


@pytest.mark.parametrize("lag", [0.0, 9.0])
@pytest.mark.parametrize(("kind", "rows"), [(0, slice(41, 61)), (1, slice(60, 80)), (2, slice(41, 80))])
def test_a_window_is_fitted_as_least_squares_does(kind: int, rows: slice, lag: float) -> None:
    time, temp_c = uneven_log()
    sums, decay = np.zeros((3, 4, 5)), np.ones(len(time))
    # Decays that were made for an earlier sample serve this one.
    _decays(decay, time, K - 30, REACH, max(lag, 1.0))
    for first, last in ((0, 6), (6, 11), (11, 20)):
        _grow(sums, time, temp_c, decay, K, first, last, lag)
    found = _fit(sums[kind], lag)
    t = time[rows] - time[K]
    columns = [np.ones_like(t), t, t**2] + ([np.exp(-t / lag)] if lag else [])
    design = np.column_stack(columns)
    c = np.linalg.lstsq(design, temp_c[rows] - temp_c[K])[0]
    spread = np.linalg.inv(design.T @ design)
    value = np.array([1.0, lag, 0.0, 0.0])[: len(c)]
    slope = np.array([0.0, 1.0, 2.0 * lag, 0.0])[: len(c)]
    expected = (value @ c, slope @ c, c[2], value @ spread @ value, slope @ spread @ slope)
    # The fit holds its pivots off zero by 1e-12 of the number of samples; the smallest one here is some 1e-6.
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-7)


def test_what_decayed_long_before_is_nothing_and_long_ahead_is_held() -> None:
    time = np.array([0.0, 1.0, 2.0, 5000.0, 5001.0, 5002.0])
    decay = np.ones(6)
    _decays(decay, time, 1, 3, 2.0)
    assert decay[:3] == pytest.approx(np.exp([0.5, 0.0, -0.5]), rel=1e-15)
    assert decay[3] < 1e-200
    _decays(decay, time, 4, 4, 2.0)
    assert decay[3:] == pytest.approx(np.exp([0.5, 0.0, -0.5]), rel=1e-15)
    assert 1e200 < decay[2] < np.inf


def test_a_pause_of_the_log_leaves_the_wires_temperature_finite() -> None:
    time, temp_c = uneven_log()
    time = np.where(np.arange(len(time)) < 75, time, time + 4000.0)
    wire = condition(time, np.round(temp_c, 2), lag_s=3.0)
    assert np.isfinite(wire.temp_c).all()
    assert np.isfinite(wire.rate_c_s).all()
