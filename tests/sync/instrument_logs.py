"""One short heating of spring A as the software of four instruments would export it."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np

TIME_S = np.arange(40) * 0.5
TEMP_A_C = np.round(24.0 + 1.25 * np.maximum(0.0, TIME_S - 5.0), 2)
TEMP_B_C = np.round(24.0 + 0.05 * TIME_S, 2)
BEGAN = datetime(2024, 5, 14, 10, 21, 33, 250000)  # noqa: DTZ001 - instruments stamp with the wall clock


def _rows(form) -> list[str]:
    return [form(*row) for row in zip(TIME_S.tolist(), TEMP_A_C.tolist(), TEMP_B_C.tolist(), strict=True)]


def _at(time_s: float) -> datetime:
    return BEGAN + timedelta(seconds=time_s)


def _american(time_s: float) -> str:
    return f"{_at(time_s):%m/%d/%Y %H:%M:%S}:{_at(time_s).microsecond // 1000:03d}"


def pico_6() -> bytes:
    """PicoLog 6: a first column without a name, ISO dates with the zone, quoted names with statistic and unit."""
    rows = _rows(lambda t, a, b: f"{_at(t).isoformat(timespec='milliseconds')}+01:00,{a:.2f},{b:.2f}")
    return "\r\n".join([',"Temp A Last (C)","Temp B Last (C)"', *rows, ""]).encode()


def pico_6_elapsed() -> bytes:
    """PicoLog 6 with elapsed times: a first column without a name, in seconds."""
    rows = _rows(lambda t, a, b: f"{t:.3f},{a:.2f},{b:.2f}")
    return "\r\n".join([',"Temp A Ave. (°C)","Temp B Ave. (°C)"', *rows, ""]).encode()


def pico_6_numbered() -> bytes:
    """PicoLog 6 gone through a table library, which puts the number of the row before each."""
    rows = [
        f"{number},{t:.3f},{a:.2f},{b:.2f}"
        for number, (t, a, b) in enumerate(zip(TIME_S, TEMP_A_C, TEMP_B_C, strict=True))
    ]
    return "\n".join([",Time (s),Temp A Ave. (°C),Temp B Ave. (°C)", *rows, ""]).encode()


def pico_5() -> bytes:
    """PicoLog 5 in a country with decimal commas: a row of units below the names, tabs between."""
    rows = _rows(lambda t, a, b: f"{1000 * t:.0f}\t{a:.2f}\t{b:.2f}".replace(".", ","))
    return "\r\n".join(["Time\tTemp A\tTemp B", "ms\t°C\t°C", *rows, ""]).encode("latin-1")


def keysight_usb() -> bytes:
    """DAQ970A, file dat00001.csv: sweeps, dates in American order with a third colon before the milliseconds."""
    rows = [
        f"{number},{_american(t)},{a:.8f},{b:.8f}"
        for number, (t, a, b) in enumerate(zip(TIME_S, TEMP_A_C, TEMP_B_C, strict=True), 1)
    ]
    return "\r\n".join(["Sweep #,Time,Chan 101 (C),Chan 102 (C)", *rows, ""]).encode()


def keysight_benchlink() -> bytes:
    """BenchLink Data Logger: UTF-16, a preamble with a table of channels, an alarm column behind each channel, °F."""
    head = [
        "Name:,Rig 3",
        "Owner:,lab",
        "Comments:,",
        "Acquisition Date:,5/14/2024 10:21:33 AM",
        "Total Channels:,2",
        ",Channel,Name,Function,Range,Resolution,Advanced Settings,Scale,Gain,Offset,Label",
        ",101,Temp A,Temp (Type K),,F,,False,1,0,F",
        ",102,Temp B,Temp (Type K),,F,,False,1,0,F",
        "Scan Control:,",
        "Start Action:,Immediately",
        "",
        "Scan,Time,101 <Temp A> (F),Alarm 101,102 <Temp B> (F),Alarm 102",
    ]
    rows = [
        f"{number},{_american(t)},{1.8 * a + 32:.4f},0,{1.8 * b + 32:.4f},0"
        for number, (t, a, b) in enumerate(zip(TIME_S, TEMP_A_C, TEMP_B_C, strict=True), 1)
    ]
    return "\r\n".join([*head, *rows, ""]).encode("utf-16")


def arduino() -> bytes:
    """Arduino: a broken line from before the reset, a greeting, the header, rows with millis()."""
    rows = _rows(lambda t, a, b: f"{1000 * t:.0f},{a:.2f},{b:.2f}")
    return "\r\n".join(["3.9", "MAX31855 ready", "millis,tempA,tempB", *rows, ""]).encode()


def arduino_monitor() -> bytes:
    """Arduino's serial monitor with "show timestamp" switched on; the sketch prints temperatures alone."""
    lines = ["thermistors ready", "T_A\tT_B", *_rows(lambda _t, a, b: f"{a:.2f}\t{b:.2f}")]
    times = [-1.0, -0.5, *TIME_S]
    stamped = [
        f"{_at(t):%H:%M:%S}.{_at(t).microsecond // 1000:03d} -> {line}" for t, line in zip(times, lines, strict=True)
    ]
    return "\n".join([*stamped, ""]).encode()


def labview(*, unit: str = "deg C", with_times: bool = True) -> bytes:
    """LabVIEW measurement file: two headers, tabs, decimal commas, a column for comments that hardly any row has."""
    fahrenheit = unit == "deg F"
    head = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t,",
        "Multi_Headings\tNo",
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        "Operator\tlab",
        "Date\t2024/05/14",
        "Time\t10:21:33,25",
        "***End_of_Header***\t",
        "\t",
        "Channels\t2\t\t\t",
        "Samples\t40\t40\t\t",
        "Date\t2024/05/14\t2024/05/14\t\t",
        "Time\t10:21:33,25\t10:21:33,25\t\t",
        f"Y_Unit_Label\t{unit}\t{unit}\t\t",
        "X_Dimension\tTime\tTime\t\t",
        "X0\t0,0000000000000000E+0\t0,0000000000000000E+0\t\t",
        "Delta_X\t0,500000\t0,500000\t\t",
        "***End_of_Header***\t\t\t\t",
        "X_Value\tTemperature_A\tTemperature_B\tComment",
    ]
    show = (lambda c: f"{1.8 * c + 32.0:.3f}") if fahrenheit else (lambda c: f"{c:.3f}")
    rows = _rows(lambda t, a, b: f"{f'{t:.6f}' if with_times else ''}\t{show(a)}\t{show(b)}".replace(".", ","))
    rows[0] += "\tbegin"
    return "\r\n".join([*head, *rows, ""]).encode()


def numpy_text() -> bytes:
    """``numpy.savetxt`` with a header: blanks between, the names behind the mark of a comment."""
    rows = _rows(lambda t, a, b: f"{t:.18e} {a:.18e} {b:.18e}")
    return "\n".join(["# time_s temp_a_c temp_b_c", *rows, ""]).encode()
