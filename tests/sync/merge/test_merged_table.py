"""Temperatures at the film's instants."""

from dataclasses import replace

import numpy as np
import pytest

from sync import merge
from sync.merge.merged_table import require_overlap
from torsight.core.errors import InputError
from torsight.core.records import ClockMap, TemperatureLog
from torsight.core.tracks import StickAngles


def angles_at(time_s):
    count = len(time_s)
    rng = np.random.default_rng(3)
    everywhere = np.ones(count, dtype=bool)
    return StickAngles(
        np.arange(count), time_s, rng.standard_normal(count), rng.uniform(1e-3, 2e-3, count), everywhere, everywhere
    )


def exact(offset_s=0.0, drift_ppm=0.0):
    return ClockMap(offset_s, drift_ppm, (offset_s, offset_s), (drift_ppm, drift_ppm), "given")


def test_a_straight_line_comes_through_any_clock():
    log_s = np.arange(0.0, 400.0, 0.33)
    log = TemperatureLog(log_s, 20.0 + 0.1 * log_s, 30.0 - 0.02 * log_s)
    film_s = np.arange(0.0, 100.0, 0.04)
    table = merge(angles_at(film_s), log, exact(57.3, 150.0))
    instant_s = film_s * (1.0 + 150e-6) + 57.3
    np.testing.assert_allclose(table.temp_a_c, 20.0 + 0.1 * instant_s, rtol=0, atol=1e-10)
    np.testing.assert_allclose(table.temp_b_c, 30.0 - 0.02 * instant_s, rtol=0, atol=1e-10)


def test_readings_on_a_frame_come_out_as_they_are():
    log_s = np.arange(0.0, 50.0, 0.25)
    temp = 25.0 + np.random.default_rng(0).standard_normal(len(log_s))
    table = merge(angles_at(log_s), TemperatureLog(log_s, temp, temp), exact())
    np.testing.assert_array_equal(table.temp_a_c, temp)


def test_a_corner_is_not_rounded():
    # A log as fast as 15 ms and a slow film: a mean over the frame's interval would take 0.25 °C off this corner.
    log_s = np.arange(0.0, 20.0, 0.015)
    temp = 70.0 - 1.0 * np.abs(log_s - 9.0)
    film_s = np.arange(0.0, 19.0, 1.0)
    table = merge(angles_at(film_s), TemperatureLog(log_s, temp, temp), exact())
    assert table.temp_a_c[9] == pytest.approx(70.0, abs=1e-9)


def test_long_gaps_stay_empty_and_short_ones_are_bridged():
    log_s = np.arange(0.0, 60.0, 0.5)
    keep = ~((log_s > 10.0) & (log_s < 11.5)) & ~((log_s > 30.0) & (log_s < 40.0))
    temp = 20.0 + 0.3 * log_s
    spoiled = temp.copy()
    spoiled[(log_s >= 50.0) & (log_s < 55.0)] = np.nan
    log = TemperatureLog(log_s[keep], spoiled[keep], temp[keep])
    film_s = np.arange(0.0, 59.0, 0.1)
    table = merge(angles_at(film_s), log, exact(), max_gap_s=2.0)
    unknown = np.isnan(table.temp_a_c)
    expected = ((film_s > 30.0 + 1e-9) & (film_s < 40.0 - 1e-9)) | ((film_s > 49.5 + 1e-9) & (film_s < 55.0 - 1e-9))
    np.testing.assert_array_equal(unknown, expected)
    np.testing.assert_allclose(table.temp_a_c[~unknown], 20.0 + 0.3 * film_s[~unknown])


def test_a_top_at_which_the_film_lacks_frames_is_kept():
    log_s = np.arange(0.0, 60.0, 0.25)
    temp = 70.0 - 2.0 * np.abs(log_s - 31.0)
    log = TemperatureLog(log_s, temp, np.full(len(log_s), 23.0), heat_a=log_s < 31.0)
    frames_s = np.arange(0.0, 60.0, 0.08)
    film_s = frames_s[(frames_s < 28.0) | (frames_s > 33.0)]
    angles = angles_at(film_s)
    table = merge(angles, log, exact(-4.0))
    assert np.all(np.diff(table.time_s) > 0.0)
    seen = np.isfinite(table.angle_rad)
    np.testing.assert_array_equal(table.time_s[seen], film_s)
    np.testing.assert_array_equal(table.angle_rad[seen], angles.angle_rad)
    added = table.at(~seen)
    assert added.time_s[[0, -1]] == pytest.approx([28.0, 33.0], abs=0.3)
    np.testing.assert_array_equal(np.isin(added.time_s - 4.0, log_s), True)
    table = merge(angles, log, exact())
    assert np.nanmax(table.temp_a_c) == 70.0
    assert table.time_s[np.argmin(table.heat_a)] == 31.0


def test_a_film_slower_than_its_log_keeps_its_rows():
    log_s = np.arange(0.0, 60.0, 0.25)
    film_s = np.arange(0.0, 59.0, 1.0)
    table = merge(angles_at(film_s), TemperatureLog(log_s, log_s, log_s), exact())
    np.testing.assert_array_equal(table.time_s, film_s)


def test_angle_and_sigma_are_carried_and_switches_hold():
    log_s = np.arange(0.0, 20.0, 1.0)
    heat = (log_s >= 5.0) & (log_s < 9.0)
    log = TemperatureLog(log_s, 20.0 + log_s, 20.0 + log_s, heat, ~heat, {"current_a_a": 2.0 * heat})
    angles = angles_at(np.arange(0.0, 25.0, 0.25))
    table = merge(angles, log, exact())
    np.testing.assert_array_equal(table.angle_rad, angles.angle_rad)
    np.testing.assert_array_equal(table.angle_sigma_rad, angles.sigma_rad)
    np.testing.assert_array_equal(table.heat_a, (angles.time_s >= 5.0) & (angles.time_s < 9.0))
    np.testing.assert_array_equal(np.isnan(table.extra["current_a_a"]), angles.time_s > 19.0)


def test_further_columns_of_the_angles_stay_at_their_frames():
    film_s, log_s = np.r_[np.arange(0.0, 30.0), np.arange(33.0, 40.0)], np.arange(0.0, 50.0)
    angles = replace(angles_at(film_s), extra={"light_v": film_s, "temp_a_c": film_s})
    table = merge(angles, TemperatureLog(log_s, 20.0 + log_s, log_s), exact())
    np.testing.assert_array_equal(table.extra["light_v"], np.where(np.isin(table.time_s, film_s), table.time_s, np.nan))
    np.testing.assert_array_equal(table.temp_a_c, 20.0 + table.time_s)
    assert set(table.extra) == {"light_v"}


def test_columns_of_one_name_in_angles_and_log_are_both_kept():
    film_s, log_s = np.arange(0.0, 30.0), np.arange(0.0, 50.0)
    log = TemperatureLog(log_s, 20.0 + log_s, log_s, None, None, {"light_v": 2.0 * log_s})
    table = merge(replace(angles_at(film_s), extra={"light_v": film_s}), log, exact())
    np.testing.assert_array_equal(table.extra["light_v"], film_s)
    np.testing.assert_array_equal(table.extra["light_v_log"], 2.0 * film_s)


def test_no_overlap_is_told():
    log_s = np.arange(0.0, 20.0, 1.0)
    log = TemperatureLog(log_s, log_s, log_s)
    angles = angles_at(np.arange(0.0, 10.0, 0.5))
    clock = exact(500.0)
    with pytest.raises(InputError, match="do not overlap"):
        require_overlap(merge(angles, log, clock), angles, log, clock, where="temps.csv")
