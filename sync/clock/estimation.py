"""Estimation of offset and drift between film and log, from the best available evidence.

In this order: given values; an event in both recordings (an LED on the heating switch); motion against temperature.
Where nothing moves, the offset remains unknown and is not guessed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import Gaussian, clock_of
from sync.clock.lag_likelihood import SHORT_LAG_S
from sync.clock.led_likelihood import LedMatch, gap_by_led, match_led
from sync.clock.motion_likelihood import MotionLikelihood, begin_s
from sync.clock.offset_search import ALIKE, find_ranges
from sync.clock.restarts import SURE_GAP_S, WeighedRestarts, moved_to, unknown_gaps, weigh_restarts, with_gap
from sync.clock.threshold_likelihood import SCATTERS_C
from sync.led import LightEvents
from sync.log.repairs import LogReading
from sync.log.timestamps import longest_gap_s
from sync.signals.changepoints import MAX_LAG_S
from sync.signals.heating_segments import log_signals
from sync.signals.strokes import find_strokes
from torsight.core.errors import InputError, NoResultError, require_kind
from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import REACH
from torsight.core.records import GIVEN_OFFSET, ClockMap, TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import PPM
from torsight.core.words.plausible import FINEST_S, LATEST_S, SHORTEST_S, require_turns, require_units
from torsight.core.words.shown import Shown

WIDE_S: Final = 1.0
"""Width from which a note explains the interval: at the 0.1 °C/s of slow programmes one second is 0.1 °C, a sensor's
resolution."""
ADVICE: Final = (
    "give the offset (--offset, [sync] offset_s), film an LED on the heating switch (--led, [sync] led), or heat at "
    "two clearly different rates with one heating cut short"
)
"""Advice for determining the offset better."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Found(Shown):
    """The clock, and the log with its restarts shifted by the estimated gaps."""

    clock: ClockMap
    reading: LogReading

    def facts(self) -> dict[str, str]:
        """Return the facts of the clock and of the log's reading."""
        return {**self.clock.facts(), **self.reading.facts()}

    def _columns(self) -> dict[str, Any]:
        """Return the log on the film's clock."""
        table = dict(self.reading.log.to_frame())
        return {**table, "time_s": self.clock.to_film_time(self.reading.log.time_s)}

    def _draw(self, axes: Any) -> None:
        self.clock.plot(axes)


