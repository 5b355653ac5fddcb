"""Estimation of the clock from an LED in the film that shows the heating switch: the same event on both clocks.

The first frame that shows the LED on, and the first row that shows the switch on, come at most one interval after the
event. So the event happened half an interval before each of them, give or take half an interval. These errors need not
be independent: switchings that are whole frames apart occur at the same phase of the frames every time, and averaging
them gains nothing. So the intervals are intersected over a grid of offset and drift, instead of averaging with an error
that falls with the root of the number of events.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import softmax

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import Gaussian, UnknownGap
from sync.led import Changes, LightEvents, switchings_of
from torsight.core.errors import InputError, NoResultError
from torsight.core.parameter import REACH
from torsight.core.records import TemperatureLog
from torsight.core.units import PPM, Flags, Floats, Ints

_GRID: Final = 161
"""Points of the grid over ±4 sigma of offset and of drift: twenty per sigma."""
_LARGEST_DRIFT: Final = 3.0 * PRIORS.drift_sigma_ppm * PPM


@dataclass(frozen=True, slots=True)
class LedMatch:
    """The clock from the LED: drift, and the offset at the film time ``middle_s``.

    ``matched`` is the number of pairs, ``events`` and ``switchings`` are the numbers of changes on the film and in the
    log, ``rivals`` is the number of other shifts that pair as many events. ``second_shift_s`` is the distance of
    another shift that pairs the remaining events at one end of the film: the log's clock may have jumped in between.
    The Gaussian then covers both.
    """

    gaussian: Gaussian
    middle_s: float
    matched: int
    events: int
    switchings: int
    rivals: int
    second_shift_s: float | None = None


def match_led(
    events: LightEvents,
    frame_s: Floats,
    log: TemperatureLog,
    *,
    near: tuple[float, float] | None = None,
    gaps: Sequence[UnknownGap],
) -> LedMatch:
    """Pair the LED's changes with the switch's and estimate the clock.

    ``frame_s`` are the times of all frames; of several shifts that pair as many events, those with an offset in the
    range ``near`` are preferred. The ``gaps`` at uncertain joints of the log are further unknowns of the Gaussian.
    """
    if log.heat_a is None and log.heat_b is None:
        do = "log the heating switch, or leave led_events out"
        raise InputError("has no column 'heat_a' or 'heat_b' to compare the LED with", where="temperature log", do=do)
    film = _on_film(events, frame_s)
    middle_s = float(film.time_s.mean())
    best: tuple[int, list[float], Changes] | None = None
    for switch in _switches(log):
        switchings = switchings_of(log.time_s, switch)
        if len(switchings) == 0:
            continue
        count, offsets = _best_shifts(film, switchings)
        if best is None or count > best[0]:
            best = (count, offsets, switchings)
    if best is None or best[0] < max(1, (len(film) + 1) // 2):
        raise NoResultError(
            "the LED's changes fit no changes of the heating switch",
            where="led_events",
            value=f"{0 if best is None else best[0]} of {len(film)} events paired",
            limit="at least half of them",
            do="check the times of the LED, or leave led_events out",
        )
    count, offsets, switchings = best
    chosen = offsets[0]
    if near is not None:
        inside = [offset for offset in offsets if near[0] <= offset <= near[1]]
        chosen, offsets = (inside[0], inside) if inside else (chosen, offsets)
    index, partner = _pairs(film, switchings, chosen)
    seen, shown = film.at(index), switchings.at(partner)
    away_s, offset_s = seen.time_s - middle_s, shown.time_s - seen.time_s
    second_s: float | None = None
    if gaps:
        after_gap = np.stack([shown.time_s > gap.after_s for gap in gaps], axis=1)
        variance = PRIORS.led_repeats * ((seen.step_s**2 + shown.step_s**2) / 12.0 + PRIORS.led_jitter_s**2)
        gaussian = _with_gaps(away_s, offset_s, after_gap, variance, [gap.sigma_s for gap in gaps])
    else:
        gaussian = _intersected(away_s=away_s, offset_s=offset_s, film_step_s=seen.step_s, log_step_s=shown.step_s)
        second_s = _second_shift(film, switchings, index, partner)
    if second_s is not None:
        second_s -= chosen
        gaussian.covariance[0, 0] += (second_s / REACH) ** 2
    return LedMatch(gaussian, middle_s, count, len(film), len(switchings), len(offsets) - 1, second_s)


def _second_shift(film: Changes, switchings: Changes, index: Ints, partner: Ints) -> float | None:
    """Return the shift that pairs all events that the best one leaves unpaired, if these are two or more at one end."""
    events = np.setdiff1d(np.arange(len(film)), index)
    others = np.setdiff1d(np.arange(len(switchings)), partner)
    # A single pair fits any shift.
    at_one_end = len(events) > 1 and (events[-1] == len(events) - 1 or events[0] == len(film) - len(events))
    if not at_one_end or len(others) < len(events):
        return None
    count, offsets = _best_shifts(film.at(events), switchings.at(others))
    return offsets[0] if count == len(events) and len(offsets) == 1 else None


def gap_by_led(events: LightEvents, frame_s: Floats, log: TemperatureLog, *, after_s: float) -> float | None:
    """Return the missing time at a joint of the log, s, by pairing the LED's changes on both sides of the joint.

    None where the two sides cannot be paired with different events. Of several answers the shortest is taken.
    """
    film = _on_film(events, frame_s)
    best: tuple[int, float] | None = None
    for switch in _switches(log):
        switchings = switchings_of(log.time_s, switch)
        sides = []
        for rows in (switchings.time_s <= after_s, switchings.time_s > after_s):
            if not rows.any():
                break
            sides.append(_best_shifts(film, switchings.at(rows)))
        if len(sides) < 2 or not all(count for count, _ in sides):
            continue
        apart_s = min((a - b for a in sides[0][1] for b in sides[1][1] if a - b > -1.0), key=abs, default=None)
        total = sides[0][0] + sides[1][0]
        if apart_s is not None and total <= len(film) and (best is None or total > best[0]):
            best = (total, apart_s)
    return None if best is None else best[1]


def _with_gaps(
    away_s: Floats, offset_s: Floats, after_gap: Flags, variance: Floats, gap_sigma_s: Sequence[float]
) -> Gaussian:
    """Return the Gaussian of offset, drift and the missing time at each joint, by least squares.

    Rows after a joint have timestamps that are too early by the missing time.
    """
    # A wide prior: shrinking an ordinary drift to zero would shift the offset at the film's ends.
    sigmas = [10.0, 2.0 * PRIORS.drift_sigma_ppm * PPM, *gap_sigma_s]
    mean = np.zeros(len(sigmas))
    # Centred near the answer, so that the prior of 10 s has no effect.
    mean[0] = float(np.median(offset_s))
    gaussian = Gaussian(mean, np.diag(np.square(sigmas)), 0.0)
    for away, seen, later, spread in zip(away_s, offset_s, after_gap, variance, strict=True):
        gaussian = gaussian.updated(np.array([1.0, away, *(-1.0 * later)]), float(seen), float(spread))
    return gaussian


def _intersected(*, away_s: Floats, offset_s: Floats, film_step_s: Floats, log_step_s: Floats) -> Gaussian:
    """Return mean and covariance of offset and drift, with uniform errors of every pair over its two intervals."""
    drift_sigma = 2.0 * PRIORS.drift_sigma_ppm * PPM
    wide = Gaussian(np.array([float(offset_s.mean()), 0.0]), np.diag([1e2, drift_sigma**2]), 0.0)
    # Least squares give the range of the grid, with the variance of a single pair, so that the grid is wide enough.
    variance = len(away_s) * ((film_step_s**2 + log_step_s**2) / 12.0 + PRIORS.led_jitter_s**2)
    for away, offset, spread in zip(away_s, offset_s, variance, strict=True):
        wide = wide.updated(np.array([1.0, float(away)]), float(offset), float(spread))
    reach = 4.0 * np.sqrt(np.diag(wide.covariance))
    unit = np.linspace(-1.0, 1.0, _GRID)
    offset, drift = np.meshgrid(wide.mean[0] + reach[0] * unit, wide.mean[1] + reach[1] * unit, indexing="ij")
    # Drifts of ordinary clocks are equally likely: shrinking them to zero would shift the offset at the film's ends.
    log_weight = -0.5 * (drift / (1.1 * drift_sigma)) ** 8
    for away, seen, film_step, log_step in zip(away_s, offset_s, film_step_s, log_step_s, strict=True):
        # The sum of two uniform errors has a trapezoidal density: its base is the sum of both widths, its top their
        # difference.
        error = np.abs(seen - offset - drift * away)
        long, short = max(film_step, log_step) + PRIORS.led_jitter_s, min(film_step, log_step) + PRIORS.led_jitter_s
        inside = np.clip(0.5 * (long + short) - error, 0.0, short) / (long * short)
        log_weight = log_weight + np.log(inside + PRIORS.led_astray / (1.0 + error**2))
    weight, grid = softmax(log_weight).ravel(), np.stack([offset.ravel(), drift.ravel()])
    mean = grid @ weight
    away_from_mean = grid - mean[:, None]
    covariance = (weight * away_from_mean) @ away_from_mean.T
    return Gaussian(mean, covariance, 0.0)


def _on_film(events: LightEvents, frame_s: Floats) -> Changes:
    """Return the LED's changes, each between the frame that shows it and the one before."""
    time_s = events.time_s
    if events.since_s is not None:
        step_s = time_s - events.since_s
    else:
        at = np.clip(np.searchsorted(frame_s, time_s - 1e-9), 1, len(frame_s) - 1)
        step_s = frame_s[at] - frame_s[at - 1]
    return Changes(time_s - 0.5 * step_s, step_s, events.goes_on)


