"""The command: files, keys and exit codes of the contract."""

import json
import re

import numpy as np
import pandas as pd
import pytest

from tests.command_line import leave
from tests.sync.made_up_pairs import Rig, make_pair, programme
from torsight.cli.sync import sync_to_folder
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.tables import read_merged

OFFSET_S = 7.3


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    cycles = programme(5, rates=(1.2, 3.0), hold=(1.0, 5.0), rest_s=40.0, half_cycles=6)
    rig = Rig(cooling_s=8.0, temp_noise_c=0.05)
    made = make_pair(5, rig=rig, cycles=cycles, film_fps=15.0, log_step_s=0.05, offset_s=OFFSET_S)
    pd.DataFrame(
        {
            "frame": np.arange(len(made.film_s)),
            "time_s": made.film_s,
            "angle_deg": made.angle_deg,
            "angle_sigma_deg": 0.06,
            "valid": 1,
        }
    ).to_csv(folder / "angle.csv", index=False)
    pd.DataFrame(
        {
            "time_s": made.log_s,
            "temp_a_c": made.temp_a_c,
            "temp_b_c": made.temp_b_c,
            "heat_a": made.heat_a.astype(int),
            "heat_b": made.heat_b.astype(int),
            "room_c": 24.0,
        }
    ).to_csv(folder / "temps.csv", index=False)
    return folder


def run(pair, out, **settings):
    return sync_to_folder(pair / "angle.csv", pair / "temps.csv", settings=settings, out=out)


GIVEN = {"offset_s": OFFSET_S, "drift_ppm": 0.0}


@pytest.fixture(scope="module")
def found(pair, tmp_path_factory):
    """Return what the command leaves where it finds the clock, once for all tests that read it."""
    run(pair, folder := tmp_path_factory.mktemp("found"))
    return folder


@pytest.fixture(scope="module")
def given(pair, tmp_path_factory):
    """Return what it leaves where the clock is given."""
    run(pair, folder := tmp_path_factory.mktemp("given"), **GIVEN)
    return folder


@pytest.mark.parametrize(
    ("column", "damage", "said"),
    [
        ("angle_deg", lambda deg: (deg + 180.0) % 360.0 - 180.0, r"folded into one turn.*a step of 3[56]\d°"),
        ("time_s", lambda time_s: time_s / 60.0, r"in minutes.*times 60 times as large they fit"),
    ],
)
def test_angles_and_film_times_in_another_unit_are_refused(pair, tmp_path, column, damage, said):
    table = pd.read_csv(pair / "angle.csv")
    table[column] = damage(table[column])
    table.to_csv(tmp_path / "angle.csv", index=False)
    with pytest.raises(InputError, match=said):
        sync_to_folder(tmp_path / "angle.csv", pair / "temps.csv", settings={}, out=tmp_path / "out")


def as_an_instrument_writes_it(pair, path):
    """Write the log in other words and units: a preamble, channels by number, milliseconds, °F."""
    log = pd.read_csv(pair / "temps.csv")
    channels = pd.DataFrame(
        {
            "Time (ms)": 1e3 * log["time_s"],
            **{f"Chan 10{n} (F)": 1.8 * log[f"temp_{s}_c"] + 32.0 for n, s in ((1, "a"), (2, "b"))},
        }
    )
    path.write_text(f"Unit 7\n\n{channels.to_csv(index=False)}", encoding="utf-8")


def test_columns_by_name_give_the_same_table(pair, given, tmp_path, capfd):
    as_an_instrument_writes_it(pair, tmp_path / "log.csv")
    words = ["sync", "--angle", pair / "angle.csv", "--offset", OFFSET_S, "--drift-ppm", 0, "--temperature"]
    named = ["--columns", "time=Time,a=Chan 101,b=Chan 102 (F)"]
    assert leave(*words, tmp_path / "log.csv", *named, "--out", tmp_path / "named") == 0
    said = capfd.readouterr().err
    assert "temperature of spring A from 'Chan 101 (F)', °F converted" in said
    plain, other = (read_merged(folder / "merged.csv") for folder in (given, tmp_path / "named"))
    np.testing.assert_allclose(other.temp_a_c, plain.temp_a_c, atol=1e-6)
    np.testing.assert_allclose(other.temp_b_c, plain.temp_b_c, atol=1e-6)
    content = json.loads((tmp_path / "named" / "sync.json").read_text())
    assert content["log"]["columns"]["b"] == {"name": "Chan 102 (F)", "unit": "°F", "guessed": False}
    assert any("converted" in note for note in content["notes"])


@pytest.mark.parametrize(
    ("named", "code", "message"),
    [
        ("time=Time,a=Chan 101,b=Chan 103", 3, "no column 'Chan 103'.*did you mean 'Chan 102 (F)'"),
        ("time=Time,a=Chan 101,a=Chan 102", 2, "is no list of columns"),
        ("time=Time,c=Chan 101", 2, "unknown key 'c'"),
        ("Time,Chan 101", 2, "is no list of columns.*found 'Time,Chan 101'"),
    ],
)
def test_columns_that_are_not_there(pair, tmp_path, capfd, named, code, message):
    as_an_instrument_writes_it(pair, tmp_path / "log.csv")
    files = ["--angle", pair / "angle.csv", "--temperature", tmp_path / "log.csv", "--out", tmp_path / "out"]
    assert leave("sync", *files, "--columns", named) == code
    assert re.search(message.replace("(F)", r"\(F\)"), capfd.readouterr().err)


