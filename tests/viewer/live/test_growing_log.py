"""A log that grows beside the film: its rows as they are written, and the clock they came by."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sync import read_temperature_log
from sync.log.column_names import chosen_columns
from tests.sync import instrument_logs as logs
from torsight.core.errors import InputError
from torsight.viewer.live.measure.growing_log import LogClock, LogFollower

LOG = "time_s,temp_a_c,temp_b_c,heat_a,heat_b\n0.00,25.0,24.5,0,0\n0.25,25.5,24.5,1,0\n0.50,,24.6,1,0\n"
ROWS = [(0.0, 25.0, 24.5, 0.0, 0.0), (0.25, 25.5, 24.5, 1.0, 0.0), (0.5, np.nan, 24.6, 1.0, 0.0)]


def values_of(rows: list) -> np.ndarray:
    return np.array([row.numbers for row in rows])


@given(st.lists(st.integers(1, len(LOG)), max_size=12))
@settings(max_examples=40, deadline=None)
def test_a_log_gives_the_same_rows_however_it_is_written(tmp_path_factory: pytest.TempPathFactory, cuts: list) -> None:
    path = tmp_path_factory.mktemp("log") / "temps.csv"
    follower = LogFollower(path, pytest.fail)
    rows = follower.poll()
    with path.open("w", encoding="utf-8") as file:
        for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(LOG)], strict=True):
            file.write(LOG[start:end])
            file.flush()
            rows += follower.poll()
    follower.close()
    np.testing.assert_array_equal(values_of(rows), ROWS)
    assert "\n".join([follower.header, *(row.text for row in rows)]) + "\n" == LOG


def test_a_last_line_without_its_end_waits(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    path.write_text("time_s,temp_a_c,temp_b_c\n1,20,30\n2,2", encoding="utf-8")
    follower = LogFollower(path, pytest.fail)
    assert len(follower.poll()) == 1
    with path.open("a", encoding="utf-8") as file:
        file.write("1.5,31\n")
    assert follower.poll()[0].numbers[:3] == (2.0, 21.5, 31.0)


@pytest.mark.parametrize("how", ["renamed", "cut"])
def test_a_rotated_log_goes_on_with_the_new_file_and_loses_nothing(tmp_path: Path, how: str) -> None:
    path = tmp_path / "temps.csv"
    told: list[str] = []
    follower = LogFollower(path, told.append)
    path.write_text("time_s,temp_a_c,temp_b_c\n1,20,30\n", encoding="utf-8")
    rows = follower.poll()
    if how == "renamed":
        with path.open("a", encoding="utf-8") as file:
            file.write("2,21,30\n")
        path.rename(tmp_path / "temps.csv.1")
        assert [row.numbers[0] for row in follower.poll()] == [2.0]
        path.write_text("time_s,temp_a_c,temp_b_c\n3,22,30\n4,23,30\n", encoding="utf-8")
    else:
        path.write_text("3,22,30\n", encoding="utf-8")
    rows = follower.poll()
    assert next(row.numbers[0] for row in rows) == 3.0
    assert "rotated" in told[0]


def test_a_log_with_semicolons_decimal_commas_and_dates(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    path.write_text(
        "\ufefftemp_b_c;time_s;temp_a_c\n30,5;2024-05-01T10:00:00.000;20,25\n30,6;2024-05-01T10:00:00.250;20,5\n",
        encoding="utf-8",
    )
    rows = LogFollower(path, pytest.fail).poll()
    np.testing.assert_allclose(values_of(rows)[:, :3], [[0.0, 20.25, 30.5], [0.25, 20.5, 30.6]])


def test_a_log_with_the_name_of_its_time_zone(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    path.write_text("time_s,temp_a_c,temp_b_c\n05/31/2024 11:59:59 PM CEST,20,30\n06/01/2024 12:00:00 AM CEST,21,30\n")
    rows = LogFollower(path, pytest.fail).poll()
    np.testing.assert_allclose(values_of(rows)[:, :2], [[0.0, 20.0], [1.0, 21.0]])


def test_a_parquet_log_is_taken_whole_when_it_is_there(tmp_path: Path) -> None:
    path = tmp_path / "temps.parquet"
    follower = LogFollower(path, pytest.fail)
    assert follower.poll() == []
    columns = {"time_s": [0.0, 0.25], "temp_a_c": [20.5, np.nan], "temp_b_c": [30.0, 30.5]}
    pd.DataFrame(columns).to_parquet(path)
    rows = follower.poll()
    np.testing.assert_array_equal(values_of(rows)[:, :3], np.column_stack(list(columns.values())))
    assert follower.header == "time_s,temp_a_c,temp_b_c"
    assert follower.poll() == []


def test_lines_that_are_no_rows_are_left_out_and_told_once(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    told: list[str] = []
    path.write_text("time_s,temp_a_c,temp_b_c\nrestart\n1,20,30\n2,error,30\n3\n", encoding="utf-8")
    follower = LogFollower(path, told.append)
    assert [row.numbers[0] for row in follower.poll()] == [1.0]
    assert follower.refused == 3
    assert len(told) == 1


def test_a_log_without_a_needed_column_is_named(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    path.write_text("time_s,temp_a_c\n1,20\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"temps\.csv.*'temp_b_c'"):
        LogFollower(path, lambda _words: None).poll()


@pytest.mark.parametrize("export", [logs.pico_6, logs.keysight_usb, logs.arduino, logs.numpy_text])
def test_a_log_of_an_instrument_is_followed_as_it_is_read_whole(tmp_path: Path, export: Any) -> None:
    path, copy = tmp_path / "temps.csv", tmp_path / "copy.csv"
    named = {"time": "Time", "a": "Chan 101", "b": "Chan 102"} if export is logs.keysight_usb else {}
    path.write_bytes(export())
    follower = LogFollower(path, lambda _words: None, chosen_columns(named))
    rows = follower.poll()
    copy.write_text("\n".join([follower.header, *(row.text for row in rows), ""]), encoding="utf-8")
    for written in (path, copy):
        log = read_temperature_log(written, columns=named).log
        np.testing.assert_allclose(
            values_of(rows)[:, :3], np.column_stack((log.time_s, log.temp_a_c, log.temp_b_c)), atol=1e-6
        )


def test_a_followed_log_with_units_in_a_row_goes_over_midnight(tmp_path: Path) -> None:
    path = tmp_path / "temps.csv"
    path.write_text(
        "logger 7\nTime;Temp A;Temp B\n;°F;°F\n05/06/2024 23:59:59;212;32\n06/06/2024 00:00:01;213,8;32\n",
        encoding="utf-8",
    )
    told: list[str] = []
    follower = LogFollower(path, told.append)
    np.testing.assert_allclose(values_of(follower.poll())[:, :3], [[0.0, 100.0, 0.0], [2.0, 101.0, 0.0]], atol=1e-9)
    assert follower.header == "Time;Temp A;Temp B\n;°F;°F"
    assert "temperature of spring A from 'Temp A'" in told[0]


def test_the_offset_is_that_of_the_row_that_came_with_the_least_delay() -> None:
    clock = LogClock(None)
    delays_s = [0.4, 0.05, 0.3, 0.2]
    for k, delay_s in enumerate(delays_s):
        clock.rows([(100.0 + k, 20.0, 30.0)], now_s=k + delay_s)
    assert clock.offset_s == pytest.approx(100.0 - min(delays_s))
    due = clock.due(2.0)
    assert [row[0] for _, row in due] == [100.0, 101.0]
    np.testing.assert_allclose([time_s for time_s, _ in due], [min(delays_s), 1.0 + min(delays_s)])


def test_a_given_offset_stays() -> None:
    clock = LogClock(7.0)
    clock.rows([(100.0, 20.0, 30.0)], now_s=0.0)
    assert clock.offset_s == 7.0
