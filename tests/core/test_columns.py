"""Records that are made in Python: what counts as a column, and values that no record can have."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from torsight.core import InputError, StickAngles, SyncedTable, TemperatureLog

N = 5
TIME_S = np.arange(N, dtype=np.float64)
ANGLE_RAD = np.array([0.0, 0.1, np.nan, 0.3, 0.4])
WARM_C = np.array([24.0, 30.0, 40.0, 50.0, 40.0])
TABLE = SyncedTable(TIME_S, ANGLE_RAD, np.full(N, 1e-3), WARM_C, np.full(N, 24.0), WARM_C > 35.0, WARM_C > 99.0)
LOG = TemperatureLog(TIME_S, WARM_C, np.full(N, 24.0))
ANGLES = StickAngles(np.arange(N), TIME_S, ANGLE_RAD, ANGLE_RAD, np.isfinite(ANGLE_RAD), np.ones(N, bool))


def as_list(column: Any) -> Any:
    return column.tolist()


def as_frame_column(column: Any) -> Any:
    # The middle rows of a larger frame: their labels do not begin with 0.
    return pd.DataFrame({"column": [column[0], *column, column[0]]})["column"].iloc[1:-1]


def as_nullable_column(column: Any) -> Any:
    return pd.Series(column).convert_dtypes()


@pytest.mark.parametrize("given_as", [as_list, as_frame_column, as_nullable_column])
@pytest.mark.parametrize("record", [TABLE, LOG, ANGLES], ids=lambda record: type(record).__name__)
def test_a_column_of_any_kind_is_the_array_of_its_numbers(record: Any, given_as: Any) -> None:
    columns = {name: getattr(record, name) for name in record.__dataclass_fields__}
    arrays = {name: column for name, column in columns.items() if isinstance(column, np.ndarray)}
    made = replace(record, **{name: given_as(column) for name, column in arrays.items()}, extra={"note": list("abcde")})
    for name, column in arrays.items():
        found = getattr(made, name)
        assert found.dtype == column.dtype
        assert not found.flags.writeable
        np.testing.assert_array_equal(found, column)
    assert made.to_frame()["note"].tolist() == list("abcde")
    made.plot()


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("time_s", TIME_S[::-1], "SyncedTable, row 1, time_s: time does not increase; found 3 after 4; "),
        ("time_s", [0.0, 1.0, 1.0, 2.0, 3.0], "row 2, time_s: time does not increase; found 1 after 1; "),
        ("time_s", [0.0, np.nan, 1.0, 2.0, 3.0], "row 1, time_s: time does not increase; found nan after 0; "),
        ("time_s", pd.date_range("2024-05-01", periods=N, freq="s"), "time_s: is no column of numbers; .* not dates"),
        ("time_s", 3.0, r"time_s: has not one value for every time; found shape \(\)"),
        ("angle_sigma_rad", [0.1, 0.1, -0.1, 0.1, 0.1], "row 2, angle_sigma_rad: is no standard deviation; found -0.1"),
        ("temp_a_c", list("abcde"), "temp_a_c: is no column of numbers; .* allowed float64"),
        ("temp_a_c", [24.0, object(), 1.0, 1.0, 1.0], "temp_a_c: is no column of numbers"),
        ("temp_a_c", WARM_C[:, None], r"temp_a_c: has not one value for every time; found shape \(5, 1\)"),
        ("heat_a", [0, 1, 2, 0, 0], "row 2: is no switch; found 2; allowed 0 or 1"),
        ("extra", {"room_c": [1.0]}, r"room_c: has not one value for every time; found shape \(1,\)"),
    ],
)
def test_a_column_that_no_record_can_have_is_refused_where_it_is_given(column: str, values: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(TABLE, **{column: values})


def test_a_record_without_rows_is_refused() -> None:
    with pytest.raises(InputError, match=r"TemperatureLog: has no rows; allowed at least one"):
        TemperatureLog(np.empty(0), np.empty(0), np.empty(0))


def test_a_frame_number_is_whole() -> None:
    with pytest.raises(InputError, match=r"StickAngles, frame, row 1: is no whole number; found 0\.5"):
        replace(ANGLES, frame=[0.0, 0.5, 1.0, 2.0, 3.0])
