"""Logs as text: delimiters, decimal signs, headers, and files that are none."""

import numpy as np
import pandas as pd
import pytest

from sync import read_temperature_log
from sync.log.column_names import resolve
from tests.sync.written_logs import kinds, ramp, written
from torsight.core.errors import InputError


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
    path.write_text("time_s;temp_a_c;temp_b_c\n" + "\n".join(f"{i + 1},250;24.5;23.5" for i in range(20)))
    with pytest.raises(InputError, match="thousands"):
        read_temperature_log(path)


@pytest.mark.parametrize("time", ["{i},250", "{i}", "31.05.2024 10:00:0{i},250", "{i}000,250"])
def test_three_decimals_of_a_temperature_are_no_thousands(tmp_path, time):
    # LabVIEW's "%.3f" where the decimal sign is a comma: no spring has 23,500 degrees.
    rows = "".join(f"{time.format(i=i)};2{i},125;23,500\n" for i in range(5))
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c\n" + rows)
    reading = read_temperature_log(tmp_path / "t.csv")
    assert reading.log.temp_a_c.tolist() == [20.125, 21.125, 22.125, 23.125, 24.125]
    assert np.diff(reading.log.time_s).tolist() == [1000.0 if time == "{i}000,250" else 1.0] * 4


def test_a_number_that_begins_with_zero_has_no_thousands(tmp_path):
    rows = "".join(f"0,{i}25;24.5;25.5\n" for i in range(5))
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c\n" + rows)
    assert read_temperature_log(tmp_path / "t.csv").log.time_s.tolist() == [0.025, 0.125, 0.225, 0.325, 0.425]


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
    lines = [f"{a}{b}{c} is no column\n" for a in letters for b in letters for c in letters[:5]]
    assert len(lines) > 3000
    path.write_text("".join(lines) + table)
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


def test_parquet_is_read_too(tmp_path):
    time_s, temp_a, temp_b = ramp(100)
    path = tmp_path / "temps.parquet"
    pd.DataFrame({"time_s": time_s, "temp_a_c": temp_a, "temp_b_c": temp_b}).to_parquet(path)
    np.testing.assert_allclose(read_temperature_log(path).log.temp_a_c, temp_a)


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
    rows = "0;24.5;25.5;1,5\n1;24.5;25.5;1,5\n2,125;24.5;25.5;1,5\n"
    (tmp_path / "t.csv").write_text("time_s;temp_a_c;temp_b_c;note\n" + rows)
    with pytest.raises(InputError, match=r"line 4.*found 2,125"):
        read_temperature_log(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("beginning", "do"),
    [(b"\x1f\x8b\x08\x00", "unpack"), (b"PK\x03\x04", "export"), (b"PAR1", "rename"), (b"%PDF-1.7", "export")],
)
def test_a_file_of_another_kind_is_named(tmp_path, beginning, do):
    (tmp_path / "t.csv").write_bytes(beginning + bytes(range(1, 256)))
    with pytest.raises(InputError, match=rf"is not text; found .*{do} it"):
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
