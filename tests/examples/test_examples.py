"""The example scripts run and find what their data were made with."""

from __future__ import annotations

import re
import runpy
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.few_effects import try_few
from tests.record_files import write_record
from tests.tracker.films import Rig, write_film
from torsight.synthetic import Record, make_record

ROOT = Path(__file__).parents[2]
LAG_S = 6.0
SCENE = {
    "seed": 11,
    "protocol": {
        "time_factor": 0.5,
        "rest_s": 40.0,
        "half_cycle": [
            {"spring": "a", "peak_c": 82.0},
            {"spring": "b", "peak_c": 80.0, "ramp_s": 300.0},
            {"spring": "a", "peak_c": 80.0, "ramp_s": 900.0},
        ],
    },
    "effects": {"sensor_lag": {"lag_s": LAG_S}},
}
OFFSET_S = 5.0


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "examples" / f"{name}.py"))


@pytest.fixture(scope="module")
def record() -> Record:
    return make_record(SCENE, rate_hz=0.5)


@pytest.fixture(scope="module")
def folder(record: Record, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("example")
    write_record(record, made, offset_s=OFFSET_S)
    return made


def test_every_example_is_run_here() -> None:
    """The others run with the tests of what they show: the renderer, and discovery on measured data."""
    here = {"track_a_film", "fit_friction", "find_what_is_missing", "own_model", "tanks", "watch_a_campaign"}
    assert {path.stem for path in (ROOT / "examples").glob("*.py")} == here | {"film_a_rig", "emps", "sma_stress"}


def test_track_a_film(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = Rig(lambda t: 60.0 - 40.0 * t, frames=30, texture=0.0)
    film = write_film(rig, tmp_path / "film.mkv")
    example("track_a_film")["main"](film)
    assert "30 of 30 frames" in capsys.readouterr().out
    angle_deg = np.loadtxt(tmp_path / "angle.csv", delimiter=",", skiprows=1)[:, 2]
    np.testing.assert_allclose(angle_deg, rig.truth_deg, atol=0.15)


def test_fit_friction(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [folder / name for name in ("angle.csv", "temps.csv", "actuator.toml")]
    clock, result = example("fit_friction")["main"](*paths)
    # the sensor is late by some seconds: an interval that holds the truth says so
    low, high = clock.offset_ci95_s
    assert low <= OFFSET_S <= high
    assert {"tau_c_mnm", "A_s_c"} <= set(result.estimates)
    assert "tau_c_mnm" in capsys.readouterr().out


def test_find_what_is_missing(
    folder: Path, record: Record, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    try_few(monkeypatch)  # what is named among all effects is tested with discovery; here the script
    start_deg = float(np.rad2deg(record.angle_rad[0]))
    later = folder / "later.csv"
    shutil.copy(folder / "temps.csv", later)
    report = example("find_what_is_missing")["main"](folder / "merged.csv", folder / "actuator.toml", later, start_deg)
    named = {effect.id for effect in report.effects} | {name for one in report.alternatives for name in one}
    assert "sensor_lag" in named
    assert report.after.rmse_train_deg < 0.5 * report.before.rmse_train_deg
    told = capsys.readouterr()
    assert re.search(r"later: from -?\d.*° to \d.*°, ±\d\.\d\d°", told.out)
    assert "%" in told.err


def test_own_model(capsys: pytest.CaptureFixture[str]) -> None:
    own = example("own_model")
    findings = own["main"]()
    assert findings.verdict == "identified"
    assert findings.decision.chosen.effects == ("friction_along_screw",)
    for name, true in own["TRUE"].items():
        assert findings.decision.chosen.fit.values[name] == pytest.approx(true, rel=0.05, abs=0.5)
    assert "held-out strokes" in capsys.readouterr().out


def test_tanks(capsys: pytest.CaptureFixture[str]) -> None:
    own = example("tanks")
    found = own["main"]()
    assert found.verdict == "identified"
    assert found.effects == ("overflow",)
    low, high = found.parameters["rim_cm"].ci95
    assert low < own["TRUE"]["rim_cm"] < high
    told = re.search(r"A later record is predicted to (\d\.\d+) cm", capsys.readouterr().out)
    assert told is not None
    # 480 readings of 0.03 cm each; what the model errs is to be less than the noise.
    assert float(told[1]) < 1.4 * own["NOISE_CM"]


def test_watch_a_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An experiment that cannot be done is a row that says why; the others are not kept from their own."""
    from torsight.core.errors import NoResultError

    for name in ("one", "two"):
        (tmp_path / "rigs" / name).mkdir(parents=True)
        (tmp_path / "rigs" / name / "experiment.toml").write_text('[video]\npath = "none.mp4"\n')
    with pytest.raises(NoResultError, match="all 2 experiments failed"):
        example("watch_a_campaign")["main"](tmp_path / "rigs", tmp_path / "out")
    told = capsys.readouterr().out
    assert told.count("failed") == 2
    assert "experiments: 2 of 2" in told
    assert tomllib.loads((tmp_path / "rigs" / "one" / "experiment.toml").read_text())
    assert (tmp_path / "out" / "results.csv").exists()
