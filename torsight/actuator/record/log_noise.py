"""Noise and resolution of a temperature log, measured from the log itself."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.core.series import scatter_of_rows, usual_step
from torsight.core.units import Floats

_MAX_STRIDE_S: Final = 2.0
"""Noise whose neighbours are alike for longer is told from the wire by its size only; half and twice of it change
nothing (benchmarks/actuator/log_constants.py)."""
SHORTEST: Final = 16
"""Rows below which a log is taken as it is: a smoother has three values at its start, and each needs some five rows."""


def resolution(temp_c: Floats) -> float:
    """Return the step to which the log's numbers are rounded, °C (the smallest change that is not zero)."""
    steps = np.abs(np.diff(temp_c))
    steps = steps[steps > 1e-9]
    return float(np.quantile(steps, 0.01)) if len(steps) else 0.0


def measure_noise(time_s: Floats, temp_c: Floats) -> tuple[float, float]:
    """Return the noise's standard deviation in °C and over how many samples it is correlated.

    Third differences do not see lines and parabolas; their scale does not see corners. A stride of s samples sees
    noise whose neighbours within s samples are alike. How many are alike is read off the quieter parts of the log:
    where the temperature itself bends over a few strides it would pass for noise that is alike over many samples.
    """
    if len(time_s) < 2:
        return 0.0, 1.0
    longest = max(1, int(_MAX_STRIDE_S / usual_step(time_s)))
    strides = np.unique([max(1, round(longest ** (i / 8))) for i in range(9)])
    strides = strides[len(temp_c) >= 3 * strides + 8]
    if not len(strides):
        return 0.0, 1.0
    whole = np.array([scatter_of_rows(temp_c[None], stride=stride)[0] for stride in strides])
    # As many of the longest strides in a part as a log must have rows.
    count = max(1, len(temp_c) // (SHORTEST * int(strides[-1])))
    parts = _parts(temp_c, count)
    of_parts = [np.concatenate([scatter_of_rows(part, stride=stride) for part in parts]) for stride in strides]
    quiet = np.quantile(of_parts, 0.25, axis=1)
    # Where a log stands still to its last digit nothing is seen of its noise.
    seen = quiet if quiet.min() > 0.0 else whole
    enough = strides[np.argmax(seen >= 0.8 * seen.max())]
    return float(whole[strides <= 2 * enough].max()), float(enough)


def _parts(values: Floats, count: int) -> list[Floats]:
    """Cut values (n,) into so many parts; those of one length, which differs by one at most, stand together (k, m)."""
    length, longer = divmod(len(values), count)
    first = longer * (length + 1)
    return [values[:first].reshape(longer, length + 1), values[first:].reshape(count - longer, length)]
