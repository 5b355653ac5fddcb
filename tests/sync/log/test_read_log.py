"""Messy logs: what is mended, what is told, what is refused."""

import numpy as np
import pandas as pd
import pytest

from sync import read_temperature_log
from sync.log.timestamps import longest_gap_s
from sync.merge.merged_table import at_instants
from tests.sync.written_logs import kinds, ramp, written
from torsight.core.errors import InputError


def test_clean_log_passes_unchanged(tmp_path):
    time_s, temp_a, temp_b = ramp()
    rng = np.random.default_rng(1)
    temp_a = temp_a + 0.03 * rng.standard_normal(len(temp_a))
    reading = read_temperature_log(written(tmp_path, time_s, temp_a, temp_b))
    assert reading.repairs == ()
    np.testing.assert_array_equal(reading.log.time_s, time_s)
    np.testing.assert_allclose(reading.log.temp_a_c, temp_a, rtol=0, atol=1e-12)


def test_corners_of_the_temperature_are_not_taken_for_spikes(tmp_path):
    time_s = np.arange(0.0, 200.0, 0.5)
    temp = np.where(time_s < 100.0, 25.0 + 0.5 * time_s, 25.0 + 50.0 * np.exp(-(time_s - 100.0) / 5.0))
    reading = read_temperature_log(written(tmp_path, time_s, temp, temp))
    assert reading.repairs == ()
    np.testing.assert_allclose(reading.log.temp_a_c, temp)


def test_spikes_and_blanks_become_unknown(tmp_path):
    time_s, temp_a, temp_b = ramp()
    spoiled = temp_a.copy()
    spoiled[[50, 51, 200]] = [300.0, 300.0, -40.0]
    spoiled[300] = np.nan
    reading = read_temperature_log(written(tmp_path, time_s, spoiled, temp_b))
    assert kinds(reading) == {"spike": 3, "not_a_number": 1}
    lost = np.flatnonzero(np.isnan(reading.log.temp_a_c))
    np.testing.assert_array_equal(lost, [50, 51, 200, 300])
    good = np.isfinite(reading.log.temp_a_c)
    np.testing.assert_allclose(reading.log.temp_a_c[good], temp_a[good])


def test_the_digits_of_a_coarse_thermometer_are_no_jumps(tmp_path):
    time_s = np.arange(0.0, 400.0, 1.0)
    # The top of a slow heating is one digit of 2 °C for half a minute.
    temp = 2.0 * np.round(0.5 * np.where(time_s < 200.0, 25.0 + 0.13 * time_s, 51.0 - 0.13 * (time_s - 200.0)))
    assert read_temperature_log(written(tmp_path, time_s, temp, temp)).repairs == ()


def test_a_sensor_that_loses_contact_is_no_cold_wire(tmp_path):
    # In the cooling that follows a sudden top no neighbours lie on one line.
    time_s = np.arange(0.0, 200.0, 0.5)
    temp = np.where(time_s < 100.0, 25.0 + 0.5 * time_s, 25.0 + 50.0 * np.exp(-(time_s - 100.0) / 40.0))
    lost = ((time_s > 104.0) & (time_s < 116.0)) | ((time_s > 60.0) & (time_s < 63.0))
    reading = read_temperature_log(written(tmp_path, time_s, np.where(lost, 25.0, temp), temp))
    assert kinds(reading) == {"spike": np.count_nonzero(lost)}
    np.testing.assert_array_equal(np.isnan(reading.log.temp_a_c), lost)


def test_numbers_that_stand_still_become_unknown(tmp_path):
    time_s, temp_a, temp_b = ramp()
    stuck = temp_a.copy()
    stuck[100:160] = stuck[100]
    reading = read_temperature_log(written(tmp_path, time_s, stuck, temp_b))
    assert kinds(reading) == {"stuck": 59}
    assert np.isnan(reading.log.temp_a_c[101:160]).all()


def test_a_rest_is_not_stuck(tmp_path):
    time_s = np.arange(400) * 0.25
    rest = np.round(25.0 + np.maximum(0.0, time_s - 50.0) * 0.1, 1)
    assert read_temperature_log(written(tmp_path, time_s, rest, rest)).repairs == ()


