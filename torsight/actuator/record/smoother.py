r"""The wire's temperature behind a noisy log, and behind a slow sensor: a smoother whose slope may jump.

Between two readings the wire's temperature T moves on a parabola; at a reading its slope and its bend may jump,

.. math:: Δ\dot T_i \sim N(0, λ_i s_{1,i}^2), \quad Δ\ddot T_i \sim N(0, λ_i s_{2,i}^2), \quad
          λ_i^{-1} \sim \mathrm{Gamma}(ν/2, ν/2)

Student's t with few degrees of freedom ν: nearly all jumps are nearly nothing, and a few (a heater that is switched, a
reference that is reached) are as large as they are. So a corner stays sharp, and everything between corners is averaged
over. The usual sizes s are those of a stretch of the log: a wire that cools by itself bends, on a ramp it does not. A
sensor with the time constant τ reads :math:`τ \dot T_m = T - T_m`, which is solved exactly along a parabola: the noise
is not differentiated anywhere.

For given λ and s the most probable wire, and how well each of its temperatures is known, come out of a Kalman filter
and the backward recursions of its smoother (Durbin and Koopman, Time Series Analysis by State Space Methods (2012),
sections 4.4 to 4.5). λ and s are found in turn with them, as the marginal likelihood asks: each jump's variance goes to
its square over how far the log decides it (MacKay, Neural Computation 4 (1992) 415; Tipping, J. Mach. Learn. Res. 1
(2001) 211).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from torsight.core.compiled import compiled
from torsight.core.series import usual_step
from torsight.core.units import Floats

# What half and twice of each do is measured by benchmarks/actuator/log_constants.py.
_DEGREES: Final = 0.6
"""Degrees of freedom ν of the jumps: with half and twice wires err 0.94 and 1.10 times as much, tops 1.3 times."""
_ALIKE_S: Final = 45.0
"""Over so many seconds jumps are of one usual size: with half or twice wires err by 1 % more, tops by 30 % and by less
than 1 %."""
_ROUNDS: Final = 12
"""Smoothing and sizes of the jumps in turn: wires err 1.13 and 0.94 times as much with half and twice."""
_AVERAGED_S: Final = 10.0
"""Where the rounds begin: jumps so large that noise is averaged over about so long. With half or twice wires err as
much, to 1 %."""
_LEAST: Final = 1e-18
"""Variance of a jump that is none; it is divided by."""
# What may be true before the first reading: the wire behind a sensor 100 °C off, 10 °C/s, 1 °C/s².
_UNKNOWN: Final = (1e4, 1e4, 1e2, 1.0)


class _Forward(NamedTuple):
    """What the filter leaves for the way back: states before each reading (n, m), their covariances (n, m, m), gains.

    A state is the reading without noise (where the sensor is slow), the wire, its slope and its bend.
    """

    state: Floats
    spread: Floats
    gain: Floats
    surprise: Floats
    variance: Floats


class _Smoothed(NamedTuple):
    """The wire at every reading (n,); its jumps (2, n) of slope and bend, and how far the log decides each."""

    value: Floats
    slope: Floats
    sigma: Floats
    jump: Floats
    decided: Floats


def smoothed(time_s: Floats, temp_c: Floats, sigma_c: float, lag_s: float) -> tuple[Floats, Floats, Floats]:
    """Return the wire's temperature (n,) at readings of so much noise, its slope and one standard deviation.

    ``time_s`` (n,) increasing, not necessarily at one rate; ``lag_s`` is the sensor's time constant.
    """
    n, size, noise = len(temp_c), 4 if lag_s > 0.0 else 3, sigma_c**2
    forward = _Forward(np.empty((n, size)), np.empty((n, size, size)), np.empty((n, size)), np.empty(n), np.empty(n))
    found = _Smoothed(np.empty(n), np.empty(n), np.empty(n), np.zeros((2, n)), np.zeros((2, n)))
    # Noise σ of readings every h seconds hides, over t seconds, jumps of h σ² / t³ (slope) and h σ² / t⁵ (bend).
    step_s = usual_step(time_s)
    jumps = np.full((2, n), noise * step_s / np.array([[_AVERAGED_S**3], [_AVERAGED_S**5]]))
    usual, spread, alike = jumps[:, 1:], np.ones(n - 1), max(1, round(_ALIKE_S / step_s))
    for rounds in range(_ROUNDS):
        _filter(time_s, temp_c, noise, lag_s, jumps, forward)
        _smooth(time_s, lag_s, jumps, forward, found)
        square, decided = found.jump[:, 1:] ** 2, found.decided[:, 1:]
        if rounds:
            sizes = uniform_filter1d(square / spread, alike, mode="nearest")
            usual = np.maximum(sizes / np.maximum(uniform_filter1d(decided, alike, mode="nearest"), _LEAST), _LEAST)
        spread = (_DEGREES + np.sum(square / usual, axis=0)) / (_DEGREES + np.sum(decided, axis=0))
        # Only the product of the two is known: the harmonic mean of λ is one.
        whole = 1.0 / np.mean(1.0 / spread)
        spread, usual = spread / whole, usual * whole
        jumps[:, 1:] = np.maximum(usual * spread, _LEAST)
    return found.value, found.slope, found.sigma


@compiled
def _transition(matrix: Floats, span_s: float, lag_s: float) -> None:
    """Set how a state (m,) goes on over a time: upper triangular, the wire on a parabola, the sensor after it."""
    wire = matrix.shape[0] - 3
    half = 0.5 * span_s * span_s
    matrix[:] = 0.0
    matrix[wire, wire] = matrix[wire + 1, wire + 1] = matrix[wire + 2, wire + 2] = 1.0
    matrix[wire, wire + 1], matrix[wire, wire + 2], matrix[wire + 1, wire + 2] = span_s, half, span_s
    if wire:
        # A first-order lag's responses to 1, t and t²/2, and what is left of where it was.
        gone = -math.expm1(-span_s / lag_s)
        ramp = span_s - lag_s * gone
        matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3] = 1.0 - gone, gone, ramp, half - lag_s * ramp


@compiled
def _turned(matrix: Floats) -> None:
    """Transpose a matrix in place."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            matrix[i, j], matrix[j, i] = matrix[j, i], matrix[i, j]


