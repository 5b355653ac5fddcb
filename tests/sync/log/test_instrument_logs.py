"""Logs as instruments write them: header after a preamble, columns by name, units and stamps of every kind."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from sync import read_temperature_log
from tests.sync import instrument_logs as logs
from torsight.core.errors import ConfigError, InputError

CHANNELS = {"time": "Time", "a": "Chan 101", "b": "Chan 102"}


def read(folder, content, **said):
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_temperature_log(path, **said)


def made_up(header, rows=30, *, sep=",", line=lambda i: [f"{0.5 * i:g}", f"{24 + 0.5 * i:g}", "24.5"]):
    return "\n".join([header, *(sep.join(line(i)) for i in range(rows)), ""])


@pytest.mark.parametrize(
    ("export", "columns", "within_c"),
    [
        (logs.pico_6, None, 1e-9),
        (logs.pico_6_elapsed, None, 1e-9),
        (logs.pico_6_numbered, None, 1e-9),
        (logs.pico_5, None, 1e-9),
        (logs.keysight_usb, CHANNELS, 1e-9),
        # Written to 0.0001 °F.
        (logs.keysight_benchlink, None, 0.5e-4 * 5 / 9 + 1e-9),
        (logs.arduino, None, 1e-9),
        (logs.arduino_monitor, None, 1e-9),
        (logs.labview, None, 1e-9),
        (lambda: logs.labview(with_times=False), None, 1e-9),
        # Written to 0.001 °F.
        (lambda: logs.labview(unit="deg F"), None, 0.5e-3 * 5 / 9 + 1e-9),
        (logs.numpy_text, None, 1e-9),
    ],
)
def test_exports_of_instruments_give_the_same_log(tmp_path, export, columns, within_c):
    reading = read(tmp_path, export(), columns=columns)
    log = reading.log
    np.testing.assert_allclose(log.time_s - log.time_s[0], logs.TIME_S, atol=1e-6)
    np.testing.assert_allclose(log.temp_a_c, logs.TEMP_A_C, rtol=0, atol=within_c)
    np.testing.assert_allclose(log.temp_b_c, logs.TEMP_B_C, rtol=0, atol=within_c)
    assert {repair.kind for repair in reading.repairs} <= {
        "preamble",
        "units",
        "decimal_comma",
        "encoding",
        "arrival",
        "times",
    }


def test_what_was_guessed_and_converted_is_said(tmp_path):
    (note,) = read(tmp_path, logs.keysight_benchlink()).notes[:1]
    assert "'101 <Temp A> (F)', °F converted" in note
    assert "guessed" in note
    reading = read(tmp_path, logs.arduino())
    assert {role: column.to_json() for role, column in reading.columns.items()} == {
        "time": {"name": "millis", "unit": "ms", "guessed": True},
        "a": {"name": "tempA", "unit": None, "guessed": True},
        "b": {"name": "tempB", "unit": None, "guessed": True},
    }
    assert read(tmp_path, logs.keysight_usb(), columns=CHANNELS).notes == ()
    assert read(tmp_path, logs.numpy_text()).notes == ()


def test_a_first_column_without_a_name_is_the_time_unless_it_counts_the_rows(tmp_path):
    assert "taken as seconds" in read(tmp_path, logs.pico_6_elapsed()).notes[0]
    counted = made_up(",Temp A,Temp B", line=lambda i: [f"{i}", f"{24 + 0.5 * i:g}", "24.5"])
    with pytest.raises(InputError, match=r"no column 'time_s'.*counts the rows.*--units time=s"):
        read(tmp_path, counted)
    assert read(tmp_path, counted, units={"time": "s"}).log.time_s[-1] == 29.0


def test_wall_clock_stamps_say_when_the_log_began(tmp_path):
    assert read(tmp_path, logs.keysight_usb(), columns=CHANNELS).zero == "2024-05-14T10:21:33.250000"


def test_channels_by_number_are_not_guessed(tmp_path):
    with pytest.raises(InputError, match=r'no column \'temp_a_c\'.*Chan 101.*--columns "time=NAME,a=NAME,b=NAME"'):
        read(tmp_path, logs.keysight_usb())


def test_names_are_found_in_another_spelling(tmp_path):
    content = made_up("Time;Temp A (°C);Temp B (°C)", sep=";")
    for name in ("Temp A (°C)", "temp a (C)", "TEMP  A"):
        assert read(tmp_path, content, columns={"a": name}).columns["a"].name == "Temp A (°C)"


@pytest.mark.parametrize(
    ("unit", "factor"), [("ms", 1e3), ("µs", 1e6), ("s", 1.0), ("min", 1 / 60), ("h", 1 / 3600), ("days", 1 / 86400)]
)
def test_times_in_other_units(tmp_path, unit, factor):
    content = made_up(
        f"Elapsed ({unit}),a,b", line=lambda i: [repr(0.5 * i * factor), f"{24 + 0.5 * i:g}", f"{24 + 0.1 * i:g}"]
    )
    # Fifteen digits of a day's fraction: far below a microsecond.
    np.testing.assert_allclose(read(tmp_path, content).log.time_s, 0.5 * np.arange(30), atol=1e-9)


@pytest.mark.parametrize(("unit", "convert"), [("K", lambda c: c + 273.15), ("°F", lambda c: 1.8 * c + 32.0)])
def test_temperatures_in_other_units(tmp_path, unit, convert):
    line = lambda i: [f"{0.5 * i:g}", f"{convert(24 + 0.5 * i):.9f}", f"{convert(24.5):.9f}"]  # noqa: E731
    headed = read(tmp_path, made_up(f"Time,Temp A ({unit}),Temp B ({unit})", line=line))
    told = read(tmp_path, made_up("Time,Temp A,Temp B", line=line), units={"a": unit, "b": unit})
    for reading in (headed, told):
        np.testing.assert_allclose(reading.log.temp_a_c, 24 + 0.5 * np.arange(30), atol=1e-8)


@pytest.mark.parametrize(
    ("form", "second"),
    [
        ("{:02d}/05/2024 23:59:{:02d}", "06/05/2024 00:00:{:02d}"),
        ("05/{:02d}/2024 23:59:{:02d}", "05/06/2024 00:00:{:02d}"),
        ("{:02d}.05.2024 23:59:{:02d}", "06.05.2024 00:00:{:02d}"),
        ("2024/05/{:02d} 23:59:{:02d}", "2024/05/06 00:00:{:02d}"),
        ("{:02d}-May-2024 23:59:{:02d}", "06-May-2024 00:00:{:02d}"),
        ("{:02d}/05/24 11:59:{:02d} PM", "06/05/24 12:00:{:02d} AM"),
    ],
)
def test_dates_over_midnight_in_every_order(tmp_path, form, second):
    stamps = [form.format(5, 40 + i) if i < 20 else second.format(i - 20) for i in range(40)]
    line = lambda i: [stamps[i], f"{24 + 0.5 * i:g}", "24.5"]  # noqa: E731
    reading = read(tmp_path, made_up("Time;Temp A;Temp B", 40, sep=";", line=line))
    np.testing.assert_allclose(reading.log.time_s, np.arange(40.0), atol=1e-9)


def test_a_date_and_a_time_of_day_in_columns_of_their_own(tmp_path):
    line = lambda i: ["14/05/2024", f"10:21:{i:02d}", f"{24 + 0.5 * i:g}", "24.5"]  # noqa: E731
    guessed = read(tmp_path, made_up("Date,Time,Temp A,Temp B", line=line))
    named = read(tmp_path, made_up("Day,Clock,Temp A,Temp B", line=line), columns={"date": "Day", "time": "Clock"})
    for reading in (guessed, named):
        np.testing.assert_allclose(reading.log.time_s, np.arange(30.0))
        assert reading.zero == "2024-05-14T10:21:00.000000"


def test_times_of_day_go_on_over_midnight(tmp_path):
    line = lambda i: [f"23:59:{50 + i}" if i < 10 else f"00:00:{i - 10:02d}", f"{24 + 0.5 * i:g}", "24.5"]  # noqa: E731
    log = read(tmp_path, made_up("Time,Temp A,Temp B", line=line)).log
    np.testing.assert_allclose(log.time_s - log.time_s[0], np.arange(30.0))


def test_heating_switches_are_guessed_and_mapped(tmp_path):
    line = lambda i: [f"{i}", f"{24 + 0.5 * i:g}", "24.5", "ON" if i > 9 else "OFF", f"{i % 2}"]  # noqa: E731
    content = made_up("Time,Temp A,Temp B,Heater A,K2", line=line)
    log = read(tmp_path, content, columns={"heat_b": "K2"}).log
    np.testing.assert_array_equal(log.heat_a, np.arange(30) > 9)
    np.testing.assert_array_equal(log.heat_b, np.arange(30) % 2 == 1)


@pytest.mark.parametrize(
    ("header", "said", "message"),
    [
        ("Time,Temp A,Temp B", {"columns": {"a": "Tempe A"}}, "no column 'Tempe A'.*did you mean 'Temp A'"),
        # Chan 102, in whatever spelling, is B's already.
        (
            "Time,Chan 101 (C),Chan 102 (C)",
            {"columns": {"a": "Chan 10", "b": "Chan 102"}},
            r"no column 'Chan 10'.*did you mean 'Chan 101 \(C\)'",
        ),
        ("Time,Temp A,Temp B", {"columns": {"heat_a": "heater"}}, "no column 'heater'.*name a column of the header"),
        ("Time,Temp A,Temp A", {}, "'Temp A'|two columns have one name"),
        ("Time,T1,T1", {"columns": {"a": "T1", "b": "T2"}}, "two columns have one name.*'T1'"),
        ("Time,Temp A (ms),Temp B", {"columns": {"a": "Temp A (ms)"}}, "in ms, and that is no unit of the temperature"),
        ("Time (°C),Temp A,Temp B", {"columns": {"time": "Time (°C)"}}, "in °C, and that is no unit of the time"),
        ("Time,Temp A (mV),Temp B", {"columns": {"a": "Temp A (mV)"}}, "in mv, and that is no unit"),
        ("Time,Temp A (°F),Temp B", {"units": {"a": "°C"}}, "said to be in °F and in °C"),
        ("Time (ms),Temp A,Temp B", {"units": {"time": "s"}}, "said to be in ms and in s"),
        ("time_s,temp_a_c (K),temp_b_c", {}, "said to be in °C and in K"),
        ("time_s (ms),temp_a_c,temp_b_c", {}, "'time_s .ms.' is said to be in s and in ms"),
        # Parted by blanks, these would name all three: time, A and B.
        ("Time (s),Temp A (ms),Temp B (°C)", {}, "no column 'temp_a_c'"),
        ("time_s,temp_a_c", {}, "no column 'temp_b_c'; found time_s, temp_a_c; say which columns"),
        ("Time (K),Temp A (ms),Temp B (K)", {}, "'Time .K.' is in K, and that is no unit of the time"),
        ("Time,Temp A Last,Temp A Ave.,Temp B", {}, "more than one column may be the temperature of spring A"),
    ],
)
def test_headers_that_cannot_be_used(tmp_path, header, said, message):
    with pytest.raises(InputError, match=message) as caught:
        read(
            tmp_path,
            made_up(header, line=lambda i: [f"{i}", f"{24 + 0.5 * i:g}", "24.5", "24.5"][: header.count(",") + 1]),
            **said,
        )
    assert "line 1" in str(caught.value)


def test_a_row_of_units_that_contradicts_the_names(tmp_path):
    with pytest.raises(InputError, match=r"line 2.*'temp_a_c' is said to be in °C and in °F"):
        read(tmp_path, made_up("time_s,temp_a_c,temp_b_c\ns,°F,°F"))


def test_kelvin_without_a_word_of_it_is_refused(tmp_path):
    line = lambda i: [f"{i}", f"{297 + 0.5 * i:g}", "297.5"]  # noqa: E731
    with pytest.raises(InputError, match=r"column Temp A: .*not in kelvin.*--units"):
        read(tmp_path, made_up("Time,Temp A,Temp B", line=line))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("Time (s),Chan 101,Chan 102 (K)", r"column Chan 102 \(K\): holds no temperature.*where the header does not"),
        ("Clock (ms),Chan 101,Chan 102", r"column Clock \(ms\): is too short for a heating"),
    ],
)
def test_what_a_header_says_wrongly_is_told_by_the_files_own_names(tmp_path, header, message):
    time, a, b = header.split(",")
    with pytest.raises(InputError, match=message):
        read(tmp_path, made_up(header), columns={"time": time, "a": a, "b": b})


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"columns": {"tmie": "Time"}}, "unknown key 'tmie'.*did you mean 'time'"),
        ({"columns": {"a": "T", "b": "T"}}, "'a' and 'b' name one column"),
        ({"columns": {"a": 3}}, "'a' names no column"),
        ({"units": {"time": "°C"}}, "unit of 'time' is not known.*allowed s, ms"),
        ({"units": {"a": "furlong"}}, "unit of 'a' is not known.*°C, °F, K"),
    ],
)
def test_wrong_words_on_columns(tmp_path, said, message):
    with pytest.raises(ConfigError, match=message):
        read(tmp_path, made_up("Time,Temp A,Temp B"), **said)


def stamped(form, *, began=logs.BEGAN, step_s=10.0, rows=40, head="time,temp_a_c,temp_b_c"):
    """Return a log whose timestamps are written in a form; its rows are ``step_s`` apart."""
    times = [began + timedelta(seconds=step_s * i) for i in range(rows)]
    return "\n".join([head, *(f"{form(at)},{24 + 0.5 * i:g},24.5" for i, at in enumerate(times)), ""])


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%d %H:%M:%S UTC",
        "%Y-%m-%dT%H:%M:%S GMT",
        "%H:%M:%SZ",
        "%m/%d/%Y %H:%M:%S CEST",
        "%Y-%m-%d %H:%M:%S (UTC+2)",
        "%d.%m.%Y %H:%M:%S Europe/Berlin",
        "%m/%d/%Y %I:%M:%S %p",
        "%d-%b-%Y %I:%M:%S %p",
        "%a %b %d %H:%M:%S %Y",
        "%a %d %b %Y %H:%M:%S GMT",
        "%y-%m-%d %H:%M:%S",
    ],
)
def test_stamps_past_midnight_in_many_forms(tmp_path, form):
    # Ten o'clock to midnight and on to the next day: AM, PM and the date change.
    began = datetime(2024, 5, 14, 23, 57)  # noqa: DTZ001
    log = read(tmp_path, stamped(lambda at: at.strftime(form), began=began)).log
    np.testing.assert_allclose(log.time_s - log.time_s[0], 10.0 * np.arange(40))


def test_minutes_and_seconds_are_read_where_nothing_else_is_possible(tmp_path):
    began = datetime(2024, 5, 14, 9, 57)  # noqa: DTZ001
    log = read(tmp_path, stamped(lambda at: f"{at:%M:%S}.0", began=began)).log
    np.testing.assert_allclose(np.diff(log.time_s), 10.0)
    with pytest.raises(InputError, match=r"line 2: may be hours and minutes or minutes and seconds; found '00:00'"):
        read(tmp_path, stamped(lambda at: f"{at:%M:%S}", began=datetime(2024, 5, 14)))  # noqa: DTZ001
    with pytest.raises(InputError, match=r"more than one time zone.*CEST, CET"):
        read(tmp_path, stamped(lambda at: f"{at:%H:%M:%S} {'CEST' if at.minute < 24 else 'CET'}"))


def test_stamps_in_whole_minutes_are_spread_though_the_log_begins_within_one(tmp_path):
    began = datetime(2024, 5, 14, 9, 21, 40)  # noqa: DTZ001
    log = read(tmp_path, stamped(lambda at: f"{at:%d.%m.%Y %H:%M}", began=began)).log
    # Ten seconds apart, six in a minute; the first minute holds its last twenty seconds.
    np.testing.assert_allclose(log.time_s, 40.0 + 10.0 * np.arange(40))


@pytest.mark.parametrize("head", ["time,temp_a_c,temp_b_c", "Date/Time,Temp A (C),Temp B (C)"])
def test_dates_as_spreadsheets_number_them(tmp_path, head):
    origin = datetime(1899, 12, 30)  # noqa: DTZ001
    content = stamped(lambda at: f"{(at - origin) / timedelta(days=1):.10f}", head=head)
    reading = read(tmp_path, content)
    # A tenth decimal of a day is 9 µs.
    np.testing.assert_allclose(reading.log.time_s, 10.0 * np.arange(40), atol=1e-5)
    assert reading.zero == "2024-05-14T10:21:33.250"
    assert any("spreadsheet" in note for note in reading.notes)


def test_durations_with_units(tmp_path):
    began = logs.BEGAN
    for form in ("0 days 00:{at:%M:%S}.25", "PT{s:.3f}S", "{s:.3f} s"):
        content = stamped(lambda at, form=form: form.format(at=at, s=(at - began).total_seconds()))
        np.testing.assert_allclose(np.diff(read(tmp_path, content).log.time_s), 10.0)


def test_dates_whose_order_is_open_are_noted(tmp_path):
    began = datetime(2024, 5, 6, 10)  # noqa: DTZ001
    notes = read(tmp_path, stamped(lambda at: f"{at:%d/%m/%Y %H:%M:%S}", began=began)).notes
    assert any("read as day, month, year; month, day, year" in note for note in notes)
    past = stamped(lambda at: f"{at:%m/%d/%Y %H:%M:%S}", began=datetime(2024, 5, 6, 23, 58))  # noqa: DTZ001
    assert any("read as month, day, year; day, month, year" in note for note in read(tmp_path, past).notes)


def test_units_in_brackets_below_the_header(tmp_path):
    rows = "".join(f"{500 * i},{297.15 + i},297.15\n" for i in range(30))
    log = read(tmp_path, f"time,temp_a,temp_b\n[ms],[K],(K)\n{rows}").log
    assert log.time_s[:3].tolist() == [0.0, 0.5, 1.0]
    assert log.temp_a_c[:2] == pytest.approx([24.0, 25.0])


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark(tmp_path, encoding):
    reading = read(tmp_path, made_up("Time (s),Temp A (°C),Temp B (°C)").encode(encoding))
    assert reading.log.temp_a_c[1] == 24.5
    assert [repair.text for repair in reading.repairs] == ["the file is UTF-16 without a byte order mark; read as such"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            lambda i: [f"{0.5 * i:g}", f"{240 + 5 * i}", "245"],
            r"holds no temperature.*found 315 in the middle",
        ),
        (lambda i: [f"{0.5 * i:g}", f"{24 + i} °C", "24.5"], r"temp_a_c: holds no temperature.*no number but '24 °C'"),
    ],
)
def test_readings_that_are_no_degrees_are_refused_with_what_was_found(tmp_path, line, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, made_up("time_s,temp_a_c,temp_b_c", line=line))


def test_numbers_without_a_header_are_told(tmp_path):
    with pytest.raises(InputError, match=r"has no header; found 0, 24, 24.5; write a line like 'time_s,temp_a_c"):
        read(tmp_path, made_up("0,24,24.5"))


def test_a_switch_that_is_on_throughout_is_told(tmp_path):
    content = made_up("time_s,temp_a_c,temp_b_c,heat_a", line=lambda i: [f"{i}", f"{24 + i}", "24.5", "1"])
    assert [one.text for one in read(tmp_path, content).repairs] == [
        "heat_a is 1 in every row: a switch that never changes says nothing about the time"
    ]
