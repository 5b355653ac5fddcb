"""Corners of a noisy temperature, found to a fraction of a sample.

A local window of one side that reaches past a corner by a sample or two carries the slope on: an overshoot of a few
hundredths of a degree, which a one-way transformation would keep. So around every change of slope both sides are fitted
at once: a parabola, and from the corner's time on a further parabola, that starts there with a new slope.

Behind a slow sensor the functions are the responses of a first-order lag to the same ones, and what is left of an
earlier corner, which decays with the sensor's constant; the wire's temperature is made of the functions themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.compiled import compiled
from torsight.core.series import BY_CHANCE
from torsight.core.units import Floats, Ints

_BENT: Final = 2.0
"""A side whose third order shows by so many of its sigmas is no parabola: the window is too long. Temperatures err 1.3
times as much with half of it (benchmarks/actuator/log_constants.py)."""
_HALF_WINDOWS_S: Final = (40.0, 25.0, 15.0, 9.0, 5.5)


@dataclass(frozen=True, slots=True, eq=False)
class _Around:
    """The log around a place: times from it (s), temperatures above it (°C), rows."""

    t: Floats
    y: Floats
    rows: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """What was measured, and how.

    Attributes
    ----------
    time_s, temp_c : (n,) float64
        As measured.
    lag_s : float
        Time constant of the sensor.
    sigma_c : float
        Noise.
    smallest : int
        Length of the smallest window.
    """

    time_s: Floats
    temp_c: Floats
    lag_s: float
    sigma_c: float
    smallest: int


def mend_corners(log: Log, sides: Floats, mended: tuple[Floats, Floats, Floats]) -> None:
    """Replace value, slope and sigma around every corner by a fit of both its sides, in place.

    Parameters
    ----------
    log : Log
        The record.
    sides : (2, 3, n) float64
        For the window before and after each sample: slope, its variance, the window's length.
    mended : three (n,) float64
        Value, slope and sigma of the wire's temperature: °C, °C/s, °C.
    """
    for found in _certain(log, _candidates(sides, log.smallest)):
        _write(found, log, mended)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """A corner: the log around it, its place in it, and by how many sigmas the slope changes (0: no fit)."""

    part: _Around | None
    at: float
    sigmas: float


def _certain(log: Log, places: list[int]) -> list[_Found]:
    """Return the corners whose bend is certain: more than chance makes of noise.

    With half as many sigmas, here and in :func:`_candidates`, slopes err twice as much; with twice as many nothing gets
    worse, by benchmarks/actuator/log_constants.py, whose corners are all sharp.

    A corner that is none cuts its neighbours' windows short: in every round those go that are weaker than both their
    neighbours, and the neighbours are fitted again with more room.
    """
    found = {k: _fitted(log, places, k) for k in places}
    while True:
        sigmas = [found[k].sigmas for k in places]
        weak = [
            i
            for i, value in enumerate(sigmas)
            if value < BY_CHANCE and value <= min(sigmas[max(i - 1, 0)], sigmas[min(i + 1, len(sigmas) - 1)])
        ]
        if not weak:
            return [found[k] for k in places]
        touched = {places[j] for i in weak for j in (i - 1, i + 1) if 0 <= j < len(places)}
        gone = {places[i] for i in weak}
        places = [k for k in places if k not in gone]
        for k in touched - gone:
            found[k] = _fitted(log, places, k)


def _candidates(sides: Floats, smallest: int) -> list[int]:
    """Return the samples at which the slopes before and after differ by more than chance."""
    jump = np.abs(sides[1, 0] - sides[0, 0]) / np.sqrt(sides[0, 1] + sides[1, 1])
    reach = 3 * smallest
    found: list[int] = []
    for k in np.flatnonzero(jump > BY_CHANCE):
        near = jump[max(0, k - reach) : k + reach + 1]
        if jump[k] >= near.max() and (not found or k - found[-1] > reach):
            found.append(int(k))
    return found


def _around(log: Log, places: list[int], k: int, half_window_s: float) -> _Around | None:
    """Return the log around a corner, up to its neighbours; None where a side is too short for a fit."""
    number = places.index(k)
    time_s, smallest = log.time_s, log.smallest
    first = places[number - 1] + smallest if number else 0
    last = places[number + 1] - smallest if number + 1 < len(places) else len(time_s) - 1
    low = int(np.searchsorted(time_s, time_s[k] - half_window_s))
    high = int(np.searchsorted(time_s, time_s[k] + half_window_s))
    rows = np.arange(max(first, low), min(last, high) + 1)
    if k - rows[0] < 2 * smallest or rows[-1] - k < 2 * smallest:
        return None
    return _Around(time_s[rows] - time_s[k], log.temp_c[rows] - log.temp_c[k], rows)


def _fitted(log: Log, places: list[int], k: int) -> _Found:
    """Return the fit to the largest neighbourhood that it describes to within the noise."""
    before = 0
    for half_window_s in _HALF_WINDOWS_S:
        part = _around(log, places, k, half_window_s)
        if part is None or len(part.t) == before:
            continue
        before = len(part.t)
        at, error = _best_place(part.t, part.y, log.lag_s)
        if error <= log.sigma_c**2 * (before + 3.0 * np.sqrt(2.0 * before)):
            _, coefficients, spread = _solve(part.t, part.y, at, log.lag_s)
            if _bent(part.t, part.y, at, log.lag_s, coefficients, 2 * log.smallest) > _BENT * log.sigma_c:
                continue
            return _Found(part, at, float(abs(coefficients[3]) / (log.sigma_c * np.sqrt(spread[3, 3]))))
    return _Found(None, 0.0, 0.0)


@compiled
def _functions(t: float, t_first: float, at: float, lag: float, f: Floats) -> None:
    """Set the values (row 0) and slopes (row 1) of the functions of a bend at ``at``."""
    line = t - at
    u = max(line, 0.0)
    f[0, 0], f[0, 1], f[0, 2] = 1.0, line, line * line
    f[1, 0], f[1, 1], f[1, 2] = 0.0, 1.0, 2.0 * line
    if lag == 0.0:
        f[0, 3], f[0, 4], f[0, 5] = u, u * u, 0.0
        f[1, 3], f[1, 4], f[1, 5] = (1.0 if line > 0.0 else 0.0), 2.0 * u, 0.0
    else:
        # Responses of a first-order lag to u and u², and what is left of what was before.
        gone = 1.0 - np.exp(-u / lag)
        response = u - lag * gone
        past = np.exp(-(t - t_first) / lag)
        f[0, 3], f[0, 4], f[0, 5] = response, u * u - 2.0 * lag * response, past
        f[1, 3], f[1, 4], f[1, 5] = gone, 2.0 * response, -past / lag


@compiled
def _solve(t: Floats, y: Floats, at: float, lag: float) -> tuple[float, Floats, Floats]:
    """Return sum of squares, coefficients and their covariance in units of the noise's variance."""
    count = 5 if lag == 0.0 else 6
    f = np.empty((2, 6))
    normal, side, square = np.zeros((count, count)), np.zeros(count), 0.0
    for i in range(t.size):
        _functions(t[i], t[0], at, lag, f)
        square += y[i] * y[i]
        for a in range(count):
            side[a] += f[0, a] * y[i]
            for b in range(a + 1):
                normal[a, b] += f[0, a] * f[0, b]
    scale = np.empty(count)
    for a in range(count):
        scale[a] = np.sqrt(normal[a, a]) + 1e-300
    for a in range(count):
        for b in range(a + 1):
            normal[a, b] /= scale[a] * scale[b]
            normal[b, a] = normal[a, b]
    for a in range(count):
        normal[a, a] += 1e-10
        side[a] /= scale[a]
    inverse = np.linalg.inv(normal)
    coefficients = inverse @ side
    error = square
    for a in range(count):
        error -= coefficients[a] * side[a]
        for b in range(count):
            inverse[a, b] /= scale[a] * scale[b]
    out = np.zeros(6)
    out[:count] = coefficients / scale
    return max(error, 0.0), out, inverse.astype(np.float64)