@compiled
def _carried(matrix: Floats, vector: Floats, square: Floats, room: Floats) -> None:
    """Set ``vector`` (m,) to matrix · vector and ``square`` (m, m), symmetric, to matrix · square · matrixᵀ.

    ``room`` (m + 1, m) is overwritten.
    """
    size = matrix.shape[0]
    for i in range(size):
        room[size, i] = 0.0
        for j in range(size):
            room[size, i] += matrix[i, j] * vector[j]
            room[i, j] = 0.0
            for k in range(size):
                room[i, j] += matrix[i, k] * square[k, j]
    for i in range(size):
        vector[i] = room[size, i]
        for j in range(i, size):
            total = 0.0
            for k in range(size):
                total += room[i, k] * matrix[j, k]
            square[i, j] = square[j, i] = total


@compiled
def _rooms(size: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Return zeros for what a pass carries along: a transition, room for products, a square and a vector."""
    return np.zeros((size, size)), np.zeros((size + 1, size)), np.zeros((size, size)), np.zeros(size)


@compiled
def _filter(time_s: Floats, temp_c: Floats, noise: float, lag_s: float, jumps: Floats, forward: _Forward) -> None:
    """Go through the readings once, and keep what is known before each of them."""
    size = forward.state.shape[1]
    wire = size - 3
    matrix, room, spread, state = _rooms(size)
    state[: wire + 1] = temp_c[0]
    for i in range(size):
        spread[i, i] = _UNKNOWN[4 - size + i]
    span_s = -1.0
    for k in range(temp_c.size):
        if k > 0:
            spread[wire + 1, wire + 1] += jumps[0, k]
            spread[wire + 2, wire + 2] += jumps[1, k]
            if time_s[k] - time_s[k - 1] != span_s:
                span_s = time_s[k] - time_s[k - 1]
                _transition(matrix, span_s, lag_s)
            _carried(matrix, state, spread, room)
        variance, surprise = spread[0, 0] + noise, temp_c[k] - state[0]
        forward.variance[k], forward.surprise[k] = variance, surprise
        for i in range(size):
            forward.state[k, i], forward.gain[k, i] = state[i], spread[i, 0] / variance
            for j in range(size):
                forward.spread[k, i, j] = spread[i, j]
        for i in range(size):
            state[i] += forward.gain[k, i] * surprise
            for j in range(size):
                spread[i, j] -= forward.gain[k, i] * forward.spread[k, 0, j]


@compiled
def _told(forward: _Forward, k: int, pull: Floats, known: Floats, room: Floats) -> None:
    """Add what reading k says of the state before it to what the later ones say."""
    size = pull.size
    gain, variance = forward.gain[k], forward.variance[k]
    along = twice = 0.0
    for i in range(size):
        room[0, i] = 0.0
        for j in range(size):
            room[0, i] += known[i, j] * gain[j]
        along += gain[i] * pull[i]
        twice += gain[i] * room[0, i]
    pull[0] += forward.surprise[k] / variance - along
    for i in range(size):
        known[0, i] -= room[0, i]
        known[i, 0] -= room[0, i]
    known[0, 0] += twice + 1.0 / variance


@compiled
def _set(forward: _Forward, k: int, pull: Floats, known: Floats, found: _Smoothed) -> None:
    """Set the wire at reading k by what is known before it and by what it and the later ones say."""
    size = pull.size
    wire, state, spread = size - 3, forward.state[k], forward.spread[k]
    value, slope, variance = state[wire], state[wire + 1], spread[wire, wire]
    for i in range(size):
        value += spread[wire, i] * pull[i]
        slope += spread[wire + 1, i] * pull[i]
        for j in range(size):
            variance -= spread[wire, i] * known[i, j] * spread[wire, j]
    found.value[k], found.slope[k], found.sigma[k] = value, slope, math.sqrt(max(variance, 0.0))


@compiled
def _smooth(time_s: Floats, lag_s: float, jumps: Floats, forward: _Forward, found: _Smoothed) -> None:
    """Go back through the readings, and set the wire at each of them by all of the log, and its jumps.

    ``pull`` (m,) and ``known`` (m, m) are what the readings from here on say of the state: the gradient of their
    logarithmic likelihood, and the information in it.
    """
    size = forward.state.shape[1]
    wire = size - 3
    matrix, room, known, pull = _rooms(size)
    span_s = -1.0
    for k in range(time_s.size - 1, -1, -1):
        _told(forward, k, pull, known, room)
        _set(forward, k, pull, known, found)
        if k == 0:
            break
        if time_s[k] - time_s[k - 1] != span_s:
            span_s = time_s[k] - time_s[k - 1]
            _transition(matrix, span_s, lag_s)
            _turned(matrix)
        _carried(matrix, pull, known, room)
        for i in range(2):
            found.jump[i, k] = jumps[i, k] * pull[wire + 1 + i]
            found.decided[i, k] = jumps[i, k] * known[wire + 1 + i, wire + 1 + i]
