"""Changepoints of the log, which a sensor's lag rounds but does not shift, and abrupt stops on the film.

When the power is cut, the rate of a wire's temperature jumps. A sensor with a first-order lag shows the changepoint at
the same instant, rounded over its lag. A transformation that is cut short stops the motion at the instant at which the
wire stops getting warmer. So a changepoint in the log and a stop on the film are the same event, whatever the lag. The
roundness of the log's changepoints is an upper limit of the lag (a larger lag would have rounded them more), and equals
the lag where the power is cut abruptly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from sync.signals.heating_segments import HeatingSegment
from sync.signals.strokes import Stroke
from torsight.core.records import TemperatureLog
from torsight.core.series import block_means, usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import Flags, Floats

MAX_LAG_S: Final = 15.0
"""Longest lag that is considered. Half and twice this value move a clock by 0.6 of its standard deviations at most
(benchmarks/sync/constants.py)."""
SPLITS: Final = (0.0, 0.2, 0.45)
"""Shares of a lag that a second stage may have: a sensor in its sleeve responds in two stages."""
_POINTS: Final = 160
"""Readings around a changepoint are averaged to fewer than twice this number, because the cost of the grid search is
proportional to it. Half and twice this value move a clock by 0.07 of its standard deviations at most
(benchmarks/sync/constants.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Changepoint:
    """An instant at which the rate of a temperature jumps.

    ``time_s`` is on the log's clock and ``lag_s`` the first-order lag that explains the roundness, each with its sigma;
    ``lag_log_likelihood`` (n,) is the likelihood of the lag around its best value. ``log_fit`` is the log-likelihood of
    the best description, up to a constant that depends on the readings.
    """

    time_s: float
    time_sigma_s: float
    lag_s: float
    lag_sigma_s: float
    lags_s: Floats
    lag_log_likelihood: Floats
    log_fit: float


@dataclass(frozen=True, slots=True)
class Shape:
    """Model of a temperature around a changepoint.

    Before the changepoint the temperature is a polynomial of the degree ``powers_before``; after it a straight line is
    added and, optionally, a decay with the time constant ``decay_s``. ``lag_s`` is the sensor's lag where it is known,
    ``split`` the share of its second stage.
    """

    powers_before: int
    decay_s: float | None = None
    lag_s: float | None = None
    split: float = 0.0


def fit_changepoint(
    time_s: Floats,
    temp_c: Floats,
    shape: Shape,
    *,
    near_s: tuple[float, float],
    before_s: float,
    after_s: float,
    noise: float,
) -> Changepoint | None:
    """Return a changepoint by least squares over its time and the lag.

    ``near_s`` bounds the time; readings within ``before_s`` and ``after_s`` of these bounds are used. None where there
    are too few readings.
    """
    window = (time_s >= near_s[0] - before_s) & (time_s <= near_s[1] + after_s) & np.isfinite(temp_c)
    if np.count_nonzero(window) < 12:
        return None
    x, y, spread = _thinned(time_s[window], temp_c[window], noise)
    at = np.linspace(near_s[0], near_s[1], 1 if near_s[1] <= near_s[0] else 13)
    # Short lags lie closer together: a changepoint's shape determines them better.
    lags = np.array([shape.lag_s]) if shape.lag_s is not None else MAX_LAG_S * np.linspace(0.0, 1.0, 10) ** 1.5
    for _ in range(4):
        loss = _losses(x, y, at, lags, shape)
        if not np.isfinite(loss).any():
            return None
        i, j = np.unravel_index(int(np.argmin(loss)), loss.shape)
        # The next, finer grid contains all points within four standard deviations of the best one.
        likely = loss <= loss[i, j] + 16.0 * max(float(loss[i, j]), spread**2) / len(x)
        at, lags = _zoomed(at, likely.any(axis=1), None), _zoomed(lags, likely.any(axis=0), (0.0, MAX_LAG_S))
    return _summary(_losses(x, y, at, lags, shape), at, lags, spread, len(x))


def _zoomed(grid: Floats, likely: Flags, bounds: tuple[float, float] | None) -> Floats:
    if len(grid) == 1:
        return grid
    inside = np.flatnonzero(likely)
    low, high = grid[max(inside[0] - 1, 0)], grid[min(inside[-1] + 1, len(grid) - 1)]
    if bounds is None and inside[0] == 0:
        low -= grid[1] - grid[0]
    if bounds is None and inside[-1] == len(grid) - 1:
        high += grid[-1] - grid[-2]
    return np.linspace(low, high, 11)


def _thinned(time_s: Floats, temp_c: Floats, noise: float) -> tuple[Floats, Floats, float]:
    """Return times and values of a log, averaged to some hundred points if it is fast, and the noise of one point."""
    group = max(1, len(time_s) // _POINTS)
    x, y = block_means(time_s, group), block_means(temp_c, group)
    return x, y, max(noise, 1e-3) / float(np.sqrt(group))


def _losses(x: Floats, y: Floats, at: Floats, lags: Floats, shape: Shape) -> Floats:
    """Return the residual mean square for every time and lag."""
    loss = np.full((len(at), len(lags)), np.inf)
    away = x - at[:, None]
    tried = (np.sum(away < 0, axis=1) >= shape.powers_before + 2) & (np.sum(away > 0, axis=1) >= 5)
    if not tried.any():
        return loss
    away = away[tried, None, :]
    curves = [away**power for power in range(shape.powers_before + 1)]
    curves.append(lagged_ramp(away, lags[:, None], shape.split))
    if shape.decay_s is not None:
        curves.append(lagged_decay(away, shape.decay_s, lags[:, None], shape.split))
    columns = np.empty((len(away), len(lags), len(x), len(curves)))
    for place, curve in enumerate(curves):
        columns[..., place] = curve
    loss[tried] = _squares(y, columns) / max(len(y) - len(curves), 1)
    return loss


def _squares(y: Floats, curves: Floats) -> Floats:
    """Return the residual sums of squares of values (n,) after a least-squares fit of curves (..., n, m)."""
    basis, _ = np.linalg.qr(curves / np.maximum(np.abs(curves).max(axis=-2, keepdims=True), 1e-12))
    left = y - (basis @ (y @ basis)[..., np.newaxis])[..., 0]
    return np.asarray(np.sum(left**2, axis=-1))


def _weights(loss: Floats, unit: float, count: int) -> Floats:
    """Return the normalised likelihood of each residual mean square; ``unit`` is the variance of one value."""
    excess = (loss - float(loss.min())) / unit * count
    weight = np.where(np.isfinite(loss), np.exp(-0.5 * np.minimum(excess, 200.0)), 0.0)
    return np.asarray(weight / weight.sum())


def _summary(loss: Floats, at: Floats, lags: Floats, spread: float, count: int) -> Changepoint:
    """Return the best changepoint, with sigmas from the likelihood around it."""
    i, j = np.unravel_index(int(np.argmin(loss)), loss.shape)
    lowest = float(loss[i, j])
    # A misfit of the model counts as noise, too.
    unit = max(lowest, spread**2)
    weight = _weights(loss, unit, count)
    at_weight, lag_weight = weight.sum(axis=1), weight.sum(axis=0)
    return Changepoint(
        time_s=float(at[i]),
        time_sigma_s=float(np.sqrt(at_weight @ (at - at[i]) ** 2)),
        lag_s=float(lags[j]),
        lag_sigma_s=float(np.sqrt(lag_weight @ (lags - lags[j]) ** 2)),
        lags_s=lags,
        lag_log_likelihood=np.log(np.maximum(lag_weight, 1e-40)),
        log_fit=-0.5 * count * float(np.log(unit)),
    )


def cooling_start(
    log: TemperatureLog,
    segment: HeatingSegment,
    *,
    noise: float,
    switch_s: Floats | None,
    lag_s: float | None,
    split: float,
) -> Changepoint | None:
    """Return the instant at which the power is cut at the beginning of a cooling.

    ``switch_s`` are the times at which the log's own switch of this spring is turned off, if there is one; ``lag_s``
    fixes the lag.
    """
    temp_c = log.temp_c(segment.spring)
    length_s = segment.end_s - segment.begin_s
    inside = (log.time_s >= segment.begin_s) & (log.time_s <= segment.end_s) & np.isfinite(temp_c)
    hot = temp_c[inside] >= segment.high_c - max(0.02 * (segment.high_c - segment.low_c), 4.0 * noise)
    if not hot.any():
        return None
    drop_s = float(log.time_s[inside][np.flatnonzero(hot)[-1]])
    decay_s = _decay(log.time_s[inside], temp_c[inside], segment)
    if decay_s is None:
        return None
    # The last hot reading comes after the cut: by a sensor's lag, or by the noise of a top that is nearly level.
    near = (drop_s - float(np.clip(0.15 * decay_s, 0.5, 6.0)), drop_s)
    if switch_s is not None and len(switch_s):
        closest = float(switch_s[int(np.argmin(np.abs(switch_s - drop_s)))])
        if abs(closest - drop_s) < 0.2 * length_s + 1.0:
            near = (closest, closest)
    return fit_changepoint(
        log.time_s,
        temp_c,
        Shape(powers_before=2, decay_s=decay_s, lag_s=lag_s, split=split),
        near_s=near,
        before_s=float(np.clip(0.1 * decay_s, 0.5, 4.0)),
        after_s=float(np.clip(0.6 * decay_s, 1.0, 30.0)),
        noise=noise,
    )


def _decay(time_s: Floats, temp_c: Floats, segment: HeatingSegment) -> float | None:
    """Return the time constant of a cooling from its later part, where a lag has no effect."""
    from scipy.optimize import minimize_scalar

    rise = segment.high_c - segment.low_c
    # Above is the corner that a lag rounds, below is what noise and the room's own changes bend most.
    later = (temp_c < segment.low_c + 0.65 * rise) & (temp_c > segment.low_c + 0.12 * rise)
    x, y = time_s[later], temp_c[later]
    if len(x) < 10 or x[-1] <= x[0]:
        return None
    x = x - x[0]
    group = max(1, len(x) // _POINTS)
    x, y = x[::group], y[::group]

    def loss(log_decay: float) -> float:
        return float(_squares(y, np.stack([np.ones_like(x), np.exp(-x / np.exp(log_decay))], axis=1)))

    span = float(np.log(x[-1]))
    found = minimize_scalar(loss, bounds=(span - 2.0, span + 1.2), method="bounded", options={"xatol": 1e-4})
    return float(np.exp(found.x))


class Stop(NamedTuple):
    """The film time of a stroke's abrupt end and its sigma; its speed before that in mean speeds of the stroke."""

    time_s: float
    sigma_s: float
    speed: float


def find_stop(angles: StickAngles, stroke: Stroke) -> Stop | None:
    """Return a stroke's abrupt end; None where the motion ends gradually."""
    length_s = stroke.end_s - stroke.begin_s
    window_s = float(np.clip(0.12 * length_s, 0.4, 8.0))
    inside = (np.abs(angles.time_s - stroke.end_s) <= window_s) & angles.valid
    time_s, angle = angles.time_s[inside], angles.angle_rad[inside]
    if len(time_s) < 12:
        return None
    travel = stroke.sign * (angle - stroke.start_rad)
    step_s = usual_step(time_s)
    at = np.arange(stroke.end_s - 0.5 * window_s, stroke.end_s + 0.5 * window_s, min(step_s, window_s / 10.0) / 2.0)
    losses, closing = np.full((2, len(at)), np.inf)
    for index, stop_s in enumerate(at):
        before = np.maximum(stop_s - time_s, 0.0)
        if np.count_nonzero(before > 0) < 5 or np.count_nonzero(before == 0) < 4:
            continue
        design = np.stack([np.ones_like(before), before, before**2], axis=1)
        coefficient, *_ = np.linalg.lstsq(design, travel, rcond=None)
        left = travel - design @ coefficient
        losses[index], closing[index] = float(left @ left) / (len(left) - 3), -coefficient[1]
    best = int(np.argmin(losses))
    usual = stroke.length_rad / max(length_s, 1e-9)
    # A motion that is slow before it ends has no instant of a stop: its last part is hidden in the noise.
    if not np.isfinite(losses[best]) or closing[best] < 0.4 * usual:
        return None
    weight = _weights(losses, float(losses[best]), len(time_s))
    mean = float(weight @ at)
    sigma = float(np.sqrt(weight @ (at - mean) ** 2))
    return Stop(mean, float(np.hypot(sigma, 0.1 * step_s)), float(closing[best] / usual))


def heating_end(
    log: TemperatureLog,
    segment: HeatingSegment,
    cooling: Changepoint | None,
    *,
    noise: float,
    rounding: float,
    lag_s: float | None,
    split: float,
) -> Changepoint | None:
    """Return the instant at which the temperature stops rising at the end of a heating.

    ``lag_s`` is the roundness of the log's sharp changepoints, if known; the lag of this changepoint is then fitted,
    too. Where a hold follows, the end is the changepoint between ramp and hold; else it is the beginning of the
    cooling. ``rounding`` is the error, °C, that all readings of the hold have in common.
    """
    temp_c = log.temp_c(segment.spring)
    off_s = cooling.time_s if cooling is not None else segment.end_s
    inside = (log.time_s >= segment.begin_s) & (log.time_s < off_s) & np.isfinite(temp_c)
    if np.count_nonzero(inside) < 20:
        return None
    time_s, here_c = log.time_s[inside], temp_c[inside]
    length_s = off_s - segment.begin_s
    # The ramp as a straight line through its upper part below the end, and the time at which it reaches the top.
    top_c = float(np.max(here_c[here_c <= np.quantile(here_c, 0.99)]))
    rise_c = top_c - segment.low_c
    ramp = (here_c > top_c - 0.35 * rise_c) & (here_c < top_c - 0.08 * rise_c)
    if np.count_nonzero(ramp) < 6:
        return None
    rate, level = np.polyfit(time_s[ramp] - off_s, here_c[ramp], 1)
    if rate <= 0:
        return None
    reached_s = off_s + (top_c - level) / rate
    hold_s = off_s - reached_s
    # Over a gap of the log a segment seems longer than its ramp.
    length_s = min(length_s, rise_c / rate)
    if hold_s < max(0.02 * length_s, 0.5):
        return cooling
    reach_s, roundness_s = float(np.clip(0.4 * hold_s, 0.5, 6.0)), lag_s or 0.0
    # With a constant current only the sensor rounds the changepoint; a controller on the reading sharpens it.
    changepoint = fit_changepoint(
        time_s,
        here_c,
        Shape(powers_before=1, lag_s=None if roundness_s > 0.0 else 0.0, split=split),
        near_s=(reached_s - reach_s - roundness_s, min(reached_s + reach_s, off_s - 0.3 * hold_s)),
        before_s=float(np.clip(0.25 * (0.35 * rise_c) / rate + 0.5, 0.6, 12.0)),
        after_s=hold_s + reach_s,
        noise=noise,
    )
    if changepoint is None:
        return None
    # The ramp reaches the hold's level earlier or later by the error of that level.
    sigma_s = float(np.hypot(changepoint.time_sigma_s, rounding / rate))
    known = None if sigma_s > 2.0 else replace(changepoint, time_sigma_s=sigma_s)
    after = time_s > changepoint.time_s
    rises_on = np.count_nonzero(after) > 1 and np.polyfit(time_s[after], here_c[after], 1)[0] > 0.5 * rate
    # Where a further rise follows, and no hold, the temperature rises until the cooling.
    return cooling if rises_on else known


def lagged_ramp(x_s: Floats, lag_s: Floats | float, split: float) -> Floats:
    """Return the response of a sensor with a lag in one stage, or in two, to ``max(x, 0)``; lags broadcast with x."""
    x = np.maximum(x_s, 0.0)
    late = sum(weight * stage_s * np.exp(-x / stage_s) for weight, stage_s in _stages(lag_s, split))
    return np.asarray(x - lag_s + late)


def lagged_decay(x_s: Floats, decay_s: float, lag_s: Floats | float, split: float) -> Floats:
    """Return the response of a sensor with a lag in one stage, or in two, to ``1 - exp(-x / decay)`` from x = 0 on."""
    x = np.maximum(x_s, 0.0)
    left, plain = np.zeros(()), decay_s * np.exp(-x / decay_s)
    for weight, stage_s in _stages(lag_s, split):
        # For equal time constants the fraction has a limit, approximated a thousandth beside it.
        own_s = np.where(np.abs(stage_s - decay_s) <= 1e-3 * decay_s, 1.002 * stage_s, stage_s)
        left = left + weight / (decay_s - own_s) * (plain - own_s * np.exp(-x / own_s))
    return np.asarray(1.0 - left)


def _stages(lag_s: Floats | float, split: float) -> list[tuple[float, Floats]]:
    """Return two first-order lags in series as a weighted sum of both: weights, which add up to 1, and times."""
    # Lags are divisors: a lag of 0 is replaced by the smallest number that changes no sum.
    whole_s = np.maximum(lag_s, np.finfo(np.float64).eps)
    if split <= 0.0:
        return [(1.0, whole_s)]
    first, second = 1.0 - split, split
    return [(first / (first - second), first * whole_s), (-second / (first - second), second * whole_s)]
