r"""Estimation of the wire's temperature from a noisy log, also of a slow sensor: a smoother whose slope may jump.

Between two readings the wire's temperature T is a parabola; at a reading its slope and its second derivative may jump,

.. math:: Δ\dot T_i \sim N(0, λ_i s_{1,i}^2), \quad Δ\ddot T_i \sim N(0, λ_i s_{2,i}^2), \quad
          λ_i^{-1} \sim \mathrm{Gamma}(ν/2, ν/2)

The jumps have a Student's t distribution with few degrees of freedom ν: nearly all are nearly zero, and a few (a heater
is switched, a reference is reached) may have any size. So a corner stays sharp, and all readings between corners are
averaged. The usual sizes s vary along the log: the temperature of a freely cooling wire bends, that of a ramp does not.
A sensor with the time constant τ reads :math:`τ \dot T_m = T - T_m`, which is solved exactly along a parabola: the
noise is not differentiated anywhere.

For given λ and s a Kalman filter and the backward recursions of its smoother give the most probable temperature of the
wire and its standard deviation (Durbin and Koopman, Time Series Analysis by State Space Methods (2012), sections 4.4 to
4.5). λ and s are estimated alternately with it by the marginal likelihood: each jump's variance becomes its square
divided by the degree to which the log determines it (MacKay, Neural Computation 4 (1992) 415; Tipping, J. Mach. Learn.
Res. 1 (2001) 211).

The filter also gives the evidence of the readings for a time constant of the sensor: corners that are sharp in a log
were not read by a slow sensor, because a wire's temperature does not jump. With the innovations v_k, their variances
F_k, and Laplace's method for every ln λ_i,

.. math:: \ln p(T_m \mid τ) ≈ -\tfrac12 \sum_k \left( v_k^2 / F_k + \ln F_k \right)
          - \tfrac12 \sum_i \ln (ν + d_i)

up to a constant, with d_i the degree to which the log determines both jumps. The density of λ at its estimate is left
out: λ and s share a product, of which the log determines no more than the whole.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from torsight.core.compiled import compiled
from torsight.core.series import usual_step
from torsight.core.units import Floats

# benchmarks/actuator/log_constants.py measures the effect of half and twice of each constant.
_DEGREES: Final = 0.6
"""Degrees of freedom ν of the jumps: with half and twice the wires' temperatures err 0.96 and 1.08 times as much, tops
1.5 and 1.3 times."""
_ALIKE_S: Final = 45.0
"""Window over which jumps have one usual size: with half or twice the wires' temperatures err by 3 % more at most, tops
by 46 and 8 %."""
_ROUNDS: Final = 12
"""Number of alternations between smoothing and sizes of the jumps: with half and twice the wires' temperatures err 1.11
and 0.96 times as much."""
_AVERAGED_S: Final = 10.0
"""Averaging time of the noise for the initial sizes of the jumps. With half or twice the wires' temperatures err as
much, to 1 %."""
_LEAST: Final = 1e-18
"""Variance of a jump of zero; it is a divisor."""
# Prior variances before the first reading: sensor and wire 100 °C, slope 10 °C/s, second derivative 1 °C/s².
_UNKNOWN: Final = (1e4, 1e4, 1e2, 1.0)


class _Forward(NamedTuple):
    """The filter's results for the backward pass: states before each reading (n, m), covariances (n, m, m), gains.

    A state consists of the reading without noise (for a slow sensor), and the wire's temperature with its first and
    second derivative. ``surprise`` and ``variance`` (n,) are the innovations and their variances.
    """

    state: Floats
    spread: Floats
    gain: Floats
    surprise: Floats
    variance: Floats


class _Backward(NamedTuple):
    """The wire's temperature at every reading (n,); jumps (2, n) of its first and second derivative.

    ``decided`` is the degree, 0 to 1, to which the log determines each jump.
    """

    value: Floats
    slope: Floats
    sigma: Floats
    jump: Floats
    decided: Floats


class Smoothed(NamedTuple):
    """The wire's temperature, its slope and its standard deviation at the readings (n,).

    ``log_evidence`` is the logarithm of the readings' density for the sensor's time constant, up to a constant.
    """

    value: Floats
    slope: Floats
    sigma: Floats
    log_evidence: float

    def towards(self, other: Smoothed, share: float) -> Smoothed:
        """Return the estimate that lies at a share of the way to another one."""
        return Smoothed(
            self.value + share * (other.value - self.value),
            self.slope + share * (other.slope - self.slope),
            self.sigma + share * (other.sigma - self.sigma),
            self.log_evidence + share * (other.log_evidence - self.log_evidence),
        )


def smoothed(time_s: Floats, temp_c: Floats, sigma_c: float, lag_s: float) -> Smoothed:
    """Return the wire's temperature at readings (n,) with the noise ``sigma_c``.

    ``time_s`` (n,) increases, not necessarily evenly; ``lag_s`` is the sensor's time constant.
    """
    n, size, noise = len(temp_c), 4 if lag_s > 0.0 else 3, sigma_c**2
    forward = _Forward(np.empty((n, size)), np.empty((n, size, size)), np.empty((n, size)), np.empty(n), np.empty(n))
    found = _Backward(np.empty(n), np.empty(n), np.empty(n), np.zeros((2, n)), np.zeros((2, n)))
    # Noise σ of readings every h seconds hides, over t seconds, jumps of variance h σ² / t³ (slope), h σ² / t⁵ (bend).
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
        # Only the product of λ and s² is identifiable: normalise the harmonic mean of λ to one.
        whole = 1.0 / np.mean(1.0 / spread)
        spread, usual = spread / whole, usual * whole
        jumps[:, 1:] = np.maximum(usual * spread, _LEAST)
    # The first reading is left out: its variance is that of the unknown state before it.
    surprise, variance = forward.surprise[1:], np.maximum(forward.variance[1:], noise)
    # Where there is next to no noise, rounding errors would make variances and degrees negative.
    widths = float(np.sum(np.log(_DEGREES + np.maximum(np.sum(found.decided[:, 1:], axis=0), 0.0))))
    evidence = -0.5 * (float(np.sum(surprise**2 / variance + np.log(variance))) + widths)
    return Smoothed(found.value, found.slope, found.sigma, evidence)


@compiled
def _transition(matrix: Floats, span_s: float, lag_s: float) -> None:
    """Set the transition matrix (m, m) of a state over a time: the wire on a parabola, the sensor with its lag."""
    wire = matrix.shape[0] - 3
    half = 0.5 * span_s * span_s
    matrix[:] = 0.0
    matrix[wire, wire] = matrix[wire + 1, wire + 1] = matrix[wire + 2, wire + 2] = 1.0
    matrix[wire, wire + 1], matrix[wire, wire + 2], matrix[wire + 1, wire + 2] = span_s, half, span_s
    if wire:
        # A first-order lag's responses to 1, t and t²/2, and the decay of its initial value.
        gone = -math.expm1(-span_s / lag_s)
        ramp = span_s - lag_s * gone
        matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3] = 1.0 - gone, gone, ramp, half - lag_s * ramp


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
    """Return zeroed working arrays of a pass: a transition matrix, room for products, a square matrix and a vector."""
    return np.zeros((size, size)), np.zeros((size + 1, size)), np.zeros((size, size)), np.zeros(size)


@compiled
def _filter(time_s: Floats, temp_c: Floats, noise: float, lag_s: float, jumps: Floats, forward: _Forward) -> None:
    """Run the Kalman filter over the readings, and store state and covariance before each of them."""
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
    """Add the information of reading k on the state before it to that of the later readings."""
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
def _set(forward: _Forward, k: int, pull: Floats, known: Floats, found: _Backward) -> None:
    """Set the wire's temperature at reading k from the filter's state before it and all readings from k on."""
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
def _smooth(time_s: Floats, lag_s: float, jumps: Floats, forward: _Forward, found: _Backward) -> None:
    """Run the backward pass over the readings, which sets the wire's temperature and jumps from the whole log.

    ``pull`` (m,) and ``known`` (m, m) are the gradient of the log-likelihood of the readings from k on by the state,
    and their Fisher information.
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
            # Backwards, the transition acts as its transpose.
            for i in range(size):
                for j in range(i):
                    matrix[i, j], matrix[j, i] = matrix[j, i], matrix[i, j]
        _carried(matrix, pull, known, room)
        for i in range(2):
            found.jump[i, k] = jumps[i, k] * pull[wire + 1 + i]
            found.decided[i, k] = jumps[i, k] * known[wire + 1 + i, wire + 1 + i]