def _switches(log: TemperatureLog) -> list[Flags]:
    """Return the switches that the LED may show: any heating, or that of one spring."""
    single = [switch for switch in (log.heat_a, log.heat_b) if switch is not None]
    return [np.logical_or.reduce(single), *(single if len(single) > 1 else [])]


def _best_shifts(film: Changes, log: Changes) -> tuple[int, list[float]]:
    """Return the largest number of pairs and the distinct offsets that reach it."""
    trial = (log.time_s[None, :] - film.time_s[:, None])[film.goes_on[:, None] == log.goes_on[None, :]]
    counts = [len(_pairs(film, log, float(offset))[0]) for offset in trial]
    if not counts:
        return 0, []
    most = max(counts)
    apart_s = 2.0 * float(film.step_s.max() + log.step_s.max()) + _LARGEST_DRIFT * float(np.ptp(film.time_s))
    distinct: list[float] = []
    for offset, count in zip(trial, counts, strict=True):
        if count == most and all(abs(offset - other) > apart_s for other in distinct):
            distinct.append(float(offset))
    return most, distinct


def _pairs(film: Changes, log: Changes, offset_s: float) -> tuple[Ints, Ints]:
    """Pair events with the nearest switching of the same direction, if it is within the clocks' errors.

    Returns the indices of these events and of their partners.
    """
    found: list[tuple[int, int]] = []
    for index, at_s in enumerate(film.time_s):
        away = np.where(log.goes_on == film.goes_on[index], np.abs(log.time_s - at_s - offset_s), np.inf)
        partner = int(np.argmin(away))
        slack_s = film.step_s[index] + log.step_s[partner] + _LARGEST_DRIFT * float(np.ptp(film.time_s))
        if away[partner] <= slack_s + 2.0 * PRIORS.led_jitter_s:
            found.append((index, partner))
    rows = np.array(found, dtype=np.int64).reshape(-1, 2)
    return rows[:, 0], rows[:, 1]
