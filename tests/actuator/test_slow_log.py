"""A log that is slower than the film: its readings come back out of the merged table, and the corners between them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.actuator.test_conditioning import logged as logged_behind
from tests.actuator.test_conditioning import wire
from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.fitted import FittedModel
from torsight.actuator.record.conditioning import Readings, condition
from torsight.actuator.record.slow_log import own_readings
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG

ROWS_S = np.arange(0.0, 890.0, 0.25)


def logged(interval_s, noise_c, *, late_s=0.1):
    """Return times and temperatures of a log's readings, the last one after the last row."""
    time_s = np.arange(late_s - interval_s, 890.0 + interval_s, interval_s)
    noise = noise_c * np.random.default_rng(4).standard_normal(len(time_s))
    return time_s, np.round(wire(np.maximum(time_s, 0.0)) + noise, 2)


@pytest.mark.parametrize(("interval_s", "late_s"), [(0.5, 0.25), (0.7, 0.1), (2.0, 0.1), (5.0, 0.1)])
def test_readings_come_back_out_of_a_table(interval_s, late_s):
    time_s, read = logged(interval_s, 0.05, late_s=late_s)
    found_s, found_c = own_readings(ROWS_S, np.round(np.interp(ROWS_S, time_s, read), 5))
    # The table's first and last row lie between readings.
    nearest = time_s[np.abs(time_s[:, None] - found_s[None, 1:-1]).argmin(axis=0)]
    assert np.quantile(np.abs(found_s[1:-1] - nearest), 0.95) < 0.02
    assert found_c == pytest.approx(np.interp(found_s, time_s, read), abs=1e-4)


@pytest.mark.parametrize("late", ["by a tenth", "by half", "at random"])
@pytest.mark.parametrize("interval_s", [2.0, 5.0])
def test_a_log_with_uneven_intervals_is_known_as_well_as_is_stated(late, interval_s):
    """A program that waits between its readings, or a logger that writes a row when something has changed."""
    rng = np.random.default_rng(6)
    count = int(890.0 / interval_s)
    early = {"by a tenth": 0.1, "by half": 0.5}.get(late, 0.0) * rng.uniform(-1.0, 1.0, count)
    random_s = np.cumsum(0.3 + rng.exponential(0.7, count))
    time_s = np.sort(interval_s * (random_s if late == "at random" else np.arange(count) + early))
    read = np.round(wire(np.maximum(time_s, 0.0)) + 0.05 * rng.standard_normal(count), 1)
    rows_s = ROWS_S[slice(*np.searchsorted(ROWS_S, time_s[[0, -1]]))]
    found = condition(rows_s, np.round(np.interp(rows_s, time_s, read), 5))
    noise_c = np.hypot(0.05, 0.1 / np.sqrt(12.0))
    assert noise_c < found.noise_c < 2.0 * noise_c
    off = (found.temp_c - wire(rows_s)) / found.sigma_c
    assert np.sqrt(np.mean(off**2)) < 1.5


@pytest.mark.parametrize("noise_c", [0.0, 0.05])
def test_rows_that_are_readings_stay(noise_c):
    noise = noise_c * np.random.default_rng(1).standard_normal(len(ROWS_S))
    assert own_readings(ROWS_S, np.round(wire(ROWS_S) + noise, 2)) is None


def test_even_corners_of_a_programme_are_no_readings():
    # Corners at multiples of five seconds, as of a programme in round numbers; the wire cools freely after each top.
    parts = []
    for top_c in (66.0, 76.0, 70.0, 63.0):
        ramps = [np.arange(22.0, 60.0, 0.05), np.arange(60.0, 59.0, -0.05), np.arange(59.0, top_c, 0.05)]
        cooling = 22.0 + (top_c - 22.0) * np.exp(-np.arange(1200) / 240.0)
        parts += [*ramps, np.full(80, top_c), cooling, np.full(800, 22.0)]
    temp_c = np.concatenate(parts)
    time_s = 0.25 * np.arange(len(temp_c))
    assert condition(time_s, temp_c).temp_c == pytest.approx(temp_c, abs=1e-9)