@compiled
def _bent(t: Floats, y: Floats, at: float, lag: float, coefficients: Floats, least: int) -> float:
    """Return by how many sigmas (for noise of one) what the fit leaves on a side is of third order, of both the larger.

    A side of fewer than ``least`` samples says nothing.
    """
    f = np.empty((2, 6))
    worst = 0.0
    corner = 0
    while corner < t.size and t[corner] < at:
        corner += 1
    for first, last in ((0, corner), (corner, t.size)):
        if last - first < least:
            continue
        total = square = 0.0
        for i in range(first, last):
            _functions(t[i], t[0], at, lag, f)
            left = y[i]
            for a in range(6):
                left -= f[0, a] * coefficients[a]
            u = 2.0 * (t[i] - t[first]) / (t[last - 1] - t[first]) - 1.0
            third = 0.5 * u * (5.0 * u * u - 3.0)
            total += third * left
            square += third * third
        worst = max(worst, abs(total) / np.sqrt(square))
    return worst


@compiled
def _best_place(t: Floats, y: Floats, lag: float) -> tuple[float, float]:
    """Return the place of the corner that fits best, and its sum of squares: a rounded one lies before it shows."""
    interval = (t[-1] - t[0]) / (t.size - 1)
    step = max(0.5 * interval, 0.25 * lag)
    first, last = t[0] + 3.0 * interval, t[-1] - 3.0 * interval
    at, error = 0.0, np.inf
    place = -4.0 * interval - 2.0 * lag
    while place <= 4.0 * interval + 0.5 * step:
        trial = min(max(place, first), last)
        found = _solve(t, y, trial, lag)[0]
        if found < error:
            at, error = trial, found
        place += step
    for _ in range(4):
        step *= 0.5
        centre = at
        for sign in (-1.0, 1.0):
            trial = min(max(centre + sign * step, first), last)
            found = _solve(t, y, trial, lag)[0]
            if found < error:
                at, error = trial, found
    return at, error


def _write(found: _Found, log: Log, out: tuple[Floats, Floats, Floats]) -> None:
    part, at, lag = found.part, found.at, log.lag_s
    if part is None:
        return
    _, coefficients, spread = _solve(part.t, part.y, at, lag)
    base_c = float(log.temp_c[part.rows[int(np.argmin(np.abs(part.t)))]])
    # The fit's ends lean on one side only: the local windows there are better.
    t = part.t
    shortest = 6.0 * (t[-1] - t[0]) / (len(t) - 1)
    low, high = at - max(shortest, 0.5 * (at - t[0])), at + max(shortest, 0.6 * (t[-1] - at))
    f = np.empty((2, 6))
    count = len(spread)
    for i in np.flatnonzero((t >= low) & (t <= high)):
        # The wire is what is read and the lag times its slope; the functions without their lag.
        _functions(t[i], t[0], at, lag, f)
        wire = f[0] + lag * f[1]
        row = part.rows[i]
        out[0][row] = base_c + wire @ coefficients
        past = 1.0 if t[i] > at else 0.0
        slope = np.array([0.0, 1.0, 2.0 * (t[i] - at + lag), past, 2.0 * past * (t[i] - at), 0.0])
        out[1][row] = slope @ coefficients
        out[2][row] = log.sigma_c * np.sqrt(max(0.0, wire[:count] @ spread @ wire[:count]))