def estimate_clock(
    angles: StickAngles,
    log: TemperatureLog,
    *,
    given_offset_s: float | None = None,
    given_drift_ppm: float | None = None,
    light: LightEvents | None = None,
) -> ClockMap:
    """Return the clock map with 95 % intervals, for a log without restarts of its clock.

    Parameters
    ----------
    angles : StickAngles
        Angle on the film's clock.
    log : TemperatureLog
        Temperatures on the logging clock.
    given_offset_s, given_drift_ppm : float, optional
        Known values, taken as exact.
    light : LightEvents, optional
        Film times at which an LED showed the heating switch.

    Raises
    ------
    InputError
        When there are events of an LED but no heating switch in the log; when the angles are folded into one turn, the
        film's times are minutes, or the log's times or temperatures are in another unit.
    NoResultError
        When the offset is not given and nothing in the files determines it.
    """
    require_kind(log, TemperatureLog, where="estimate_clock, log", do="read_log(path) gives one")
    require_units(log.time_s, {"temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c}, where="log")
    reading = LogReading(log)
    return find_clock(
        angles, reading, given_offset_s=given_offset_s, given_drift_ppm=given_drift_ppm, light=light
    ).clock


@one_thread()
def find_clock(
    angles: StickAngles,
    reading: LogReading,
    *,
    given_offset_s: float | None = None,
    given_drift_ppm: float | None = None,
    light: LightEvents | None = None,
) -> Found:
    """Return the clock map and the log with its restarts in place; see :func:`estimate_clock`."""
    require_kind(angles, StickAngles, where="find_clock, angles", do="read_angles(path) gives one")
    require_kind(reading, LogReading, where="find_clock, reading", do="read_temperature_log(path) gives one")
    sure_rad = np.where(angles.valid & angles.branch_certain, angles.angle_rad, np.nan)
    require_turns(sure_rad, angles.time_s, where="angles")
    if given_drift_ppm is None:
        return _find(angles, reading, given_offset_s=given_offset_s, light=light, drift_known=False)
    # With film times that are corrected for the drift no drift remains, and the offset at film time 0 is the same.
    pace = 1.0 + given_drift_ppm * PPM
    found = _find(
        replace(angles, time_s=pace * angles.time_s),
        reading,
        given_offset_s=given_offset_s,
        light=None if light is None else light.at_pace(pace),
        drift_known=True,
    )
    exact = (given_drift_ppm, given_drift_ppm)
    return replace(found, clock=replace(found.clock, drift_ppm=given_drift_ppm, drift_ci95_ppm=exact))


def _find(
    angles: StickAngles,
    reading: LogReading,
    *,
    given_offset_s: float | None,
    light: LightEvents | None,
    drift_known: bool,
) -> Found:
    """Return clock and log; where the drift is known, the film's times must be corrected for it."""
    prior = None if given_offset_s is None and not drift_known else _given(given_offset_s, drift_known=drift_known)
    if light is not None and given_offset_s is None:
        return _from_led(angles, reading, light, prior)
    if given_offset_s is not None and drift_known and not reading.restarts:
        weighed = WeighedRestarts(None, reading)
    else:
        weighed = weigh_restarts(angles, reading, prior=prior)
    doubts: tuple[str, ...] = ()
    if given_offset_s is not None:
        doubts = _against_motion(angles, reading, given_offset_s, drift_known=drift_known)
    if given_offset_s is not None and drift_known:
        exact = (given_offset_s, given_offset_s), (0.0, 0.0)
        notes = (*doubts, *_restart_notes(weighed))
        return Found(ClockMap(given_offset_s, 0.0, *exact, f"{GIVEN_OFFSET} and drift", notes), weighed.reading)
    likelihood = weighed.likelihood
    if given_offset_s is None:
        _require_seconds(angles, weighed.reading.log, likelihood)
    if likelihood is None:
        if given_offset_s is None:
            raise _unknown(angles, reading.log)
        interval = (-REACH * PRIORS.drift_sigma_ppm, REACH * PRIORS.drift_sigma_ppm)
        notes = (*doubts, "drift is not known and taken as none", *_restart_notes(weighed))
        exact_offset = (given_offset_s, given_offset_s)
        return Found(ClockMap(given_offset_s, 0.0, exact_offset, interval, GIVEN_OFFSET, notes), weighed.reading)
    if likelihood.swapped and given_offset_s is None and likelihood.strokes - likelihood.matched > 1:
        raise _other_way_round(likelihood)
    method = f"{GIVEN_OFFSET}; drift from motion and temperature" if given_offset_s is not None else _method(likelihood)
    begin_film_s = float(angles.time_s[0])
    clock = clock_of(likelihood.mixture, middle_s=likelihood.middle_s, film_begin_s=begin_film_s, method=method)
    clock = replace(clock, notes=(*doubts, *_notes(likelihood, clock), *_restart_notes(weighed)))
    if given_offset_s is not None:
        # It was measured where the film begins, which may be long after film time 0.
        before_s = clock.drift_ppm * PPM * begin_s(angles.time_s)
        return Found(replace(clock, offset_s=given_offset_s - before_s), weighed.reading)
    return Found(_coarse(clock, reading.coarse_s), weighed.reading)


def _against_motion(
    angles: StickAngles, reading: LogReading, given_offset_s: float, *, drift_known: bool
) -> tuple[str, ...]:
    """Return the note on a given offset outside the interval from motion and temperature alone, if it is outside."""
    prior = _given(None, drift_known=True) if drift_known else None
    alone = weigh_restarts(angles, reading, prior=prior).likelihood
    if alone is None:
        return ()
    clock = clock_of(alone.mixture, middle_s=alone.middle_s - begin_s(angles.time_s))
    low, high = clock.offset_ci95_s
    if low <= given_offset_s <= high:
        return ()
    alone_text = f"{clock.offset_s:.3f} s (95 %: {low:.3f} to {high:.3f})"
    causes = "check the given one and its sign (temperature time minus film time); a missing effect may also be late"
    return (f"motion and temperature alone give an offset of {alone_text}: {causes}",)


def _from_led(angles: StickAngles, reading: LogReading, light: LightEvents, prior: Gaussian | None) -> Found:
    """Return the clock from the LED; the motion only selects between shifts that pair equally many of its changes.

    A ``prior`` is given for a known drift.
    """
    weighed = WeighedRestarts(None, reading)
    if unknown_gaps(reading) or any(not math.isfinite(r.gap_sigma_s) for r in reading.restarts):
        weighed = weigh_restarts(angles, reading, prior=prior)
    weighed, match = _paired(angles, weighed, reading, light, prior)
    gaussian = match.gaussian if prior is None else match.gaussian.without_drift()
    if len(gaussian.mean) > 2:  # gaps beside offset and drift
        weighed = WeighedRestarts(weighed.likelihood, moved_to(weighed.reading, [gaussian]))
    notes = list(_restart_notes(weighed))
    if match.rivals:
        others = "1 other shift pairs" if match.rivals == 1 else f"{match.rivals} other shifts pair"
        notes.append(f"{others} as many changes of the LED: check the offset")
    if match.second_shift_s is not None:
        notes.append(
            f"{match.events - match.matched} changes of the LED at one end of the film fit the log when its "
            f"rows there are taken {match.second_shift_s:+.3g} s off the others: its clock may have jumped without "
            "a restart that shows; the interval holds both, look at the log's timestamps"
        )
    method = (
        f"shared event: {match.matched} of {match.events} changes of the LED against the heating switch's "
        f"{match.switchings}"
    )
    begin_film_s = float(angles.time_s[0])
    clock = clock_of([gaussian], middle_s=match.middle_s, film_begin_s=begin_film_s, method=method)
    clock = replace(clock, notes=tuple(notes))
    return Found(_coarse(clock, reading.coarse_s), weighed.reading)


def _paired(
    angles: StickAngles, weighed: WeighedRestarts, reading: LogReading, light: LightEvents, prior: Gaussian | None
) -> tuple[WeighedRestarts, LedMatch]:
    """Return the LED's match, with rows after a restart shifted by the motion or, if more changes pair, by the LED."""
    moved = _joined_by_led(angles, reading, light)
    other = None if moved is None else match_led(light, angles.time_s, moved.log, gaps=unknown_gaps(moved))
    try:
        match = _led_with_motion(angles, weighed, light, prior)
    except NoResultError:
        if moved is None or other is None:
            raise
        return WeighedRestarts(None, moved), other
    if moved is not None and other is not None and other.matched > match.matched:
        return WeighedRestarts(None, moved), other
    return weighed, match


def _led_with_motion(
    angles: StickAngles, weighed: WeighedRestarts, light: LightEvents, prior: Gaussian | None
) -> LedMatch:
    log, gaps = weighed.reading.log, unknown_gaps(weighed.reading)
    match = match_led(light, angles.time_s, log, gaps=gaps)
    if not match.rivals:
        return match
    motion = weighed.likelihood or weigh_restarts(angles, weighed.reading, prior=prior).likelihood
    if motion is None:
        return match
    low, high = clock_of(motion.mixture, middle_s=motion.middle_s).offset_ci95_s
    margin = 0.5 * (high - low) + 5.0
    return match_led(light, angles.time_s, log, near=(low - margin, high + margin), gaps=gaps)


def _joined_by_led(angles: StickAngles, reading: LogReading, light: LightEvents) -> LogReading | None:
    """Return the log with the gap of its only uncertain restart from the LED; None without exactly one, or a gap."""
    unsure = [n for n, restart in enumerate(reading.restarts) if not restart.gap_sigma_s <= SURE_GAP_S]
    if len(unsure) != 1:
        return None
    after_s = float(reading.log.time_s[reading.restarts[unsure[0]].index - 1])
    missing_s = gap_by_led(light, angles.time_s, reading.log, after_s=after_s)
    return None if missing_s is None else with_gap(reading, unsure[0], missing_s, PRIORS.gap_by_led_sigma_s)


def _restart_notes(weighed: WeighedRestarts) -> tuple[str, ...]:
    return tuple(
        f"the log's clock restarted at {float(weighed.reading.log.time_s[restart.index]):.6g} s and its rows from "
        f"there on were moved by {restart.shift_s:.6g} s; how long the logger was away is "
        + ("not known" if not math.isfinite(restart.gap_sigma_s) else f"known to {REACH * restart.gap_sigma_s:.2g} s")
        for restart in weighed.reading.restarts
    )


def _given(offset_s: float | None, *, drift_known: bool) -> Gaussian:
    """Return the prior of a given offset (None: unknown) and of the remaining drift."""
    # A given value has the error of the finest clock, s or ppm, because a zero variance cannot be inverted.
    offset_sigma_s = LATEST_S if offset_s is None else FINEST_S
    drift_sigma_ppm = FINEST_S if drift_known else PRIORS.drift_sigma_ppm
    covariance = np.diag(np.square([offset_sigma_s, drift_sigma_ppm * PPM]))
    return Gaussian(np.array([offset_s or 0.0, 0.0]), covariance, 0.0)


def _coarse(clock: ClockMap, step_s: float) -> ClockMap:
    """Return the clock with an interval for both readings of coarse timestamps: truncated (as assumed) and rounded."""
    if step_s == 0.0:
        return clock
    earlier_s = 0.5 * step_s
    note = (
        f"the log's timestamps go in steps of {step_s:.3g} s and are taken as cut off; were they rounded, the offset "
        f"is {earlier_s:.3g} s smaller: the interval holds both"
    )
    (low, high), (film_low, film_high) = clock.offset_ci95_s, clock.within_s
    return replace(
        clock,
        offset_ci95_s=(low - earlier_s, high),
        film_offset_ci95_s=(film_low - earlier_s, film_high),
        notes=(*clock.notes, note),
    )


def _method(likelihood: MotionLikelihood) -> str:
    text = (
        f"motion against temperature: {likelihood.matched} of {likelihood.strokes} strokes against heating and cooling"
    )
    if likelihood.stops:
        text += f", {likelihood.stops} abrupt stops against corners of the temperature"
    return text


def _notes(likelihood: MotionLikelihood, clock: ClockMap) -> list[str]:
    notes: list[str] = []
    low, high = clock.within_s
    if likelihood.lag.value_s is None:
        notes.append(
            "the log has no corner from which a lag of the sensor could be read; "
            f"lags up to {MAX_LAG_S:g} s are in the interval"
        )
    elif likelihood.lag.value_s > SHORT_LAG_S and not likelihood.stops:
        notes.append(
            f"the log's corners are rounded as by a sensor that is {likelihood.lag.value_s:.2g} s late; taken as its "
            f"lag. If something else rounds them, the offset is larger by up to that much: the interval covers both"
        )
    if high - low > WIDE_S:
        # Few strokes still differ in their rates; equal rates do not determine the offset to seconds.
        alike = "the strokes that can be compared have about the same rates"
        why = alike if high - low > 5.0 * WIDE_S else "few strokes"
        # A delay that alone would make the interval as wide, at four standard deviations to its width.
        if likelihood.late_s > 0.25 * (high - low):
            why = (
                f"the motion is late behind the temperature by some {likelihood.late_s:.2g} s, as with a friction that "
                "grows with the speed, and a late clock looks the same"
            )
        notes.append(f"the interval is {high - low:.3g} s wide ({why}); to narrow it, {ADVICE}")
    if likelihood.matched < likelihood.strokes:
        notes.append(
            f"{likelihood.strokes - likelihood.matched} of {likelihood.strokes} strokes have no heating or cooling "
            f"that explains them: look for a piece of the log that is missing or stands at a wrong time, or "
            "for a motion by the heat of the other spring"
        )
    if likelihood.scatter_c >= SCATTERS_C[-1]:
        notes.append(
            f"strokes of one kind pass the same angle at temperatures that scatter by {likelihood.scatter_c:.2g} °C or "
            "more, on most rigs by hundredths: check that film and log are of one experiment"
        )
    weights = np.array([gaussian.log_weight for gaussian in likelihood.mixture])
    offsets = np.array([gaussian.mean[0] for gaussian in likelihood.mixture])
    likely = offsets[weights > weights.max() - 6.0]
    # At least two ranges whose distance exceeds the width of the first.
    first = likelihood.ranges[0]
    if np.ptp(likely) > first.high_s - first.low_s and len(likelihood.ranges) > 1:
        notes.append("the programme repeats itself: shifts by whole cycles explain the motion about as well")
    if likelihood.swapped:
        notes.append("the motion fits better with the springs the other way round: check which channel is A")
    return notes


def _other_way_round(likelihood: MotionLikelihood) -> NoResultError:
    return NoResultError(
        "the offset between film and log is unknown: the motion fits with the springs the other way round",
        where="angle and temperatures",
        value=f"{likelihood.strokes - likelihood.matched} of {likelihood.strokes} strokes without a heating or cooling",
        limit="heating A turns clockwise, heating B counter-clockwise, as the film is seen",
        do="check which channel is A and whether the film is mirrored, or give the offset (--offset)",
    )


def _unknown(angles: StickAngles, log: TemperatureLog) -> NoResultError:
    known = angles.angle_rad[angles.valid & np.isfinite(angles.angle_rad)]
    film_s, log_s = float(np.ptp(angles.time_s)), float(np.ptp(log.time_s))
    moved = math.degrees(float(np.ptp(known))) if len(known) else 0.0
    rises = [float(np.nanmax(t) - np.nanmin(t)) for t in (log.temp_a_c, log.temp_b_c) if np.isfinite(t).any()]
    return NoResultError(
        "the offset between film and log is unknown: no motion fits the heating and cooling",
        where="angle and temperatures",
        value=f"motion over {moved:.3g}° in {film_s:.4g} s, "
        f"temperatures over {max(rises, default=0.0):.3g} °C in {log_s:.4g} s",
        limit="strokes of 3° and more, heatings of 12 °C and more, at an offset that explains them",
        do=ADVICE,
    )


def _require_seconds(angles: StickAngles, log: TemperatureLog, likelihood: MotionLikelihood | None) -> None:
    """Refuse a film or a log whose motion and heatings fit only with the times of one of them in another unit.

    ``likelihood`` is the result with times in seconds, None if there is none. A film whose times are too small by a
    factor of 60 shows strokes in both directions within one heating, which no offset explains. A film in seconds does
    not pass this test by chance: strokes that are 60 times as long and as far apart do not fit better than before.
    """
    if likelihood is not None and likelihood.strokes - likelihood.matched <= 1:
        return
    before = 0.0 if likelihood is None else likelihood.ranges[0].score
    matched = 0 if likelihood is None else likelihood.matched
    for name, unit, factor in (("film", "minutes", 60.0), ("log", "milliseconds", 1e-3), ("log", "minutes", 60.0)):
        film = replace(angles, time_s=factor * angles.time_s) if name == "film" else angles
        heated = replace(log, time_s=factor * log.time_s) if name == "log" else log
        if np.ptp(heated.time_s) < SHORTEST_S:
            continue
        strokes, signals = find_strokes(film), log_signals(heated, max_gap_s=longest_gap_s(heated.time_s))
        if not strokes or not signals.segments:
            continue
        ranges = find_ranges(strokes, signals)
        if max((part.score for part in ranges), default=0.0) > max(before + ALIKE, 1.0 - ALIKE):
            option = "" if name == "film" else f", or state the unit: --units time={'ms' if factor < 1.0 else 'min'}"
            raise InputError(
                f"the {name}'s times seem to be in {unit}",
                where="angles, column time_s" if name == "film" else "temperature log, time",
                value=f"{matched} of {len(strokes)} strokes with a heating or cooling; "
                f"with times {factor:g} times as large they fit",
                limit="times in seconds",
                do=f"give the {name}'s times in seconds{option}",
            )
