"""Inputs are never written over, and a disk that is full loses nothing."""

from __future__ import annotations

import inspect
import re
import shlex
import shutil
import subprocess
import sys
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from tests import command_line
from tests.cli.bad_inputs import make_world
from tests.core.test_lock import HOLD
from tests.full_disk import full_disk
from tests.fuzz.readers import READERS, TESTS, make_neighbours
from torsight.cli.main import COMMANDS
from torsight.core.files import lock

LINE = """
from torsight.discovery import parameter
output = "angle_deg"
parameters = [parameter("slope", -9.0), parameter("level", 600.0)]
def predict(p, record):
    return p.level + p.slope * record.temp_a_c
"""


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good") / "world"
    make_world(folder)
    (folder / "tests.toml").write_text(TESTS)
    (folder / "scene.toml").write_text(
        '[motion]\nkind = "still"\nduration_s = 0.2\n[camera]\nwidth_px = 64\nheight_px = 64\n'
    )
    return folder


@pytest.fixture
def world(good: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(good, tmp_path / "world"))


def leave(command: str, folder: Path) -> int:
    return command_line.leave(*shlex.split(re.sub(r"\{([^}]*)\}", lambda found: str(folder / found[1]), command)))


@pytest.mark.parametrize(
    ("command", "copies"),
    [
        ("simulate {actuator.toml} {temps.csv} --start-angle 178 --out {temps.csv}", {}),
        ("simulate {actuator.toml} {temps.csv} --start-angle 178 --out {copy.csv}", {"copy.csv": "actuator.toml"}),
        ("simulate {actuator.toml} {temps.csv} --start-angle 178 --out {link.csv}", {"link.csv": "temps.csv"}),
        ("predict {model.json} {temps.csv} --start-angle 178 --out {temps.csv}", {}),
        ("sync --angle {merged.csv} --temperature {temps.csv} --out {}", {}),
        ("discover {curves.csv} --actuator {actuator.toml} --out {}", {"curves.csv": "merged.csv"}),
        ("fit {fit.json} --actuator {actuator.toml} --out {}", {"fit.json": "merged.csv"}),
        ("track {film.avi} --timestamps {angle.csv} --out {}", {}),
        ("track {angle.csv} --out {}", {}),
        ("calibrate {blank} --board {board.toml} --out {board.toml}", {}),
        ("characterise {actuator.toml} --out {}", {}),
        ("render {experiment.toml} --out {}", {}),
        ("run {experiment.toml} --out {}", {"merged.csv": "temps.csv"}),
    ],
)
def test_an_input_is_never_written_over(
    command: str, copies: dict[str, str], world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, target in copies.items():
        (world / name).unlink(missing_ok=True)
        (world / name).symlink_to(target)
    if command.startswith("run"):
        text = (world / "experiment.toml").read_text()
        (world / "experiment.toml").write_text(text.replace("temps.csv", "merged.csv"))
    before = {path: path.read_bytes() for path in world.rglob("*") if path.is_file()}
    assert leave(command, world) == 2
    assert "would be written over, and it is an input" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in world.rglob("*") if path.is_file()} == before