@pytest.mark.parametrize(("interval_s", "within_c"), [(2.0, 0.15), (5.0, 0.3)])
def test_the_top_between_two_readings_is_found(interval_s, within_c):
    # The wire's top of 72 °C lies in the middle between two readings, from which the lines cut off half of its descent.
    late_s = (475.0 - 0.5 * interval_s) % interval_s
    time_s, read = logged(interval_s, 0.02, late_s=late_s)
    lines = np.interp(ROWS_S, time_s, read)
    near = np.abs(ROWS_S - 475.0) < interval_s
    cut = np.max(np.abs(lines - wire(ROWS_S))[near])
    left = np.max(np.abs(condition(ROWS_S, lines).temp_c - wire(ROWS_S))[near])
    assert left < within_c < 0.5 * cut


def switched_off(time_s, rate_c_s, *, noise_c=0.0):
    """Return the log of an incomplete heating from 20 s on that is not held at its top, 57.5 °C."""
    up_s, own_s = 34.5 / rate_c_s, time_s - 20.0
    course = np.clip(rate_c_s * own_s, 0.0, 34.5) * np.exp(-np.maximum(own_s - up_s, 0.0) / 40.0)
    noise = noise_c * np.random.default_rng(2).standard_normal((2, len(time_s)))
    return TemperatureLog(time_s, np.round(23.0 + course + noise[0], 2), np.round(23.0 + noise[1], 2))


