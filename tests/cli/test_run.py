"""The main job on a film of a rig with a hidden effect: every file of the contract."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import leave
from tests.few_effects import try_few
from torsight.cli.run import again, other_versions
from torsight.core.files.storage import read_json, read_table
from torsight.synthetic.scene import demo_scene, scene_from
from torsight.synthetic.scene_files import render_scene

FILES = (
    "angle.csv",
    "markers.csv",
    "track.json",
    "track.png",
    "merged.csv",
    "sync.json",
    "fit.json",
    "discovery.json",
    "model.json",
    "curves.csv",
    "report.html",
    "recording.rrd",
    "provenance.json",
)
DISCOVERY_KEYS = {
    "schema",
    "verdict",
    "effects",
    "alternatives",
    "drivers",
    "before",
    "after",
    "held_out",
    "noise_floor_deg",
    "parameters",
    "next_experiment",
}
SCENE = """
seed = 23
[protocol]
time_factor = 0.1
rest_s = 15.0
[[protocol.half_cycle]]
spring = "a"
peak_c = 84.0
[[protocol.half_cycle]]
spring = "b"
peak_c = 82.0
ramp_s = 450.0
[effects.position_friction]
amplitude = 0.5
phase_rad = -1.1
[thermal]
wire_capacity_j_per_k = 0.6
[film]
fps = 4.0
crf = 23
[camera]
width_px = 288
height_px = 288
tilt_deg = 7.0
[log]
offset_s = -4.0
before_s = 5.0
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a rendered rig with a run on it: ``rig/`` and ``out/``."""
    folder = tmp_path_factory.mktemp("run")
    render_scene(scene_from(tomllib.loads(SCENE), where="test"), out=folder / "rig")
    with pytest.MonkeyPatch.context() as patch:
        # What is named among all effects is tested with discovery.
        try_few(patch, "position_friction", "sensor_lag", "stiffening")
        assert leave("run", str(folder / "rig" / "experiment.toml"), "--out", str(folder / "out")) == 0
    return folder


def test_every_file_of_the_contract_is_there(finished: Path) -> None:
    left = sorted(path.name for path in (finished / "out").iterdir())
    ambiguous = read_json(finished / "out" / "discovery.json")["verdict"] == "ambiguous"
    assert left == sorted([*FILES, "figures", *["next_experiment.csv"] * ambiguous])


def test_the_angle_is_right_within_its_own_sigma(finished: Path) -> None:
    angle = read_table(finished / "out" / "angle.csv", required=("frame", "angle_deg", "angle_sigma_deg", "valid"))
    truth = read_table(finished / "rig" / "truth.csv", required=("frame", "angle_deg"))
    assert angle["frame"].tolist() == truth["frame"].tolist()
    valid = angle["valid"].to_numpy() > 0
    assert valid.mean() > 0.85
    error = (angle["angle_deg"] - truth["angle_deg"]).to_numpy()[valid]
    # the first frame is read within half a turn; where the rig was before, no film can tell
    error -= 360.0 * np.round(error[0] / 360.0)
    pull = error / angle["angle_sigma_deg"].to_numpy()[valid]
    assert np.sqrt(np.mean(pull**2)) < 2.0
    assert np.abs(error).max() < 1.0


def test_discovery_names_what_was_hidden(finished: Path) -> None:
    found = read_json(finished / "out" / "discovery.json")
    assert set(found) >= DISCOVERY_KEYS
    named = {effect["id"] for effect in found["effects"]} | {
        name for one in found["alternatives"] for name in ([one] if isinstance(one, str) else one)
    }
    assert "position_friction" in named
    assert found["after"]["rmse_train_deg"] < 0.5 * found["before"]["rmse_train_deg"]
    low, high = found["parameters"]["tau_c_mnm"]["ci95"]
    assert low < found["parameters"]["tau_c_mnm"]["value"] < high


def test_the_clock_interval_covers_the_truth(finished: Path) -> None:
    clock = read_json(finished / "out" / "sync.json")
    low, high = clock["offset_s"]["ci95"]
    assert low <= -4.0 <= high


def test_the_summary_names_report_and_recording(finished: Path) -> None:
    from torsight.cli.summary import summary

    text = "\n".join(summary(finished / "out"))
    for words in ("Range of motion", "Friction torque", "95 %", "position friction", "report.html", "recording.rrd"):
        assert words in text


def test_the_summary_of_an_ambiguous_run_says_what_to_do_next(finished: Path, tmp_path: Path) -> None:
    from torsight.cli.summary import summary

    shutil.copy(finished / "out" / "angle.csv", tmp_path)
    found = read_json(finished / "out" / "discovery.json")
    found |= {"verdict": "ambiguous", "next_experiment": {"text": "Heat A slowly."}}
    (tmp_path / "discovery.json").write_text(json.dumps(found), encoding="utf-8")
    assert "Next experiment   Heat A slowly." in summary(tmp_path)


def test_an_input_that_changed_since_is_refused(
    finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = json.loads((finished / "out" / "provenance.json").read_text())
    log = next(name for name in content["inputs"] if name.endswith("temps.csv"))
    copy = tmp_path / "temps.csv"
    copy.write_text((finished / "out" / log).read_text() + "\n")
    (tmp_path / "provenance.json").write_text(json.dumps(content | {"inputs": {"temps.csv": content["inputs"][log]}}))
    assert leave("run", "--from", str(tmp_path / "provenance.json")) == 3
    assert "has changed since the run" in capsys.readouterr().err


def test_a_run_that_was_moved_with_its_inputs_is_repeated_from_any_folder(
    finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = tmp_path / "moved"
    shutil.copytree(finished, moved)
    monkeypatch.chdir(tmp_path)
    experiment = again(Path("moved", "out", "provenance.json"))
    assert sorted(path.resolve() for path in experiment.inputs()) == sorted(
        moved / "rig" / name for name in ("actuator.toml", "camera.toml", "film.mp4", "temps.csv")
    )


def test_other_versions_are_told(finished: Path, tmp_path: Path) -> None:
    origin = finished / "out" / "provenance.json"
    assert other_versions(origin) == []
    content = json.loads(origin.read_text())
    content["versions"]["numpy"] = "1.0"
    (tmp_path / "provenance.json").write_text(json.dumps(content))
    (line,) = other_versions(tmp_path / "provenance.json")
    assert line.startswith("note: made with other versions, numbers may differ: numpy 1.0, here ")


def test_the_scene_of_the_demo_hides_something_from_its_actuator_file() -> None:
    scene = demo_scene()
    assert scene.effects
    assert scene.camera.tilt_deg > 3.0
    assert scene.sensor.sample_s == pytest.approx(0.015)
    assert scene.sensor.noise_c > 0.0


def test_fit_and_discovery_show_one_plain_model(finished: Path) -> None:
    fit, found = (read_json(finished / "out" / name) for name in ("fit.json", "discovery.json"))
    assert fit["parameters"] == found["plain_parameters"]
    assert fit["rmse_deg"] == found["before"]["rmse_train_deg"]
