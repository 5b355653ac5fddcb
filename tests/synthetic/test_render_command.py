"""The command, the page of keys, and the example."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

from torsight.cli.render import render
from torsight.core.errors import ConfigError

ROOT = Path(__file__).parents[2]
SCENE = """
seed = 4
[motion]
kind = "turn"
duration_s = 0.5
[film]
fps = 10.0
[camera]
width_px = 160
height_px = 120
focal_px = 400.0
"""


@pytest.fixture
def app() -> typer.Typer:
    made = typer.Typer()
    made.command()(render)
    return made


def test_command_writes_the_files_of_the_contract(tmp_path: Path, app: typer.Typer) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    result = CliRunner().invoke(app, [str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "torsight run" in result.stderr
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"film.mp4", "temps.csv", "truth.csv", "camera.toml", "actuator.toml", "experiment.toml"} <= names
    truth = pd.read_csv(tmp_path / "out" / "truth.csv")
    assert list(truth.columns[:3]) == ["frame", "time_s", "angle_deg"]
    # 20 °/s from 60°.
    assert truth["angle_deg"].tolist() == pytest.approx([60.0, 62.0, 64.0, 66.0, 68.0])


def test_a_record_without_a_film_is_the_rigs_own(tmp_path: Path, app: typer.Typer) -> None:
    text = """
seed = 4
[protocol]
time_factor = 0.05
[[protocol.half_cycle]]
spring = "a"
[film]
fps = 5.0
[effects.end_stop]
angle_deg = 100.0
stiffness_mnm_per_rad = 1000.0
"""
    (tmp_path / "scene.toml").write_text(text)
    words = [str(tmp_path / "scene.toml"), "--record", "--out", str(tmp_path / "out")]
    assert CliRunner().invoke(app, words).exit_code == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"merged.csv", "actuator.toml", "truth.toml"}
    merged = pd.read_csv(tmp_path / "out" / "merged.csv")
    assert merged["time_s"].diff().dropna().tolist() == pytest.approx([0.2] * (len(merged) - 1))
    # A stiff stop, and three sigmas of 0.06° of noise.
    assert -100.0 - 1.0 < merged["angle_deg"].min() < -100.0 + 1.0
    assert merged["temp_a_c"].max() > 75.0
    assert "end_stop" in (tmp_path / "out" / "truth.toml").read_text()


def test_seed_on_the_command_line_replaces_the_scenes(tmp_path: Path, app: typer.Typer) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    for seed in ("1", "2"):
        CliRunner().invoke(app, [str(tmp_path / "scene.toml"), "--out", str(tmp_path / seed), "--seed", seed])
    assert (tmp_path / "1" / "temps.csv").read_bytes() != (tmp_path / "2" / "temps.csv").read_bytes()


def test_unknown_key_is_told_before_anything_is_written(tmp_path: Path, app: typer.Typer) -> None:
    (tmp_path / "scene.toml").write_text(SCENE + "tilt = 3\n")
    result = CliRunner().invoke(app, [str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, ConfigError)
    assert "did you mean 'tilt_deg'" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_page_of_keys_is_the_one_that_the_code_makes() -> None:
    made = runpy.run_path(str(ROOT / "fixtures" / "scenes" / "make_readme.py"))["page"]()
    assert (ROOT / "fixtures" / "scenes" / "README.md").read_text(encoding="utf-8") == made


def test_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["film_a_rig.py", str(tmp_path)])
    example = runpy.run_path(str(ROOT / "examples" / "film_a_rig.py"))
    # The same scene for a second instead of a minute: the example's own film is for people.
    example["SCENE"]["film"]["seconds"] = 1.0
    example["main"](tmp_path)
    assert "friction torque" in capsys.readouterr().out
    assert (tmp_path / "film.mp4").stat().st_size > 1000
