"""The tables of the contract, to and from their records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from torsight.core.errors import InputError
from torsight.core.files.tables import read_angles, read_merged, write_angles, write_merged
from torsight.core.records import ClockMap, SyncedTable, TemperatureLog
from torsight.core.tracks import MarkerTracks, StickAngles, marker_columns


def _angles(n: int = 40) -> StickAngles:
    rng = np.random.default_rng(11)
    valid = rng.uniform(size=n) > 0.2
    return StickAngles(
        frame=np.arange(n),
        time_s=np.cumsum(rng.uniform(0.01, 0.05, n)),
        angle_rad=np.where(valid, rng.normal(0.0, 7.0, n), np.nan),
        sigma_rad=np.where(valid, rng.uniform(1e-4, 1e-3, n), np.nan),
        valid=valid,
        branch_certain=rng.uniform(size=n) > 0.5,
    )


def test_angles_round_trip(tmp_path: Path) -> None:
    angles = _angles()
    write_angles(tmp_path / "angle.csv", angles)
    again = read_angles(tmp_path / "angle.csv")
    for name in ("frame", "time_s", "angle_rad", "sigma_rad", "valid", "branch_certain"):
        np.testing.assert_allclose(getattr(again, name), getattr(angles, name), rtol=1e-9)


def test_angles_keep_unknown_columns(tmp_path: Path) -> None:
    angles = replace(_angles(), extra={"light_v": np.arange(float(len(_angles())))})
    write_angles(tmp_path / "angle.csv", angles)
    np.testing.assert_allclose(read_angles(tmp_path / "angle.csv").extra["light_v"], angles.extra["light_v"])


@pytest.mark.parametrize(
    ("column", "value", "told"), [("heat_a", 2, "0 or 1"), ("angle_sigma_deg", -0.1, "0° or more")]
)
def test_values_that_cannot_be_name_row_and_column(tmp_path: Path, column: str, value: float, told: str) -> None:
    still = np.full(5, 21.0)
    write_merged(tmp_path / "merged.csv", SyncedTable(np.arange(5.0), still, still / 1e4, still, still, still < 0))
    table = pd.read_csv(tmp_path / "merged.csv").astype(float)
    table.loc[3, column] = value
    table.to_csv(tmp_path / "merged.csv", index=False)
    with pytest.raises(InputError, match=f"row 5, column {column}.*found {value:g}; allowed {told}"):
        read_merged(tmp_path / "merged.csv")


def test_merged_round_trip_keeps_unknown_columns(tmp_path: Path) -> None:
    time_s = np.arange(5.0)
    table = SyncedTable(
        time_s=time_s,
        angle_rad=np.linspace(3, -4, 5),
        angle_sigma_rad=np.full(5, 1e-3),
        temp_a_c=np.linspace(20, 70, 5),
        temp_b_c=np.full(5, 21.0),
        heat_a=time_s > 2,
        heat_b=time_s < 1,
        extra={"current_a_a": time_s * 0.1},
    )
    write_merged(tmp_path / "merged.parquet", table)
    again = read_merged(tmp_path / "merged.parquet")
    np.testing.assert_allclose(again.angle_rad, table.angle_rad, rtol=1e-12)
    assert again.heat_a is not None
    assert again.heat_a.tolist() == (time_s > 2).tolist()
    np.testing.assert_allclose(again.extra["current_a_a"], table.extra["current_a_a"])


@pytest.mark.parametrize("mark", [";", "\t"])
def test_tables_are_read_as_a_spreadsheet_writes_them(tmp_path: Path, mark: str) -> None:
    names = ["time_s", "angle_deg", "angle_sigma_deg", "temp_a_c", "temp_b_c", "note"]
    rows = [f"{time},5 -7,25 0,1 20,5 21 fine".split() for time in range(4)]
    (tmp_path / "merged.csv").write_text("\n".join(mark.join(row) for row in (names, *rows)))
    table = read_merged(tmp_path / "merged.csv")
    assert table.time_s.tolist() == [0.5, 1.5, 2.5, 3.5]
    np.testing.assert_allclose(table.angle_rad, np.radians(-7.25))
    assert table.extra["note"].tolist() == ["fine"] * 4


@pytest.mark.parametrize(
    ("times", "found"),
    [
        ("0\n1\n1\n", "row 4, column time_s: time does not increase; found 1 after 1"),
        ("0\n2\n1\n", "row 4, column time_s: time does not increase; found 1 after 2"),
        ("0\n\n2\n", "row 3, column time_s: time is missing; found an empty field after 0"),
    ],
)
def test_times_that_do_not_increase_name_the_row(tmp_path: Path, times: str, found: str) -> None:
    path = tmp_path / "merged.csv"
    rows = [f"{time},1,0.1,20,20" for time in times.split("\n")[:3]]
    path.write_text("time_s,angle_deg,angle_sigma_deg,temp_a_c,temp_b_c\n" + "\n".join(rows) + "\n")
    with pytest.raises(InputError, match=found):
        read_merged(path)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"temp_a_c": np.full(2, 23.0)}, r"TemperatureLog, temp_a_c: has not one value for every time; .*\(2,\)"),
        ({"heat_b": np.zeros(4, bool)}, r"TemperatureLog, heat_b: has not one value"),
        ({"extra": {"x": np.zeros((3, 2))}}, r"TemperatureLog, x: has not one value"),
        ({"temp_b_c": np.array([23.0, np.nan, 300.0])}, r"row 2, temp_b_c: .*found 300; allowed -273.15 to 250"),
    ],
)
def test_a_log_that_can_be_none_is_refused_where_it_is_made(change: dict[str, Any], told: str) -> None:
    good = {"time_s": np.arange(3.0), "temp_a_c": np.array([23.0, np.nan, 24.0]), "temp_b_c": np.full(3, 23.0)}
    assert len(TemperatureLog(**good)) == 3
    with pytest.raises(InputError, match=told):
        TemperatureLog(**{**good, **change})


def test_a_merged_table_has_columns_of_one_length() -> None:
    one = np.ones(3)
    with pytest.raises(InputError, match="SyncedTable, angle_rad: has not one value"):
        SyncedTable(np.arange(3.0), np.ones(2), one, one, one)


def test_marker_sigma_is_the_root_mean_variance() -> None:
    covariance = np.zeros((1, 4, 2, 2))
    covariance[0, 2] = [[0.09, 0.02], [0.02, 0.07]]
    tracks = MarkerTracks(
        frame=np.zeros(1, np.int64),
        time_s=np.zeros(1),
        position_px=np.zeros((1, 4, 2)),
        covariance_px2=covariance,
        valid=np.ones((1, 4), bool),
        size_px=(640, 480),
    )
    columns = marker_columns(tracks)
    assert columns["moving_inner_sigma_px"][0] == pytest.approx(np.sqrt(0.08))
    assert list(columns)[:2] == ["frame", "time_s"]
    with pytest.raises(ValueError, match="valid has shape"):
        MarkerTracks(
            frame=tracks.frame,
            time_s=tracks.time_s,
            position_px=tracks.position_px,
            covariance_px2=covariance,
            valid=np.ones((1, 3), bool),
            size_px=(640, 480),
        )


def test_the_clock_map_goes_both_ways() -> None:
    clock = ClockMap(-7.3, 40.0, (-8, -7), (0, 80), "given")
    film_s = np.array([0.0, 3600.0])
    log_s = clock.to_temperature_time(film_s)
    assert log_s[1] == pytest.approx(3600.0 * (1 + 40e-6) - 7.3)
    np.testing.assert_allclose(clock.to_film_time(log_s), film_s, atol=1e-9)