@pytest.mark.parametrize(
    ("rate_c_s", "interval_s", "noise_c", "within_deg"),
    [(0.2, 5.0, 0.0, 3.0), (0.5, 5.0, 0.0, 6.0), (0.5, 3.0, 0.07, 9.0), (0.5, 1.0, 0.02, 3.0)],
)
def test_a_slow_log_is_predicted_as_a_fast_one(rate_c_s, interval_s, noise_c, within_deg):
    model = ActuatorModel(reference_spec())
    fitted = FittedModel(model, model.nominal())

    def predicted(time_s, noise_c=0.0):
        log = switched_off(time_s, rate_c_s, noise_c=noise_c)
        return fitted.predict(log, start_angle_rad=177.6 * DEG).angle_rad / DEG

    every, fine_s = round(interval_s / 0.25), np.arange(0.0, 595.5, 0.25)
    fast = predicted(fine_s)
    # Wherever the top lies between two readings.
    for first in range(0, every, max(1, every // 12)):
        own = slice(first, None, every)
        assert predicted(fine_s[own], noise_c) == pytest.approx(fast[own], abs=within_deg)
    assert np.ptp(fast) > 100.0


def test_a_top_between_two_readings_is_as_far_off_as_is_said():
    # At any place between the readings, and held or not: what is said of it covers the top.
    for late_s in np.linspace(0.05, 0.95, 7):
        log = switched_off(np.arange(late_s - 1.0, 500.0, 1.0), 0.5, noise_c=0.02)
        found = condition(log.time_s, log.temp_a_c)
        top = int(np.argmax(found.temp_c))
        assert abs(found.temp_c[top] - 57.5) < 3.0 * found.sigma_c[top]
        assert found.sigma_c[top] < 0.15


def test_a_log_without_noise_says_how_far_a_top_between_two_rows_may_be_above_them():
    for late_s in (0.0, 0.05, 0.1, 0.2):
        time_s = np.arange(late_s, 500.0, 0.25)
        log = switched_off(time_s, 0.5)
        course_c = held(57.5, 0.5, 0.0, 40.0, time_s)
        found = condition(time_s, course_c)
        assert np.array_equal(found.temp_c, course_c)
        top = int(np.argmax(course_c))
        assert 57.5 - course_c[top] <= 2.0 * found.sigma_c[top] + 1e-6
        assert found.sigma_c[top] < 0.1
        assert np.count_nonzero(found.sigma_c > 1e-4) <= 1
        assert np.max(log.temp_a_c) <= 57.5


def test_held_tops_of_a_log_without_noise_are_exact():
    course_c = held(57.5, 0.5, 7.0, 40.0, ROWS_S)
    assert np.max(condition(ROWS_S, course_c).sigma_c) < 1e-4


@pytest.mark.parametrize("late_s", [0.1, 0.7, 1.2, 1.7])
def test_a_top_between_two_rows_of_the_table_is_not_lost(late_s):
    """The wire turns after a reading, between two rows: the later row has the temperature of the turn."""
    rows_s, readings_s = np.arange(0.25, 500.0, 0.5), np.arange(late_s - 2.0, 500.0, 2.0)
    read = held(57.5, 0.3, 0.0, 60.0, readings_s)
    found = condition(rows_s, np.interp(rows_s, readings_s, np.round(read, 3)))
    top = int(np.argmax(found.temp_c))
    assert abs(found.temp_c[top] - 57.5) < 0.02
    assert found.sigma_c[top] < 0.05
    # After 115 s of heating.
    assert rows_s[top] == 135.25


def held(top_c, rate_c_s, hold_s, gone_s, time_s):
    """Return a wire's temperature that is heated from 20 s on, held at its top and let cool."""
    up_s = (top_c - 23.0) / rate_c_s
    past_s = np.maximum(time_s - 20.0 - up_s - hold_s, 0.0)
    return 23.0 + np.clip(rate_c_s * (time_s - 20.0), 0.0, top_c - 23.0) * np.exp(-past_s / gone_s)


def test_a_top_that_is_held_over_a_single_reading_is_that_reading():
    """The reading lies below the line of the heating and that of the cooling, so that neither leads to the top."""
    for late_s in np.arange(0.5, 10.0, 1.0):
        time_s = np.arange(late_s, 900.0, 10.0)
        # Held from 246.7 to 258.7 s.
        read = np.round(held(57.0, 0.15, 12.0, 60.0, time_s), 2)
        inside = np.any((time_s > 248.5) & (time_s < 257.5))
        found = condition(ROWS_S, np.interp(ROWS_S, time_s, read))
        top_c = found.temp_c[(ROWS_S > 200.0) & (ROWS_S < 300.0)].max()
        assert top_c == pytest.approx(57.0, abs=0.1 if inside else 0.8)


@pytest.mark.parametrize("interval_s", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("longest_s", [0.0, 15.0])
def test_tops_are_as_uncertain_as_is_said_whether_they_are_held_or_not(interval_s, longest_s):
    rng = np.random.default_rng(7)
    ratios = []
    for _ in range(40):
        top_c, rate_c_s = rng.uniform(58.0, 76.0), rng.uniform(0.15, 0.6)
        time_s = np.arange(rng.uniform(0.0, interval_s), 900.0, interval_s)
        wire_c = held(top_c, rate_c_s, longest_s * rng.random(), rng.uniform(25.0, 60.0), time_s)
        found = condition(
            ROWS_S, np.interp(ROWS_S, time_s, np.round(wire_c + 0.03 * rng.standard_normal(len(time_s)), 2))
        )
        row = int(np.argmax(found.temp_c))
        ratios.append((found.temp_c[row] - top_c) / np.hypot(found.sigma_c[row], 0.01))
    assert 0.3 < np.sqrt(np.mean(np.square(ratios))) < 2.0


@pytest.mark.parametrize("digit_c", [0.01, 0.25])
def test_a_table_may_repeat_every_reading_until_the_next(digit_c):
    time_s = np.arange(0.0, 890.0)
    read = np.round(wire(time_s) / digit_c) * digit_c
    found_s, found_c = own_readings(ROWS_S, read[np.searchsorted(time_s, ROWS_S, side="right") - 1])
    # After the last change no row tells where readings lie.
    assert found_s[:700] == pytest.approx(time_s[:700])
    assert np.array_equal(found_c[:700], read[:700])


@pytest.mark.parametrize("interval_s", [3.0, 5.0])
@pytest.mark.parametrize("lag_s", [2.0, 4.0])
def test_a_wire_behind_a_slow_sensor_is_known_as_well_as_is_stated(interval_s, lag_s):
    """A merged table's rows between two readings are no readings: the sensor's lag acts on its own readings alone."""
    fine_s, _, fine_c = logged_behind(0.05, 0.0, lag_s=lag_s)
    time_s = np.arange(0.1, 890.0, interval_s)
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(time_s))
    lines = np.interp(ROWS_S, time_s, np.round(np.interp(time_s, fine_s, fine_c) + noise, 2))
    found = Readings.of_rows(ROWS_S, lines).behind(ROWS_S, lag_s)
    inside = (ROWS_S > 8.0) & (ROWS_S < 880.0)
    error = (found.temp_c - wire(ROWS_S))[inside]
    assert np.std(error) < 0.05
    assert np.mean((error / found.sigma_c[inside]) ** 2) < 1.5