def test_paths_stay_where_they_say(world: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``..`` leads up from the file that says it, a shell's signs are letters, and nothing is made on the way."""
    text = (world / "experiment.toml").read_text()
    for name in ("../film.avi", "$HOME/film.avi", "~/film.avi", "`touch made`", "film.avi; touch made"):
        (world / "experiment.toml").write_text(text.replace("film.avi", name))
        assert leave("run {experiment.toml}", world) == 3
        assert f"{name}: no such file" in capsys.readouterr().err
    assert not list(world.parent.rglob("made"))
    assert not (world / "results").exists()


@pytest.mark.parametrize(
    ("command", "output"),
    [
        ("simulate {actuator.toml} {temps.csv} --start-angle 178 --out {sim.csv}", "sim.csv"),
        ("simulate {actuator.toml} {temps.csv} --start-angle 178 --out {sim.parquet}", "sim.parquet"),
        ("predict {good.json} {temps.csv} --start-angle 178 --out {sim.csv}", "sim.csv"),
        ("sync --angle {angle.csv} --temperature {temps.csv} --offset 0 --out {out}", "out/merged.csv"),
        ("fit {merged.csv} --actuator {actuator.toml} --out {out}", "out/fit.json"),
        ("board --out {board.pdf}", "board.pdf"),
        ("render {scene.toml} --out {out}", "out/temps.csv"),
        ("init {out}", "out/experiment.toml"),
        ("batch {experiment.toml} --out {out} --jobs 1", "out/results.csv"),
        ("track {dots.avi} --out {out}", "out/markers.csv"),
    ],
)
def test_a_full_disk_is_told_and_loses_nothing(
    command: str, output: str, world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_neighbours(world)
    make_world_film(world)
    (world / "good.json").write_bytes(READERS["model"].good)
    older = world / output
    older.parent.mkdir(exist_ok=True)
    older.write_text("older")
    if command.startswith("init"):
        command += " --force"
    before = {path: path.read_bytes() for path in world.rglob("*") if path.is_file()}
    with full_disk(100):
        code = leave(command, world)
    told = capsys.readouterr().err
    assert code == 3, told
    assert "File too large" in told
    assert "choose another folder" in told
    after = {path: path.read_bytes() for path in world.rglob("*") if path.is_file() and ".track" not in path.parts}
    assert after == before


NOWHERE = {
    "demo": "",
    "run": "{no.toml}",
    "track": "{no.mp4}",
    "sync": "--angle {no.csv} --temperature {no.csv}",
    "fit": "{no.csv} --actuator {no.toml}",
    "discover": "{no.csv} --actuator {no.toml}",
    "missing": "{no.py} {no.csv}",
    "simulate": "{no.toml} {no.csv} --start-angle 0",
    "predict": "{no.json} {no.csv}",
    "characterise": "{no.toml}",
    "paper": "",
    "calibrate": "{no.png} --board {no.toml}",
    "board": "",
    "render": "{no.toml}",
    "live": "{no.mp4} --temperature {no.csv}",
    "batch": "{no}",
    "markers": "{no.mp4}",
}
"""Every command that takes ``out``, with inputs that are not there: who looks at them first, names them."""
OF_FILES = {"simulate", "predict", "calibrate", "board", "markers"}


@pytest.mark.parametrize("name", NOWHERE)
def test_a_place_that_cannot_be_written_is_told_before_any_work(
    name: str, world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(world.rglob("*"))
    wrong = "{.}" if name in OF_FILES else "{temps.csv}"
    for out in ("/dev/null/x/y.svg", wrong):
        assert leave(f"{name} {NOWHERE[name]} --out {out}", world) == 3
        assert ": cannot be written (" in capsys.readouterr().err
    assert sorted(world.rglob("*")) == before


def test_no_command_that_writes_is_left_out() -> None:
    commands = {name: getattr(import_module(f"torsight.cli.{name}"), name) for name in COMMANDS}
    assert {name for name, one in commands.items() if "out" in inspect.signature(one).parameters} == set(NOWHERE)


@pytest.mark.parametrize(
    "command",
    [
        "sync --angle {angle.csv} --temperature {temps.csv} --out {out}",
        "fit {merged.csv} --actuator {actuator.toml} --out {out}",
        "discover {merged.csv} --actuator {actuator.toml} --out {out}",
        "missing {line.py} {merged.csv} --out {out}",
    ],
)
def test_a_folder_that_another_process_fills_is_refused(
    world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """Two commands that write at the same time would leave files of both."""
    monkeypatch.setattr(lock, "only_writer", partial(lock.only_writer, patience_s=0.1))
    (world / "line.py").write_text(LINE)
    with subprocess.Popen([sys.executable, "-c", HOLD, str(world / "out")], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        assert leave(command, world) == 3
        other.kill()
    assert "out: is being filled by another torsight; allowed one at a time" in capsys.readouterr().err
    assert [item.name for item in (world / "out").iterdir()] == [".lock"]


def make_world_film(folder: Path) -> None:
    """Write a film of two sticks with dots of which one turns."""
    import cv2

    writer = cv2.VideoWriter(str(folder / "dots.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (320, 240))
    for k in range(20):
        picture = np.full((240, 320, 3), 200, np.uint8)
        for angle, radii in ((200.0, (40, 90)), (20.0 + 3.0 * k, (40, 90))):
            for radius in radii:
                x, y = 160 + radius * np.cos(np.deg2rad(angle)), 120 - radius * np.sin(np.deg2rad(angle))
                cv2.circle(picture, (round(16 * x), round(16 * y)), 16 * 7, (40, 40, 40), -1, cv2.LINE_AA, 4)
        writer.write(picture)
    writer.release()