def test_outputs_as_in_the_contract(pair, found):
    content = json.loads((found / "sync.json").read_text())
    assert content["schema"] == 1
    for key in ("offset_s", "drift_ppm"):
        low, high = content[key]["ci95"]
        assert low <= content[key]["value"] <= high
    assert content["offset_s"]["value"] == pytest.approx(OFFSET_S, abs=0.5)
    assert isinstance(content["method"], str)
    header = (found / "merged.csv").read_text().splitlines()[0].split(",")
    assert header == ["time_s", "angle_deg", "angle_sigma_deg", "temp_a_c", "temp_b_c", "heat_a", "heat_b", "room_c"]
    table = read_merged(found / "merged.csv")
    assert len(table) == len(pd.read_csv(pair / "angle.csv"))


def test_same_input_same_answer(pair, found, tmp_path):
    table = run(pair, tmp_path)
    np.testing.assert_allclose(table.temp_a_c, read_merged(tmp_path / "merged.csv").temp_a_c, atol=1e-9)
    for file in ("merged.csv", "sync.json"):
        assert (tmp_path / file).read_bytes() == (found / file).read_bytes()


def test_given_offset_places_the_temperatures(pair, given):
    table = read_merged(given / "merged.csv")
    log = pd.read_csv(pair / "temps.csv")
    expected = np.interp(table.time_s + OFFSET_S, log["time_s"], log["temp_a_c"])
    known = np.isfinite(table.temp_a_c)
    assert known.mean() > 0.99
    np.testing.assert_allclose(table.temp_a_c[known], expected[known], atol=1e-9)


def test_a_light_is_the_method_when_it_is_given(pair, tmp_path):
    log = pd.read_csv(pair / "temps.csv")
    on = (log["heat_a"] + log["heat_b"]).to_numpy() > 0
    at = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    frames = pd.read_csv(pair / "angle.csv")["time_s"].to_numpy()
    times = log["time_s"].to_numpy()[at] - OFFSET_S
    seen = frames[np.searchsorted(frames, times[times > frames[1]])]
    pd.DataFrame({"time_s": seen}).to_csv(tmp_path / "light.csv", index=False)
    run(pair, tmp_path, led_events=str(tmp_path / "light.csv"))
    content = json.loads((tmp_path / "sync.json").read_text())
    assert content["method"].startswith("shared event")
    # One frame and one row: the event lies in both intervals, whatever their phase.
    assert content["offset_s"]["value"] == pytest.approx(OFFSET_S, abs=1.0 / 15.0 + 0.05)


def test_unknown_setting_names_the_nearest(pair, tmp_path):
    with pytest.raises(ConfigError, match="offset_s") as caught:
        run(pair, tmp_path, ofset_s=1.0)
    assert caught.value.exit_code == 2


def test_setting_of_the_wrong_kind(pair, tmp_path):
    with pytest.raises(ConfigError, match="max_gap_s"):
        run(pair, tmp_path, max_gap_s=-1.0)


def test_film_and_log_that_do_not_overlap(pair, tmp_path):
    with pytest.raises(InputError, match="overlap") as caught:
        run(pair, tmp_path, offset_s=1e5, drift_ppm=0.0)
    assert caught.value.exit_code == 3
    assert not (tmp_path / "merged.csv").exists()


def test_unknown_offset_writes_nothing(pair, tmp_path):
    table = pd.read_csv(pair / "angle.csv")
    table["angle_deg"] = 12.5
    table.to_csv(tmp_path / "still.csv", index=False)
    with pytest.raises(NoResultError, match=r"still.csv and .*temps.csv.*--offset"):
        sync_to_folder(tmp_path / "still.csv", pair / "temps.csv", settings={}, out=tmp_path)
    assert not (tmp_path / "sync.json").exists()


def test_parquet_in_and_out(pair, given, tmp_path):
    for name in ("angle", "temps"):
        pd.read_csv(pair / f"{name}.csv").to_parquet(tmp_path / f"{name}.parquet")
    sync_to_folder(
        tmp_path / "angle.parquet",
        tmp_path / "temps.parquet",
        settings=GIVEN,
        out=tmp_path / "out",
        table=tmp_path / "merged.parquet",
    )
    again = pd.read_parquet(tmp_path / "merged.parquet")
    assert again["temp_a_c"].to_numpy() == pytest.approx(read_merged(given / "merged.csv").temp_a_c, nan_ok=True)
    written = pd.read_csv(tmp_path / "out" / "merged.csv")
    assert list(again.columns) == list(written.columns)


def test_a_failed_sync_says_that_the_table_is_an_earlier_one(pair, tmp_path, capsys):
    (tmp_path / "empty.csv").write_text("time_s,temp_a_c,temp_b_c\n")
    command = ["sync", "--angle", str(pair / "angle.csv"), "--temperature", str(tmp_path / "empty.csv"), "--out"]
    assert leave(*command, str(tmp_path / "new")) == 3
    assert "earlier" not in capsys.readouterr().err
    run(pair, tmp_path, offset_s=OFFSET_S)
    before = (tmp_path / "merged.csv").read_bytes()
    assert leave(*command, str(tmp_path)) == 3
    assert "merged.csv is that of an earlier sync" in capsys.readouterr().err
    assert (tmp_path / "merged.csv").read_bytes() == before


@pytest.mark.parametrize("drift", [{}, {"drift_ppm": 0.0}])
def test_a_given_offset_that_the_motion_contradicts_is_told(pair, tmp_path, drift):
    for given, told in ((OFFSET_S, False), (-OFFSET_S, True)):
        run(pair, tmp_path, offset_s=given, **drift)
        content = json.loads((tmp_path / "sync.json").read_text())
        assert content["offset_s"]["value"] == given
        assert any("check the given one and its sign" in note for note in content["notes"]) == told