@pytest.mark.parametrize(("step_s", "lost", "gaps"), [(0.1, 18, 0), (0.1, 22, 1), (1.0, 4, 0), (1.0, 6, 1)])
def test_a_gap_is_reported_where_the_merged_table_stays_empty(tmp_path, step_s, lost, gaps):
    time_s = np.arange(0.0, 200.0, step_s)
    table = pd.DataFrame({"time_s": time_s, "temp_a_c": 23.0 + 0.2 * time_s, "temp_b_c": 23.0 + 0.01 * time_s})
    path = tmp_path / "temps.csv"
    table.drop(index=range(50, 50 + lost)).to_csv(path, index=False)
    log = read_temperature_log(path)
    assert kinds(log).get("gap", 0) == gaps
    merged = at_instants(log.log.time_s, log.log.temp_a_c, time_s, max_gap_s=longest_gap_s(log.log.time_s))
    assert np.isnan(merged[50 : 50 + lost]).all() == bool(gaps)


def test_repeated_rows_are_averaged(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    order = np.sort(np.concatenate([np.arange(100), [10, 40, 41]]))
    reading = read_temperature_log(written(tmp_path, time_s[order], temp_a[order], temp_b[order]))
    assert kinds(reading) == {"repeated_stamp": 3}
    np.testing.assert_allclose(reading.log.time_s, time_s)
    np.testing.assert_allclose(reading.log.temp_a_c, temp_a)


def test_stamps_coarser_than_the_rows_are_spread(tmp_path):
    time_s, temp_a, temp_b = ramp(200)
    reading = read_temperature_log(written(tmp_path, np.floor(time_s), temp_a, temp_b))
    assert "coarse_stamp" in kinds(reading)
    np.testing.assert_allclose(reading.log.time_s, time_s, atol=1e-9)


def test_reversed_rows_go_back_to_their_place(tmp_path):
    time_s, temp_a, temp_b = ramp(200)
    order = np.arange(200)
    order[[20, 21]] = [21, 20]
    order[100:106] = order[100:106][::-1]
    reading = read_temperature_log(written(tmp_path, time_s[order], temp_a[order], temp_b[order]))
    assert set(kinds(reading)) == {"reordered"}
    np.testing.assert_allclose(reading.log.time_s, time_s)
    np.testing.assert_allclose(reading.log.temp_a_c, temp_a)


@pytest.mark.parametrize("wild", [99999.0, -5.0])
def test_a_wrong_stamp_is_interpolated(tmp_path, wild):
    time_s, temp_a, temp_b = ramp(200)
    stamps = time_s.copy()
    stamps[77] = wild
    reading = read_temperature_log(written(tmp_path, stamps, temp_a, temp_b))
    assert kinds(reading) == {"wrong_stamp": 1}
    np.testing.assert_allclose(reading.log.time_s, time_s)


def test_iso_dates_become_seconds(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    stamps = pd.Timestamp("2024-05-01T23:59:50Z") + pd.to_timedelta(time_s, unit="s")
    text = [stamp.isoformat() for stamp in stamps]
    reading = read_temperature_log(written(tmp_path, text, temp_a, temp_b))
    np.testing.assert_allclose(reading.log.time_s, time_s, atol=1e-9)
    assert reading.zero is not None
    assert reading.zero.startswith("2024-05-01T23:59:50")


def test_stamps_that_are_neither_numbers_nor_dates(tmp_path):
    path = written(tmp_path, [f"x{i}" for i in range(30)], *ramp(30)[1:])
    with pytest.raises(InputError, match="time_s"):
        read_temperature_log(path)


def test_switches_and_further_columns_are_kept(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    heat = (time_s > 10).astype(int)
    note = np.array(["run"] * 100, dtype=object)
    path = written(
        tmp_path, time_s, temp_a, temp_b, extra={"heat_a": heat, "heat_b": 1 - heat, "n": heat, "note": note}
    )
    log = read_temperature_log(path).log
    np.testing.assert_array_equal(log.heat_a, heat == 1)
    np.testing.assert_array_equal(log.heat_b, heat == 0)
    assert set(log.extra) == {"n", "note"}


def test_restart_on_a_ramp_is_bridged_by_the_rate(tmp_path):
    time_s, temp_a, temp_b = ramp(800)
    away_s = 12.0
    keep = (time_s < 90.0) | (time_s >= 90.0 + away_s)
    stamps, rng = time_s[keep].copy(), np.random.default_rng(4)
    behind = stamps >= 90.0
    stamps[behind] -= stamps[behind][0]
    noisy = temp_a[keep] + 0.02 * rng.standard_normal(keep.sum())
    reading = read_temperature_log(written(tmp_path, stamps, noisy, temp_b[keep]))
    (restart,) = reading.restarts
    # Two lines of 40 readings each: value at the end known to 2 σ/√40, rate 0.2 °C/s.
    sigma_s = np.sqrt(2.0) * 2.0 * 0.02 / np.sqrt(40) / 0.2
    assert abs(restart.gap_s - away_s - 0.25) < 4.0 * sigma_s
    assert np.all(np.diff(reading.log.time_s) > 0)


@pytest.mark.parametrize("wild", [300.0, 1e308])
def test_readings_that_no_spring_can_have_do_not_tell_how_long_a_restart_was(tmp_path, wild):
    t = np.arange(0, 120.0, 0.25)
    temp = 25.0 + 0.4 * t + np.random.default_rng(1).normal(0.0, 0.05, len(t))
    stamps = np.where(t < 60.0, t, t - 55.0)
    (clean,) = read_temperature_log(written(tmp_path, stamps, temp, temp)).restarts
    temp[[230, 239, 241]] = wild
    (restart,) = read_temperature_log(written(tmp_path, stamps, temp, temp)).restarts
    assert abs(restart.gap_s - clean.gap_s) < 2.0 * clean.gap_sigma_s


def test_restart_at_rest_is_not_known(tmp_path):
    time_s = np.arange(400) * 0.25
    stamps = np.where(time_s < 50.0, time_s, time_s - 50.0)
    rng = np.random.default_rng(2)
    temp = 24.0 + 0.03 * rng.standard_normal((2, 400))
    (restart,) = read_temperature_log(written(tmp_path, stamps, *temp)).restarts
    assert restart.index == 200
    assert not np.isfinite(restart.gap_sigma_s)


def test_restart_at_zero_from_negative_stamps_is_no_pause(tmp_path):
    time_s, temp_a, temp_b = ramp(800)
    stamps = np.where(time_s < 90.0, time_s - 300.0, time_s - 90.0)
    reading = read_temperature_log(written(tmp_path, stamps, temp_a, temp_b))
    (restart,) = reading.restarts
    assert restart.gap_s == pytest.approx(0.25, abs=1e-6)
    np.testing.assert_allclose(reading.log.time_s, time_s - 300.0, atol=1e-6)


@pytest.mark.parametrize(("hours", "restarts"), [(5.0, 0), (7.0, 1)])
def test_a_long_pause_stays_and_a_clock_that_was_set_is_moved(tmp_path, hours, restarts):
    time_s, temp_a, temp_b = ramp(800)
    stamps = np.where(time_s < 90.0, time_s, time_s + 3600.0 * hours)
    reading = read_temperature_log(written(tmp_path, stamps, temp_a, temp_b))
    assert len(reading.restarts) == restarts
    np.testing.assert_allclose(reading.log.time_s, time_s if restarts else stamps, atol=1e-6)


@pytest.mark.parametrize("rows", [3, 8, 40])
def test_rows_behind_a_step_back_are_a_restart_where_their_time_was_there_already(tmp_path, rows):
    time_s, temp_a, temp_b = ramp(200)
    # A stretch written behind the next one leaves its place vacant.
    order = np.arange(200)
    order[100 : 100 + 2 * rows] = np.roll(order[100 : 100 + 2 * rows], rows)
    reading = read_temperature_log(written(tmp_path, time_s[order], temp_a[order], temp_b[order]))
    assert kinds(reading) == {"reordered": rows}
    np.testing.assert_allclose(reading.log.time_s, time_s)
    stamps = np.where(time_s < time_s[-rows], time_s, time_s - 10.0)
    assert [restart.index for restart in read_temperature_log(written(tmp_path, stamps, temp_a, temp_b)).restarts] == [
        200 - rows
    ]


def test_a_log_that_runs_backwards_is_refused_as_out_of_order(tmp_path):
    time_s, temp_a, temp_b = ramp(200)
    with pytest.raises(InputError, match="out of order; found 1 of 200 rows in order; allowed half of the rows"):
        read_temperature_log(written(tmp_path, time_s[::-1], temp_a, temp_b))


@pytest.mark.parametrize("began_s", [0.0, 40.0, 85.0, 150.0])
def test_a_clock_that_begins_at_zero_runs_into_the_stamps_that_were_there(tmp_path, began_s):
    time_s, temp_a, temp_b = ramp(800)
    stamps = np.where(time_s < 90.0, began_s + time_s, time_s - 90.0)
    (restart,) = read_temperature_log(written(tmp_path, stamps, temp_a, temp_b)).restarts
    assert restart.index == 360


@pytest.mark.parametrize(("wraps_s", "refused"), [(60.0, False), (10.0, True)])
def test_a_clock_that_begins_again_and_again(tmp_path, wraps_s, refused):
    time_s, temp_a, temp_b = ramp(8000, rate=0.02)
    path = written(tmp_path, time_s % wraps_s, temp_a, temp_b)
    if refused:
        with pytest.raises(InputError, match="out of order"):
            read_temperature_log(path)
    else:
        reading = read_temperature_log(path)
        assert len(reading.restarts) == 33
        np.testing.assert_allclose(reading.log.time_s, time_s, atol=1e-6)


def noisy(rows=1200, seed=4):
    rng = np.random.default_rng(seed)
    time_s = np.round(0.05 * np.arange(rows), 3)
    temp_c = 24.0 + 30.0 * np.clip((time_s - 10.0) / 30.0, 0.0, 1.0)
    return time_s, np.round(temp_c + 0.03 * rng.standard_normal(rows), 2)


@pytest.mark.parametrize("hangs", [[(900, 1200)], [(50, 120)], [(begin, begin + 50) for begin in range(20, 1200, 200)]])
def test_a_sensor_that_hangs_without_a_jump(tmp_path, hangs):
    time_s, temp_c = noisy()
    hung = temp_c.copy()
    for begin, end in hangs:
        hung[begin:end] = hung[begin]
    pd.DataFrame({"time_s": time_s, "temp_a_c": hung, "temp_b_c": temp_c}).to_csv(tmp_path / "t.csv", index=False)
    reading = read_temperature_log(tmp_path / "t.csv")
    lost = sum(end - begin - 1 for begin, end in hangs)
    assert kinds(reading)["stuck"] == pytest.approx(lost, abs=2 * len(hangs))
    for begin, end in hangs:
        assert np.isnan(reading.log.temp_a_c[begin + 5 : end - 5]).all()
    assert np.isfinite(reading.log.temp_b_c).all()


def test_a_quiet_sensor_at_rest_is_not_stuck(tmp_path):
    time_s, _ = noisy()
    temp_c = np.round(24.0 + 30.0 * np.clip((time_s - 10.0) / 45.0, 0.0, 1.0), 2)
    pd.DataFrame({"time_s": time_s, "temp_a_c": temp_c, "temp_b_c": 24.0}).to_csv(tmp_path / "t.csv", index=False)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.repairs == ()
    assert np.array_equal(reading.log.temp_a_c, temp_c)


@pytest.mark.parametrize(("words", "left"), [(("an", "aus"), 6), (("on", "?"), 3)])
def test_a_switch_that_cannot_be_read_is_told(tmp_path, words, left):
    rows = "".join(f"{i},24.5,25.5,{words[i % 2]}\n" for i in range(6))
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c,heat_a\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert kinds(reading) == {"no_switch": left}
    assert (reading.log.heat_a is None) == (left == 6)


def test_a_number_that_is_no_state_of_a_switch_is_refused(tmp_path):
    rows = "".join(f"{i},24.5,25.5,{2 * (i > 2)}\n" for i in range(6))
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c,heat_a\n" + rows)
    with pytest.raises(InputError, match=r"line 5, column heat_a: is no switch; found 2; allowed 0 or 1"):
        read_temperature_log(tmp_path / "t.csv")
    # A column that only looks like a switch is left alone.
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c,Heater A\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.heat_a is None
    assert kinds(reading) == {"no_switch": 3}


def test_a_clock_that_stands_still_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c\n" + "1.0,24.5,25.5\n" * 9)
    with pytest.raises(InputError, match="same time"):
        read_temperature_log(tmp_path / "t.csv")
