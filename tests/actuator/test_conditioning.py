"""Conditioning: a clean log unchanged, corners kept, noise removed, the wire behind a slow sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from torsight.actuator.record import conditioning, smoother
from torsight.actuator.record.conditioning import Readings, condition
from torsight.actuator.record.log_noise import last_digit, measure_noise
from torsight.core.series import rms
from torsight.core.units import Floats

RATE_C_S = 0.12


def wire(time_s, *, decay_s=45.0):
    """Rest, ramp, hold, natural cooling."""
    ramp = 24.0 + RATE_C_S * np.clip(time_s - 50.0, 0.0, 400.0)
    top = 24.0 + RATE_C_S * 400.0
    return np.where(time_s < 475.0, ramp, 24.0 + (top - 24.0) * np.exp(-np.maximum(time_s - 475.0, 0.0) / decay_s))


def logged(interval_s, noise_c, *, lag_s=0.0, seed=1):
    """Time, wire temperature and reading, the lag integrated with fine steps."""
    fine = np.arange(0.0, 900.0, 0.005)
    true = wire(fine)
    if lag_s:
        read = np.empty_like(true)
        read[0], keep = true[0], np.exp(-0.005 / lag_s)
        for k in range(1, len(true)):
            read[k] = true[k] + (read[k - 1] - true[k]) * keep
    else:
        read = true
    every = round(interval_s / 0.005)
    noise = noise_c * np.random.default_rng(seed).standard_normal(len(fine[::every]))
    return fine[::every], true[::every], np.round(read[::every] + noise, 2)


@pytest.mark.parametrize("interval_s", [0.25, 1.0])
def test_a_clean_log_passes_unchanged(interval_s):
    time_s, _, read = logged(interval_s, 0.0)
    assert condition(time_s, read).temp_c is read


def test_rounding_is_removed_where_many_readings_share_a_digit():
    time_s, true_c, read_c = logged(0.015, 0.0)
    assert rms(condition(time_s, read_c).temp_c - true_c) < 0.5 * rms(read_c - true_c)


@pytest.mark.parametrize("digit_c", [1e-6, 0.01])
@pytest.mark.parametrize("between", [False, True], ids=["rows are readings", "rows between readings"])
def test_the_peaks_of_little_noise_do_not_raise_a_held_top(digit_c, between):
    # The highest of several hundred readings of 0.004 °C of noise is 0.012 °C above their mean: 0.3° of angle.
    time_s = np.arange(0.0, 400.0, 0.2)
    course_c = np.minimum(70.0, 24.0 + 0.4 * time_s) - 0.5 * np.maximum(0.0, time_s - 300.0)
    rows_s = np.arange(0.013, 399.8, 0.1) if between else time_s
    for seed in range(5):
        noise_c = 0.004 * np.random.default_rng(seed).standard_normal(len(time_s))
        read_c = np.interp(rows_s, time_s, np.round((course_c + noise_c) / digit_c) * digit_c)
        assert np.max(read_c) > 70.008
        assert np.max(condition(rows_s, read_c).temp_c) == pytest.approx(70.0, abs=max(0.003, 0.6 * digit_c))


@pytest.mark.parametrize("noise_c", [0.02, 0.1, 0.25])
@pytest.mark.parametrize("interval_s", [0.1, 0.25])
def test_noise_is_measured(interval_s, noise_c):
    time_s, _, read = logged(interval_s, noise_c)
    # The median of a few thousand absolute differences is good to a few per cent; cooling adds a little.
    assert measure_noise(time_s, read)[0] == pytest.approx(noise_c, rel=0.1)


def rounded(digit_c: float, noise_c: float, seed: int) -> tuple[Floats, Floats]:
    """Return times and readings of heating and cooling between long rests, to a last digit."""
    time_s = np.arange(0.0, 2000.0, 0.25)
    wire = 23.0 + 60.0 * np.maximum(0.0, np.sin(time_s / 150.0) - 0.2)
    noise = noise_c * np.random.default_rng(seed).standard_normal(len(wire))
    return time_s, digit_c * np.round((wire + noise) / digit_c)


@pytest.mark.parametrize("digit_c", [0.01, 0.1])
@pytest.mark.parametrize("in_digits", [0.35, 0.5, 0.58, 0.8, 1.2])
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_rounded_log_is_measured_with_what_rounding_adds(
    digit_c: float, in_digits: float, seed: int
) -> None:
    noise, correlation = measure_noise(*rounded(digit_c, in_digits * digit_c, seed))
    assert noise == pytest.approx(digit_c * math.hypot(in_digits, 1.0 / math.sqrt(12.0)), rel=0.1)
    assert correlation <= 2.0


@pytest.mark.parametrize("digit_c", [0.1, 0.25, 0.5])
def test_stairs_of_a_log_without_noise_of_its_own_are_noise(digit_c: float) -> None:
    # Most of the log stands still. Stairs up a ramp are no white noise: it is known to a factor of two.
    noise, _ = measure_noise(*rounded(digit_c, 0.02 * digit_c, 1))
    assert 0.5 < noise / (digit_c / math.sqrt(12.0)) < 2.0


def test_two_or_three_equal_readings_of_a_slow_log_are_no_rest() -> None:
    # Readings 2 s apart, rounded to 1 °C: the ramp of 0.2 °C/s has the same reading twice or three times.
    time_s = np.arange(0.0, 2000.0, 2.0)
    ramp = 23.0 + np.clip(0.2 * (time_s - 900.0), 0.0, 50.0)
    for seed in range(8):
        noise, _ = measure_noise(time_s, np.round(ramp + 0.03 * np.random.default_rng(seed).standard_normal(1000)))
        assert 0.5 < noise * math.sqrt(12.0) < 2.0


def test_noise_that_was_interpolated_onto_a_faster_clock_is_found():
    time_s, _, read = logged(0.25, 0.05)
    fast = np.arange(0.0, 899.0, 0.04)
    noise, correlation = measure_noise(fast, np.interp(fast, time_s, read))
    # Between two timestamps the interpolated noise is smaller: two thirds of the variance on average.
    assert 0.6 * 0.05 < noise < 1.1 * 0.05
    assert correlation > 1


@pytest.mark.parametrize("seed", range(6))
def test_noise_of_a_rig_that_cools_within_seconds_is_not_taken_for_slow_noise(seed: int) -> None:
    # Ramps and exponential coolings of 5 s: over the longest stride, 2 s, the temperature itself bends by degrees.
    time_s = np.arange(0.0, 360.0, 1.0 / 15.0)
    phase_s = time_s % 90.0
    wire = 23.0 + np.where(phase_s < 55.0, phase_s, 55.0 * np.exp(-(phase_s - 55.0) / 5.0))
    read = wire + 0.025 * np.random.default_rng(seed).standard_normal(len(wire))
    noise, correlation = measure_noise(time_s, read)
    # 20 % of independent neighbours are within the scatter of a median of parts with some 150 samples each.
    assert noise == pytest.approx(0.025, rel=0.2)
    assert correlation == 1.0
    found = condition(time_s, read)
    settled = (phase_s > 58.0) & (phase_s < 75.0)
    assert np.sqrt(np.mean((found.temp_c - wire)[settled] ** 2)) < 0.025


@pytest.mark.parametrize(("interval_s", "noise_c"), [(0.25, 0.02), (0.25, 0.1), (0.015, 0.1)])
def test_noise_goes_and_corners_stay(interval_s, noise_c):
    time_s, true, read = logged(interval_s, noise_c)
    made = condition(time_s, read)
    error = made.temp_c - true
    # What is left is a small share of the noise that went in, and known to be.
    assert np.std(error) < 0.2 * noise_c
    assert 0.5 < np.std(error / made.sigma_c) < 2.0
    for corner_s in (50.0, 450.0, 475.0):
        near = np.abs(time_s - corner_s) < 2.0
        # A fit over some twenty samples of one side ends with half a sigma; four of those is chance's limit.
        assert np.abs(error[near]).max() < 2.0 * noise_c


def test_the_top_is_not_overshot():
    """An upward error at a corner stays in a one-way transformation: over many seeds it must be small and rare."""
    over = []
    for seed in range(12):
        time_s, true, read = logged(0.25, 0.02, seed=seed)
        over.append(condition(time_s, read).temp_c.max() - true.max())
    # 0.02 °C of noise over a hold of 100 samples: a few thousandths, twice that for the largest of many.
    assert np.mean(over) < 0.012
    assert np.max(over) < 0.04


@pytest.mark.parametrize("lag_s", [2.0, 6.0, 12.0])
def test_the_wire_behind_a_slow_sensor(lag_s):
    time_s, true, read = logged(0.25, 0.02, lag_s=lag_s)
    error = Readings.of(time_s, read).behind(time_s, lag_s).temp_c - true
    inside = (time_s > 5.0) & (time_s < 890.0)
    # Differentiating the noise over one sample would give 0.02 · √2 · lag / 0.25 °C.
    naive = 0.02 * np.sqrt(2.0) * lag_s / 0.25
    assert np.std(error[inside]) < 0.06 * naive
    assert error[inside].max() < 0.2


def test_irregular_times_and_few_rows():
    rng = np.random.default_rng(3)
    time_s = np.cumsum(rng.uniform(0.15, 0.35, 3000))
    read = wire(time_s) + 0.05 * rng.standard_normal(3000)
    assert np.std(condition(time_s, read).temp_c - wire(time_s)) < 0.015
    assert condition(time_s[:5], read[:5]).temp_c is not None


@pytest.mark.parametrize("noise_c", [0.08, 0.2])
def test_the_top_of_a_short_hold_is_its_level(noise_c):
    """An incomplete heating ends in a hold of 9 s: its level, known to noise over the root of 36 rows, not its bow."""
    errors = []
    for seed in range(8):
        time_s = np.arange(0.0, 500.0, 0.25)
        rise = np.minimum(23.0 + 0.12 * time_s, 59.48)
        temp = np.where(time_s < 313.0, rise, 23.0 + 36.48 * np.exp(-(time_s - 313.0) / 45.0))
        found = condition(time_s, temp + noise_c * np.random.default_rng(seed).standard_normal(len(temp)))
        errors.append(float(found.temp_c.max()) - 59.48)
    # Twice the best that is possible, and a bias of less than that.
    assert np.std(errors) < 2.0 * noise_c / 6.0
    assert abs(np.mean(errors)) < noise_c / 6.0


def test_a_hold_on_the_way_up_is_its_level():
    """A transformation keeps the maximum of the noise that is left in a hold: it errs little more than the mean."""
    over = []
    for seed in range(8):
        time_s = np.arange(0.0, 300.0, 0.25)
        temp = np.interp(time_s, [0.0, 64.0, 124.0, 136.0, 196.0, 236.0], [24.0, 50.0, 50.0, 56.0, 56.0, 76.0])
        found = condition(time_s, temp + 0.03 * np.random.default_rng(seed).standard_normal(len(temp)))
        over += [
            found.temp_c[(time_s > at) & (time_s < at + 55.0)].max() - level for at, level in ((66, 50), (138, 56))
        ]
    # The mean of 240 readings, and as much again for slope and bow.
    assert np.sqrt(np.mean(np.square(over))) < 2.0 * 0.03 / np.sqrt(60.0 / 0.25)


def test_corners_of_stairs_are_as_far_off_as_is_said():
    """Where a hold ends, its noise may seem to turn: the row after it is on the ramp all the same."""
    off, likely = [], []
    for seed in range(12):
        time_s = np.arange(0.0, 400.0, 0.25)
        edges_s = np.array([64.0, 124.0, 136.0, 196.0, 208.0, 268.0, 280.0, 340.0])
        wire_c = np.interp(time_s, [0.0, *edges_s, 380.0], [24.0, 50.0, 50.0, 56.0, 56.0, 62.0, 62.0, 68.0, 68.0, 88.0])
        found = condition(time_s, wire_c + 0.03 * np.random.default_rng(seed).standard_normal(len(time_s)))
        near = np.min(np.abs(time_s[:, None] - edges_s), axis=1) <= 1.0
        off.append(np.abs(found.temp_c - wire_c)[near].max())
        likely.append(np.mean(((found.temp_c - wire_c) / found.sigma_c)[near] ** 2))
    # A quarter of the change within a row; a row off its place would be 0.125 °C.
    assert np.median(off) < 0.25 * 0.125 * 2.0
    assert np.mean(likely) < 2.0


@pytest.mark.parametrize("interval_s", [0.04, 0.25])
def test_the_overshoot_of_a_controlled_top_stays(interval_s):
    """A top that a controller overshoots by 0.3 °C and lets sink: its highest, not the level that it comes to."""
    errors = []
    for seed in range(6):
        time_s = np.arange(0.0, 420.0, interval_s)
        after = np.maximum(time_s - 250.0, 0.0)
        rise = 23.0 + 0.14 * np.minimum(time_s, 250.0) + 0.056 * after * np.exp(-after / 15.0)
        end = 58.0 + 0.056 * 40.0 * np.exp(-40.0 / 15.0)
        temp = np.where(time_s < 290.0, rise, 23.0 + (end - 23.0) * np.exp(-(time_s - 290.0) / 45.0))
        read = temp + 0.15 * np.random.default_rng(seed).standard_normal(len(temp))
        errors.append(float(condition(time_s, read).temp_c.max() - temp.max()))
    # A parabola over the ten seconds of the top knows its vertex to 1.5 noises over the root of its rows.
    assert np.sqrt(np.mean(np.square(errors))) < 2.0 * 1.5 * 0.15 / np.sqrt(10.0 / 0.25)


@pytest.mark.parametrize("lag_s", [0.0, 5.0])
def test_the_error_does_not_jump_where_a_window_changes(lag_s: float) -> None:
    """A jump drives the angle by degrees at once; a slow error of the same size hardly shows."""
    time_s, wire_c, read = logged(0.25, 0.03, lag_s=lag_s)
    found = Readings.of(time_s, read).behind(time_s, lag_s) if lag_s else condition(time_s, read)
    error_c = found.temp_c - wire_c
    away = np.min(np.abs(time_s - np.array([[50.0], [450.0], [475.0]])), axis=0) > 5.0
    jumps_c = np.abs(np.diff(error_c))[away[1:] & away[:-1]]
    # Fifty milliseconds of this ramp, behind a sensor a hundred; where windows changed it was 0.03 and 0.16 °C.
    assert np.quantile(jumps_c, 0.999) < (0.006 if lag_s == 0.0 else 0.012)


def test_one_compilation_serves_frozen_strided_and_single_precision_logs_with_and_without_a_lag():
    time_s, _, read = logged(0.25, 0.1)
    frozen = read.copy()
    frozen.setflags(write=False)
    strided = np.column_stack((read, read))[:, 0]
    expected = condition(time_s, read)
    for log in (frozen, strided):
        # Sums over strided rows are taken in another order.
        np.testing.assert_allclose(condition(time_s, log).temp_c, expected.temp_c, rtol=1e-14)
    Readings.of(time_s, read.astype(np.float32)).behind(time_s, 3.0)
    functions = [each for module in (conditioning, smoother) for each in vars(module).values()]
    counts = {each.py_func.__name__: len(each.signatures) for each in functions if isinstance(each, Dispatcher)}
    assert max(counts.values()) == 1, counts


@pytest.mark.parametrize("seed", range(6))
def test_a_coarse_log_that_is_mostly_constant_has_the_noise_of_its_rounding(seed: int) -> None:
    # A room temperature at which the last digit changes now and then.
    rng, digit_c, course_c = np.random.default_rng(seed), 0.05, np.full(30000, 20.044)
    time_s = 0.1 * np.arange(len(course_c))
    for begin_s in (300.0, 1600.0):
        past_s, rate_c_s, top_c = np.maximum(time_s - begin_s, 0.0), 0.15 * rng.uniform(0.95, 1.05), rng.uniform(40, 70)
        cooling = np.exp(-np.maximum(past_s - top_c / rate_c_s, 0.0) / 80.0)
        course_c += np.minimum(rate_c_s * past_s, top_c) * cooling
    noise = 0.005 * rng.standard_normal(len(time_s))
    found, _ = measure_noise(time_s, np.round((course_c + noise) / digit_c) * digit_c)
    assert 0.5 < found / (digit_c / np.sqrt(12.0)) < 1.8


@pytest.mark.parametrize("digit_c", [0.01, 0.1, 0.25])
@pytest.mark.parametrize("noise_c", [0.0, 0.1])
@pytest.mark.parametrize("rows", [300, 6000])
def test_the_last_digit_is_that_of_the_readings_short_noisy_or_with_lines_between(
    digit_c: float, noise_c: float, rows: int
) -> None:
    rng = np.random.default_rng(rows)
    wire_c = 45.0 - 20.0 * np.cos(np.linspace(0.0, 7.0, rows))
    log_c = np.round((wire_c + noise_c * rng.standard_normal(rows)) / digit_c) * digit_c
    assert last_digit(log_c) == pytest.approx(digit_c)
    # Rows of another instrument in two of five gaps, with temperatures on the line between two readings.
    between = np.flatnonzero(rng.random(rows - 1) < 0.4) + rng.random()
    table_c = np.interp(np.sort(np.append(np.arange(rows), between)), np.arange(rows), log_c)
    assert last_digit(table_c) == pytest.approx(digit_c)
    assert last_digit(wire_c + 0.1 * rng.standard_normal(rows)) == 0.0


def test_changes_that_are_alike_on_a_ramp_are_no_last_digit_and_a_slow_log_keeps_no_peaks_of_little_noise():
    rng, time_s = np.random.default_rng(8), np.arange(0.0, 800.0, 0.4)
    course_c = np.minimum(78.3, 22.0 + 0.4 * time_s)
    read_c = course_c + 0.004 * rng.standard_normal(len(time_s))
    assert last_digit(read_c) == 0.0
    # On a table four times as fast as the log.
    table_s = np.arange(0.0, time_s[-1], 0.1)
    found = condition(table_s, np.interp(table_s, time_s, read_c))
    held = table_s > 150.0
    assert found.temp_c[held].max() < 78.3 + 0.004
    assert found.sigma_c[held].max() < 0.004


def test_a_heating_that_is_switched_off_at_its_top_is_known_to_half_the_noise_of_a_reading():
    # The top lies anywhere between two rows; the wire cools twice as fast as it was heated.
    rng, noise_c, found = np.random.default_rng(3), 0.05, []
    time_s = np.arange(0.0, 300.0, 0.25)
    for top_s in rng.uniform(150.0, 160.0, 40):
        top_c = 22.0 + 0.3 * top_s
        past_s = time_s - top_s
        wire_c = np.where(
            past_s < 0.0, 22.0 + 0.3 * time_s, 22.0 + 0.3 * top_s * np.exp(-np.maximum(past_s, 0.0) / 75.0)
        )
        log = condition(time_s, wire_c + noise_c * rng.standard_normal(len(time_s)))
        place = int(np.argmax(log.temp_c))
        found.append(np.array([1.0 / noise_c, 1.0 / log.sigma_c[place]]) * (log.temp_c[place] - top_c))
    off, pull = np.sqrt(np.mean(np.square(found), axis=0))
    assert off < 0.5
    assert 0.4 < pull < 1.2


@pytest.mark.parametrize("noise_share", [0.0, 0.2, 1.0])
def test_a_held_top_is_known_as_well_as_its_last_digit_lets_it(noise_share: float) -> None:
    # Without noise of their own all readings of a level are off by one rounding.
    rng, digit_c, off = np.random.default_rng(5), 0.25, []
    time_s = np.arange(0.0, 200.0, 0.25)
    for top_c in np.linspace(60.0, 60.25, 12):
        course = np.minimum(top_c, 30.0 + 0.3 * time_s) - 0.5 * np.maximum(0.0, time_s - 150.0)
        noise = noise_share * digit_c * rng.standard_normal(len(time_s))
        found = condition(time_s, np.round((course + noise) / digit_c) * digit_c)
        held = (time_s > 135.0) & (time_s < 148.0)
        off.append(((found.temp_c - top_c) / found.sigma_c)[held])
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


@pytest.mark.parametrize("rows_per_reading", [1.3, 2.0, 2.6])
def test_readings_with_a_coarse_digit_are_smoothed_in_a_table_of_rows_between_them(rows_per_reading: float) -> None:
    # A logger at 5 Hz with tenths of a degree, and a film whose frames lie anywhere between its readings.
    log_s = np.arange(0.0, 600.0, 0.2)
    wire_c = 23.0 + np.interp(log_s, [50.0, 250.0, 270.0], [0.0, 40.0, 40.0])
    wire_c -= 40.0 * (1.0 - np.exp(-np.maximum(log_s - 270.0, 0.0) / 60.0))
    log_c = np.round(wire_c, 1)
    film_s = np.arange(0.07, 599.0, 0.2 / rows_per_reading)
    found = condition(film_s, np.interp(film_s, log_s, log_c))
    at = np.interp(film_s, log_s, wire_c)
    moving = (film_s > 55.0) & (film_s < 400.0) & (np.abs(film_s - 260.0) > 15.0)
    assert found.noise_c > 0.5 * 0.1 / np.sqrt(12.0)
    # A line through the readings of ten seconds errs by a seventh of a reading's rounding.
    assert np.std((found.temp_c - at)[moving]) < 0.3 * 0.1 / np.sqrt(12.0)
    assert np.std((found.rate_c_s - np.gradient(at, film_s))[moving]) < 0.02
