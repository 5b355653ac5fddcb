"""Files are whole or not there, and say what is wrong with them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torsight.core.errors import ConfigError, InputError, OutputError
from torsight.core.files.storage import (
    atomic_path,
    check_keys,
    json_text,
    read_json,
    read_table,
    read_toml,
    write_json,
    write_table,
)


def test_a_needed_column_is_not_advised_to_be_renamed(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("time_s,angle_deg\n0,1\n")
    with pytest.raises(InputError, match=r"has no column 'angle_sigma_deg'; .*add the column"):
        read_table(tmp_path / "t.csv", required=("time_s", "angle_deg", "angle_sigma_deg"))
    with pytest.raises(InputError, match="rename 'angle_deg'"):
        read_table(tmp_path / "t.csv", required=("time_s", "angle_degs"))


def _die_half_way(path: Path) -> None:
    path.write_text("half of the ne")
    raise RuntimeError("killed")


def test_a_failed_write_leaves_the_older_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "angle.csv"
    target.write_text("old")
    with pytest.raises(RuntimeError, match="killed"), atomic_path(target) as temporary:
        _die_half_way(temporary)
    assert target.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["angle.csv"]


def _fill_the_disk(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/full")
    path.write_text("x" * 100_000)


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file where a folder is needed")
    with pytest.raises(OutputError, match=r"out/fit\.json: cannot be written .*earlier files are untouched"):
        write_json(tmp_path / "out" / "fit.json", {})


def test_what_a_killed_process_left_is_swept_away(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left = tmp_path / f".fit.{ended.pid}-abc.json"
    others = [
        tmp_path / f".fit.{os.getpid()}-abc.json",
        tmp_path / f".sync.{ended.pid}-abc.json",
        tmp_path / ".fit.json",
    ]
    for item in (left, *others):
        item.write_text("half of the ne")
    write_json(tmp_path / "fit.json", {})
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "fit.json", *others])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full to stand for a full disk")
def test_a_full_disk_is_told(tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    target.write_text("old")
    with pytest.raises(OutputError, match="No space left"), atomic_path(target) as temporary:
        _fill_the_disk(temporary)
    assert target.read_text() == "old"


def test_a_table_is_not_written_under_a_name_of_another_kind(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"has another suffix; found \.xlsx; allowed \.csv"):
        write_table(tmp_path / "t.xlsx", {"time_s": np.arange(3.0)})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_tables_come_back_as_they_were(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"table{suffix}"
    rng = np.random.default_rng(3)
    angle_deg = rng.normal(0.0, 400.0, 50)
    angle_deg[7] = np.nan
    write_table(path, {"frame": np.arange(50), "angle_deg": angle_deg, "valid": np.isfinite(angle_deg)})
    table = read_table(path, required=("frame", "angle_deg", "valid"))
    # ten significant digits
    np.testing.assert_allclose(table["angle_deg"], angle_deg, rtol=5e-10)
    assert table["valid"].tolist() == np.isfinite(angle_deg).astype(float).tolist()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no such file"),
        ("", "is empty"),
        ("time_s,angle_deg\n", "no rows"),
        ("time,angle_deg\n0,1\n", "no column 'time_s'.*rename 'time'"),
        ("time_s,angle_deg\n0,1\n1,none of it\n", "row 3, column angle_deg: is not a number; found 'none of it'"),
        ('time_s,angle_deg\n0,"1\n', "not a readable table"),
    ],
)
def test_a_bad_table_says_what_and_where(tmp_path: Path, text: str | None, words: str) -> None:
    path = tmp_path / "angle.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=words):
        read_table(path, required=("time_s", "angle_deg"))


def test_bytes_that_are_no_table(tmp_path: Path) -> None:
    for name in ("angle.csv", "angle.parquet"):
        path = tmp_path / name
        path.write_bytes(bytes(range(256)) * 4)
        with pytest.raises(InputError, match="not a readable table"):
            read_table(path, required=("time_s",))


def test_json_of_another_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text("{}")
    with pytest.raises(InputError, match="another schema; found no such key; allowed 1"):
        read_json(path)
    path.write_text('{"schema": 7}')
    with pytest.raises(InputError, match="another schema; found 7; allowed 1"):
        read_json(path)
    path.write_text("[" * 100_000)
    with pytest.raises(InputError, match="is not JSON"):
        read_json(path)


def test_numbers_that_are_not_finite_become_null() -> None:
    text = json_text({"a": np.float64("nan"), "b": [np.inf, np.int64(2)], "c": np.array([1.5, np.nan])})
    assert json.loads(text) == {"a": None, "b": [None, 2], "c": [1.5, None]}


def test_an_unknown_key_names_the_nearest() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'tempratur'.*did you mean 'temperature'"):
        check_keys({"tempratur": {}}, ("video", "temperature"), where="experiment.toml")


def test_the_nearest_key_is_found_whatever_the_case() -> None:
    with pytest.raises(ConfigError, match="did you mean 'E_A_gpa'"):
        check_keys({"e_a_gpa": 60.0}, ("E_S_gpa", "E_A_gpa"), where="actuator.toml")


def test_toml_errors_carry_the_line(tmp_path: Path) -> None:
    path = tmp_path / "actuator.toml"
    path.write_text("[geometry]\nwire = = 3\n")
    with pytest.raises(ConfigError, match="line 2"):
        read_toml(path)


@given(st.binary(max_size=400))
def test_any_bytes_as_a_table_end_in_an_error_or_a_table(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "t.csv"
    path.write_bytes(data)
    try:
        table = read_table(path, required=("time_s",))
    except InputError:
        return
    assert "time_s" in table.columns
