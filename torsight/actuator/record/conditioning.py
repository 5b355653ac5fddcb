"""Conditioning of a noisy temperature that drives a one-way transformation; the temperature's corners stay sharp.

A transformation only advances, so that the upward peaks of noise push it on and bias the angle. A low-pass filter would
remove the noise but round the corners of the temperature, where an incomplete transformation ends. Here the noise is
measured first, by third differences at several strides (which also detect noise that was interpolated onto a faster
clock); a log without noise passes unchanged, to the last bit, and says how far a top may be above its row. Otherwise
:mod:`torsight.actuator.record.smoother` estimates every sample, also that of the wire behind a slow sensor, and
:mod:`torsight.actuator.record.holds` replaces a level top by its mean.

Where a log is slower than its table (:mod:`torsight.actuator.record.slow_log`), its own readings are recovered first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.actuator.record.holds import beside_corners, level_holds
from torsight.actuator.record.log_noise import NEGLIGIBLE_C, PEAKLESS_C, SHORTEST, last_digit, measure_noise
from torsight.actuator.record.ripple import ripple_peaks
from torsight.actuator.record.slow_log import SLOW_S, Read, between, own_readings, tops_of, turns_missed, turns_reached
from torsight.actuator.record.smoother import Smoothed, smoothed
from torsight.actuator.record.turns import REVERSAL_C, at_places, turns_of
from torsight.core.series import rounding_variance, usual_step
from torsight.core.units import Floats

_BLOCK_S: Final = 0.1
"""Readings within this time are averaged: with twice this value slopes err by 14 % more and tops by 18 %
(benchmarks/actuator/log_constants.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Conditioned:
    """A conditioned temperature (n,): without noise, or the unchanged input where its noise is negligible.

    ``rate_c_s`` is its slope and ``sigma_c`` the standard deviation of the remaining noise; ``noise_c`` is the noise of
    a reading, ``reading_s`` the time between readings with independent noise, and ``peaks_c`` the height of the
    ripple's peaks above the temperature. ``log_evidence`` is that of the sensor's time constant, up to a constant; zero
    for every time constant where the readings do not show it.
    """

    temp_c: Floats
    rate_c_s: Floats
    sigma_c: Floats
    noise_c: float
    reading_s: float
    peaks_c: Floats
    log_evidence: float = 0.0


def condition(time_s: Floats, temp_c: Floats) -> Conditioned:
    """Remove the noise of a temperature log (n,) and keep its corners; times increase, not necessarily evenly."""
    return conditioned(Readings.of_rows(time_s, temp_c), time_s, temp_c)


def conditioned(readings: Readings, time_s: Floats, temp_c: Floats) -> Conditioned:
    """Return the temperature without noise at a log's rows (n,), from the log's own readings."""
    if readings.far_apart:
        return _between_readings(readings, time_s)
    noise, found = readings.noise_c, readings.behind(time_s, 0.0)
    if readings.are_clean:
        return replace(found, temp_c=temp_c, sigma_c=turns_missed(time_s, temp_c, noise))
    # Below, noise that is correlated over several rows counts as larger independent noise.
    value, rate, sigma = found.temp_c, found.rate_c_s, found.sigma_c
    found = replace(found, peaks_c=ripple_peaks(time_s, temp_c, value, readings.digit_noise_c, readings.alike))
    level_holds(time_s, temp_c, noise * math.sqrt(readings.alike), value=value, rate=rate, left_over=sigma)
    return replace(found, sigma_c=np.hypot(sigma, beside_corners(value)))


def _between_readings(readings: Readings, wanted_s: Floats) -> Conditioned:
    """Return the temperature at the wanted times (m,) from readings (n,) that are far apart."""
    time_s, temp_c = readings.time_s, readings.temp_c
    known_c, slope_c_s, left_over, evidence = readings.smooth(0.0)
    if readings.are_clean:
        known_c, left_over = temp_c, np.full(len(temp_c), readings.noise_c)
    else:
        noise_c = readings.noise_c * math.sqrt(readings.alike)
        level_holds(time_s, temp_c, noise_c, value=known_c, rate=slope_c_s, left_over=left_over)
    peaks_c = ripple_peaks(time_s, temp_c, known_c, readings.digit_noise_c, readings.alike)
    known = readings.with_corners(known_c, left_over, wanted_s)
    return replace(known, peaks_c=np.interp(wanted_s, time_s, peaks_c), log_evidence=evidence)


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """A log's readings and their noise, from which the wire's temperature follows for any time constant of the sensor.

    Times and temperatures (m,) are means over short blocks of the log; ``sigma_c`` is the standard deviation of the
    independent noise that is equivalent to their correlated noise. The noise of one reading is ``noise_c``; it is
    correlated over ``alike`` rows of the log, and independent in rows ``interval_s`` apart. Including the rounding to
    the last digit it is ``digit_noise_c`` at most. Readings that are ``far_apart`` miss the corners of the temperature.
    Those that ``are_clean`` need no smoothing: the peaks of their noise do not matter. The peaks of other noise advance
    a transformation the further, the longer it is held; rounding only hides how far.
    """

    time_s: Floats
    temp_c: Floats
    noise_c: float
    alike: float
    interval_s: float
    sigma_c: float
    digit_noise_c: float = 0.0
    far_apart: bool = False
    are_clean: bool = True

    @classmethod
    def of_rows(cls, time_s: Floats, temp_c: Floats) -> Readings:
        """Return the readings of a log's rows (n,), which may be interpolated between readings that are far apart."""
        own = own_readings(time_s, temp_c)
        return cls.of(time_s, temp_c) if own is None else cls.of(*own, far_apart=True)

    @classmethod
    def of(cls, time_s: Floats, temp_c: Floats, *, far_apart: bool = False) -> Readings:
        """Return the readings of a log (n,)."""
        interval_s = usual_step(time_s)
        if len(temp_c) < SHORTEST:
            return cls(time_s, temp_c, 0.0, 1.0, interval_s, 0.0, far_apart=far_apart)
        noise, alike = measure_noise(time_s, temp_c)
        # Rounding to a last digit is noise of the slope, even where the noise of the value is negligible.
        digit_c = last_digit(temp_c)
        digit = math.sqrt(rounding_variance(digit_c))
        least = max(noise, digit, 1e-6)
        # Read-only and strided arrays have types of their own: with one type a single compilation serves all records.
        times, means = (np.array(values, np.float64) for values in _blocks(time_s, temp_c, _BLOCK_S))
        of_block, correlation = measure_noise(times, means)
        sigma = max(of_block, 0.2 * least) * math.sqrt(correlation)
        clean = noise <= PEAKLESS_C
        digit_noise = math.hypot(noise, digit)
        return cls(times, means, noise, alike, alike * interval_s, sigma, digit_noise, far_apart, clean)

    def behind(self, wanted_s: Floats, lag_s: float) -> Conditioned:
        """Return the wire's temperature (n,) at the wanted times, for a sensor with the time constant ``lag_s``."""
        return self.at(wanted_s, self.wire(lag_s), lag_s)

    def wire(self, lag_s: float) -> Smoothed:
        """Return the wire's temperature at the readings (n,), level where the readings have become level."""
        found = self.smooth(lag_s)
        if lag_s > 0.0 and self.noise_c > NEGLIGIBLE_C:
            level_holds(self.time_s, self.temp_c, self.sigma_c, value=found.value, rate=found.slope,
                        left_over=found.sigma)  # fmt: skip
        return found

    def at(self, wanted_s: Floats, wire: Smoothed, lag_s: float, *, least_turn_c: float = REVERSAL_C) -> Conditioned:
        """Return the temperature (n,) at the wanted times of a wire that is known at the readings (m,).

        A reversal from ``least_turn_c`` on is placed at the first wanted time after it, at its full height.
        """
        if self.far_apart:
            known = self.with_corners(wire.value, wire.sigma, wanted_s)
        else:
            slope, sigma = (np.interp(wanted_s, self.time_s, each) for each in (wire.slope, wire.sigma))
            places = np.interp(wanted_s, self.time_s, np.arange(float(len(self.time_s))))
            value = at_places(wire.value, turns_of(wire.value, least_turn_c), places)
            # Behind a slow sensor the readings are not the wire's temperature.
            of_wire = lag_s == 0.0 and not self.are_clean
            read = Read(self.temp_c, np.full(len(self.temp_c), self.sigma_c)) if of_wire else None
            value, sigma = turns_reached(wanted_s, value, sigma, tops_of(self.time_s, wire.value, wire.sigma, read))
            known = Conditioned(value, slope, sigma, self.noise_c, self.interval_s, np.zeros(len(wanted_s)))
        return replace(known, log_evidence=wire.log_evidence)

    def smooth(self, lag_s: float) -> Smoothed:
        """Return the wire's temperature at the readings (n,)."""
        n = len(self.time_s)
        if n < SHORTEST:
            slope = np.asarray(np.gradient(self.temp_c, self.time_s)) if n > 1 else np.zeros(n)
            return Smoothed(self.temp_c + lag_s * slope, slope, np.zeros(n), 0.0)
        found = smoothed(self.time_s, self.temp_c, self.sigma_c, lag_s)
        # The evidence is about the sensor where noise hides the interpolation, and readings miss no corner.
        shown = self.noise_c > NEGLIGIBLE_C and usual_step(self.time_s) <= SLOW_S
        return found if shown else found._replace(log_evidence=0.0)

    def with_corners(self, known_c: Floats, left_over: Floats, wanted_s: Floats) -> Conditioned:
        """Return the temperature at the wanted times (m,) where it is known (n,) at readings that are far apart.

        It consists of lines, with corners between readings where the wire has them. The smoother's own corners lie at
        readings; corners between two readings that are seconds apart are found after smoothing.
        """
        value, doubt = between(self.time_s, known_c, left_over, wanted_s)
        sigma = np.hypot(np.interp(wanted_s, self.time_s, left_over), doubt)
        rate = np.asarray(np.gradient(value, wanted_s))
        return Conditioned(value, rate, sigma, self.noise_c, self.interval_s, np.zeros(len(wanted_s)))


def _blocks(time_s: Floats, temp_c: Floats, block_s: float) -> tuple[Floats, Floats]:
    """Return the log averaged over blocks of about ``block_s``; unchanged if it is not that fast."""
    every = int(block_s / usual_step(time_s))
    if every < 2:
        return time_s, temp_c
    starts = np.arange(0, len(time_s), every)
    count = np.diff(np.append(starts, len(time_s)))
    return np.add.reduceat(time_s, starts) / count, np.add.reduceat(temp_c, starts) / count
