"""Integration of a right-hand side that numba has compiled: Dormand and Prince's pair of order 5(4), steps of its own.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 2nd edition, table II.5.2 and
section II.4 (step size control).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit

Array = NDArray[np.float64]

_ATOL_SHARE: Final = 1e-2
_MOST_STEPS: Final = 10_000_000


def integrate(rhs: Callable[..., Any], time: Array, start: Array, inputs: Array, p: Any, *, rtol: float) -> Array:
    """Return the states (n, k) at the times; inputs (n, m) are lines between them.

    Raises
    ------
    ArithmeticError
        Where the steps become too small or too many.
    """
    made, failed = _integrate(rhs, time, start, inputs, p, rtol, _ATOL_SHARE * rtol)
    if failed >= 0:
        raise ArithmeticError(f"the solver gave up at t = {time[failed]:g}: the steps became too small or too many")
    return np.asarray(made)


_A: Final = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_C: Final = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_ERROR: Final = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
"""Weights of the difference between the solutions of order 5 and 4."""


@njit(error_model="numpy")
def _slope(rhs: Any, t: float, x: Array, u: Array, p: Any, out: Array) -> None:
    found = rhs(t, x, u, p)
    for i in range(len(x)):
        out[i] = found[i]


@njit(error_model="numpy")
def _step(rhs: Any, t: float, h: float, x: Array, ends: Any, p: Any, slopes: Array, new: Array) -> None:
    """Fill the seven slopes of a step and the state after it; ``ends``: time and inputs before and after."""
    begin, end, before, after = ends
    for stage in range(7):
        new[:] = x
        for j in range(stage):
            new += h * _A[stage, j] * slopes[j]
        at = t + _C[stage] * h
        share = (at - begin) / (end - begin)
        _slope(rhs, at, new, before + share * (after - before), p, slopes[stage])


@njit(error_model="numpy")
def _size(h: float, x: Array, new: Array, slopes: Array, rtol: float, atol: float) -> float:
    """Return the error of a step as a multiple of what is allowed."""
    total = 0.0
    for i in range(len(x)):
        error = 0.0
        for j in range(7):
            error += _ERROR[j] * slopes[j, i]
        allowed = atol + rtol * max(abs(x[i]), abs(new[i]))
        total += (h * error / allowed) ** 2
    return float(np.sqrt(total / len(x)))


@njit(error_model="numpy")
def _integrate(
    rhs: Any, time: Array, start: Array, inputs: Array, p: Any, rtol: float, atol: float
) -> tuple[Array, int]:
    """Return the states (n, k), and the row after which no step was small enough, else -1."""
    states = np.empty((len(time), len(start)))
    x, new, slopes = start.copy(), np.empty(len(start)), np.empty((7, len(start)))
    states[0] = x
    h = 0.1 * (time[-1] - time[0]) / max(1, len(time) - 1)
    steps = 0
    for i in range(len(time) - 1):
        t, end = time[i], time[i + 1]
        ends = (time[i], time[i + 1], inputs[i], inputs[i + 1])
        while end - t > 1e-12 * max(1.0, abs(end)):
            h = min(h, end - t)
            _step(rhs, t, h, x, ends, p, slopes, new)
            error = _size(h, x, new, slopes, rtol, atol)
            steps += 1
            if steps > _MOST_STEPS or h < 1e-14 * max(1.0, abs(t)) or not np.isfinite(error):
                return states, i
            if error <= 1.0:
                t += h
                x[:] = new
            # The usual safety factor and limits of a step's change (II.4).
            h *= min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
        states[i + 1] = x
    return states, -1
