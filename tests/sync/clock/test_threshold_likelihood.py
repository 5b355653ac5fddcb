"""The likelihood of the clock by thresholds: sums over offsets."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from sync.clock.gaussian_mixture import Gaussian, mixed
from sync.clock.threshold_crossings import ThresholdCrossings
from sync.clock.threshold_likelihood import Thresholds
from sync.signals.heating_segments import LogSignals
from torsight.core.units import Floats

PEAK_S = 0.05


class TwoPeaks(Thresholds):
    """A likelihood with two equal peaks, at offsets of 0 and 32 s."""

    def scan(self, offset_s: Floats, *, every: int = 2) -> list[dict[float, Gaussian]]:
        """Return a narrow Gaussian at each offset, with the weight of the nearer peak."""
        assert every == 1, "the sum is over every size of scatter"
        away_s = np.minimum(np.abs(offset_s), np.abs(offset_s - 32.0))
        variance = np.diag([1e-6, 1e-10])
        return [
            {1.0: Gaussian(np.array([at, 0.0]), variance, -0.5 * (away / PEAK_S) ** 2)}
            for at, away in zip(offset_s.tolist(), away_s.tolist(), strict=True)
        ]


@pytest.mark.parametrize(("low_s", "high_s", "peak_s"), [(0.0, 32.0, 0.0), (-3.0, 32.0, 32.0)])
def test_of_two_peaks_between_which_nothing_fits_one_is_summed_up(low_s: float, high_s: float, peak_s: float) -> None:
    wide = Gaussian(np.array([16.0, 0.0]), np.diag([1e6, 1e-8]), 0.0)
    peaks = TwoPeaks(cast(ThresholdCrossings, None), cast(LogSignals, None), (), 0.0, wide)
    found = mixed(peaks.around_maximum(low_s, high_s).values())
    assert found.mean[0] == pytest.approx(peak_s, abs=PEAK_S)
    assert 0.5 * PEAK_S < np.sqrt(found.covariance[0, 0]) < 1.1 * PEAK_S
