"""Messy logs: what is mended, what is told, what is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sync import read_temperature_log
from sync.log.column_names import resolve
from torsight.core.errors import InputError


def ramp(rows=400, step_s=0.25, rate=0.2):
    time_s = np.arange(rows) * step_s
    return time_s, 25.0 + rate * time_s, 24.0 + 0.1 * rate * time_s


def written(folder: Path, time_s, temp_a, temp_b, *, sep=",", decimal=".", newline="\n", bom=False, extra=None) -> Path:
    columns = {"time_s": time_s, "temp_a_c": temp_a, "temp_b_c": temp_b} | (extra or {})
    text = pd.DataFrame(columns).to_csv(index=False, sep=sep, decimal=decimal, lineterminator="\n")
    path = folder / "temps.csv"
    path.write_bytes((b"\xef\xbb\xbf" if bom else b"") + text.replace("\n", newline).encode())
    return path


def kinds(reading):
    return {repair.kind: repair.count for repair in reading.repairs}


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


@pytest.mark.parametrize("sep", [",", ";", "\t"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("bom", [False, True])
def test_delimiter_line_ends_and_byte_order_mark(tmp_path, sep, newline, bom):
    time_s, temp_a, temp_b = ramp(60)
    reading = read_temperature_log(written(tmp_path, time_s, temp_a, temp_b, sep=sep, newline=newline, bom=bom))
    np.testing.assert_allclose(reading.log.time_s, time_s)
    np.testing.assert_allclose(reading.log.temp_b_c, temp_b)


def test_decimal_commas_where_they_are_unambiguous(tmp_path):
    time_s, temp_a, temp_b = ramp(60)
    reading = read_temperature_log(written(tmp_path, time_s, temp_a, temp_b, sep=";", decimal=","))
    assert "decimal_comma" in kinds(reading)
    np.testing.assert_allclose(reading.log.temp_a_c, temp_a)


def test_comma_that_may_be_a_thousands_sign_is_refused(tmp_path):
    path = tmp_path / "temps.csv"
    rows = "\n".join(f"{i};2{i % 10},125;23,500" for i in range(20))
    path.write_text("time_s;temp_a_c;temp_b_c\n" + rows)
    with pytest.raises(InputError, match="thousands"):
        read_temperature_log(path)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    path = tmp_path / "temps.csv"
    path.write_text("time_s,temp_a_c,temp_b_c\n" + "\n".join(f"{i},5,25,1,24,2" for i in range(20)))
    with pytest.raises(InputError, match="more fields"):
        read_temperature_log(path)


@pytest.mark.parametrize("missing", ["time_s", "temp_a_c", "temp_b_c"])
def test_missing_column_is_named(tmp_path, missing):
    time_s, temp_a, temp_b = ramp(30)
    columns = {"time_s": time_s, "temp_a_c": temp_a, "temp_b_c": temp_b}
    del columns[missing]
    path = tmp_path / "temps.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    with pytest.raises(InputError, match=missing) as caught:
        read_temperature_log(path)
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("content", ["", "time_s,temp_a_c,temp_b_c\n", "time_s,temp_a_c,temp_b_c\n1,2,3\n"])
def test_too_little_to_use(tmp_path, content):
    path = tmp_path / "temps.csv"
    path.write_text(content)
    with pytest.raises(InputError):
        read_temperature_log(path)


def test_a_header_may_stand_below_thousands_of_lines(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    path = written(tmp_path, time_s, temp_a, temp_b)
    table = path.read_text()
    letters = [chr(ord("a") + index) for index in range(26)]
    path.write_text("".join(f"{a}{b}{c} is no column\n" for a in letters for b in letters for c in letters) + table)
    np.testing.assert_allclose(read_temperature_log(path).log.temp_a_c, temp_a)


def test_rows_of_a_log_without_a_header_are_looked_at_once(tmp_path, monkeypatch):
    path = tmp_path / "temps.csv"
    path.write_text("Time,Temp A\n" + "".join(f"{i % 28 + 1:02d}-May-2024 10:00:00,{i}.5\n" for i in range(3000)))
    looked_at = []
    monkeypatch.setattr(
        "sync.log.header.resolve", lambda names, chosen: looked_at.append(names) or resolve(names, chosen)
    )
    with pytest.raises(InputError, match="temp_b_c"):
        read_temperature_log(path)
    assert len(looked_at) < 20


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_temperature_log(tmp_path / "nothing.csv")


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


def test_parquet_is_read_too(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    path = tmp_path / "temps.parquet"
    pd.DataFrame({"time_s": time_s, "temp_a_c": temp_a, "temp_b_c": temp_b}).to_parquet(path)
    np.testing.assert_allclose(read_temperature_log(path).log.temp_a_c, temp_a)


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
    with pytest.raises(InputError, match="out of order"):
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


def test_decimal_commas_in_quotes(tmp_path):
    rows = "".join(f'"{i},25","24,5","2{i},75"\n' for i in range(5))
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.time_s.tolist() == [0.25, 1.25, 2.25, 3.25, 4.25]
    assert reading.log.temp_b_c.tolist() == [20.75, 21.75, 22.75, 23.75, 24.75]
    assert kinds(reading) == {"decimal_comma": 15}


@pytest.mark.parametrize(("note", "delimiter"), [("1,5", ";"), ("1,234", ";"), ("v1,024.5", ";"), ('"1,234"', ",")])
def test_a_comma_in_a_note_says_nothing_about_numbers(tmp_path, note, delimiter):
    rows = "".join(delimiter.join([str(i), f"24.{i}5", f"2{i}.75", note]) + "\n" for i in range(5))
    (tmp_path / "t.csv").write_text(delimiter.join(["time_s", "temp_a_c", "temp_b_c", "note"]) + "\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.temp_a_c.tolist() == [24.05, 24.15, 24.25, 24.35, 24.45]
    assert reading.repairs == ()
    assert [str(value) for value in reading.log.extra["note"]] == [note.strip('"')] * 5


def test_commas_and_points_in_one_column(tmp_path):
    rows = "".join(f"{i};{24.25 + i}".replace(".", "," if i % 2 else ".") + ";25.5\n" for i in range(6))
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.temp_a_c.tolist() == [24.25, 25.25, 26.25, 27.25, 28.25, 29.25]
    assert kinds(reading) == {"decimal_comma": 3}


def test_an_ambiguous_number_is_told_with_its_line(tmp_path):
    rows = "0;24.5;25.5;1,5\n1;24.5;25.5;1,5\n2;24,125;25.5;1,5\n"
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c;note\n" + rows)
    with pytest.raises(InputError, match=r"line 4.*found 24,125"):
        read_temperature_log(tmp_path / "t.csv")


@pytest.mark.parametrize("beginning", [b"\x1f\x8b\x08\x00", b"PK\x03\x04", b"PAR1", b"%PDF-1.7"])
def test_a_file_of_another_kind_is_named(tmp_path, beginning):
    (tmp_path / "t.csv").write_bytes(beginning + bytes(range(1, 256)))
    with pytest.raises(InputError, match=r"is not text; found .*export it as CSV"):
        read_temperature_log(tmp_path / "t.csv")


def test_a_field_beyond_all_measure_is_one_bad_row(tmp_path):
    rows = "".join(f"{i},2{i}.5,24.5\n" for i in range(5))
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c\n" + rows + '5,"' + "x" * 200_000 + '",24.5\n')
    reading = read_temperature_log(tmp_path / "t.csv")
    assert kinds(reading)["not_a_number"] == 1
    assert len(reading.log) == 6


def test_iso_stamps_with_a_decimal_comma(tmp_path):
    rows = "".join(f"2024-05-01T10:00:0{i},500;24.5;2{i}.75\n" for i in range(5))
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert reading.log.temp_a_c.tolist() == [24.5] * 5


def test_thousands_are_refused(tmp_path):
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c\n" + "".join(f"{i};1,024.5;25.5\n" for i in range(5)))
    with pytest.raises(InputError, match="thousands"):
        read_temperature_log(tmp_path / "t.csv")


@pytest.mark.parametrize(("words", "left"), [(("an", "aus"), 6), (("on", "?"), 3)])
def test_a_switch_that_cannot_be_read_is_told(tmp_path, words, left):
    rows = "".join(f"{i},24.5,25.5,{words[i % 2]}\n" for i in range(6))
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c,heat_a\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert kinds(reading) == {"no_switch": left}
    assert (reading.log.heat_a is None) == (left == 6)


def test_a_clock_that_stands_still_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("time_s,temp_a_c,temp_b_c\n" + "1.0,24.5,25.5\n" * 9)
    with pytest.raises(InputError, match="same time"):
        read_temperature_log(tmp_path / "t.csv")
