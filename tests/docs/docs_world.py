"""A folder in which the commands of the pages can be given as they stand: every file that they name, small."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import tomli_w

from calibration.boards.printing import usual_board
from tests.actuator.spring_bench import write_bench
from tests.calibration.made_up_views import in_right, poses
from tests.docs.documented import ROOT
from tests.small_picture import SMALL_PICTURE
from tests.tracker.films import Rig, write_film
from tests.tracker.flat_films import FlatFilm, Sprite, tag
from torsight.synthetic.scene import Scene, scene_from
from torsight.synthetic.scene_files import render_scene

SCENE = (
    """
seed = 5
[protocol]
time_factor = 0.08
rest_s = 8.0
[[protocol.half_cycle]]
spring = "a"
peak_c = 84.0
ramp_s = 400.0
heat_s = 430.0
cool_s = 200.0
[thermal]
wire_capacity_j_per_k = 0.6
[rig]
as_declared = true
[actuator.uncertainty]
A_s_c = 0.4
M_s_c = 0.6
[film]
fps = 3.0
crf = 23
[log]
offset_s = 5.0
[output]
camera = false
"""
    + SMALL_PICTURE
    + "texture = 0.0\n"
)


def small_scene() -> Scene:
    """Return one quick half-cycle in a small picture."""
    return scene_from(tomllib.loads(SCENE), where="the pages' scene")


def make_world(folder: Path) -> None:
    """Fill a folder with everything that the pages' commands read."""
    render_scene(small_scene(), out=folder)
    shutil.copy(folder / "temps.csv", folder / "later_temps.csv")
    write_logger(folder, pd.read_csv(folder / "temps.csv"))
    _scenes(folder)
    write_bench(folder, rng=np.random.default_rng(1), rows=150)
    _boards(folder)
    _own_model(folder)
    # What a camera gives: the sticks turn by 40° within a second.
    write_film(Rig(lambda t: 60.0 - 40.0 * t, frames=30, texture=0.0), folder / "bench.mkv")
    base, moving = (Sprite(**tag("4X4_50", number, side_mm=36.0, along_mm=70.0)) for number in (0, 1))
    FlatFilm([base], [moving], lambda t: 60.0 + 40.0 * t, frames=30).write(folder / "tagged.mkv")


def write_logger(folder: Path, temps: pd.DataFrame) -> None:
    """Write a log as a data logger would: a preamble, channels by number."""
    channels = temps[["time_s", "temp_a_c", "temp_b_c"]].set_axis(["Time", "Chan 101 (C)", "Chan 102 (C)"], axis=1)
    (folder / "logger.csv").write_text(f"Unit 7\n\n{channels.to_csv(index=False)}", encoding="utf-8")


def _own_model(folder: Path) -> None:
    """Put a model of one's own there, and two records of it."""
    (folder / "model.py").write_text(
        "from torsight.discovery import candidate, parameter\n"
        "output = 'y'\n"
        "parameters = [parameter('gain', 1.0), parameter('offset', 0.0)]\n"
        "candidates = [candidate('bend', parameter('bend', 0.1, null=0.0))]\n"
        "def predict(p, record):\n"
        "    return p.offset + p.gain * record.u + p.bend * record.u**2\n",
        encoding="utf-8",
    )
    rng = np.random.default_rng(7)
    for name in ("a", "b"):
        u = np.sin(np.linspace(0.0, 12.0, 200)) + rng.normal(0.0, 0.3, 200)
        columns = np.column_stack([np.arange(200.0), u, 1.0 + 2.0 * u + 0.5 * u**2 + rng.normal(0.0, 0.05, 200)])
        np.savetxt(folder / f"{name}.csv", columns, delimiter=",", header="time_s,u,y", comments="")


def fill_in(folder: Path, world: Path) -> None:
    """Do what ``torsight init`` leaves to its user: film and log beside the files, the rig's own values in them."""
    for name in ("film.mp4", "temps.csv", "actuator.toml"):
        shutil.copy(world / name, folder)


def _scenes(folder: Path) -> None:
    """Put this scene there, and the repository's with films of a moment."""
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    scenes = folder / "fixtures" / "scenes"
    scenes.mkdir(parents=True)
    for path in (ROOT / "fixtures" / "scenes").glob("*.toml"):
        text = path.read_text(encoding="utf-8").replace("[film]", "[film]\nseconds = 0.5")
        (scenes / path.name).write_text(text, encoding="utf-8")


def _boards(folder: Path) -> None:
    """Take pictures of the board that ``torsight board`` makes: by one camera, by a pair, and lying on the disk."""
    board = usual_board("charuco")
    (folder / "board.toml").write_text(tomli_w.dumps(board.content()), encoding="utf-8")
    width_mm, height_mm = (count * board.square_mm for count in board.squares)
    art = board.charuco().generateImage((round(10 * width_mm), round(10 * height_mm)), marginSize=0)
    scale = width_mm / 100.0
    for number, pose in enumerate(poses(7, 8)):
        pose[3:] *= scale
        for name, seen in (("board", pose), ("left", pose), ("right", in_right(pose))):
            _photograph(art, seen, folder / f"{name}{number}.jpg")
    _photograph(art, np.array([0.2, -0.1, 0.4, 2.0, 1.0, 170.0 * scale]), folder / "disk.jpg")


def _photograph(art: np.ndarray, pose: np.ndarray, path: Path) -> None:
    """Show a board of ten pixels per mm to a camera without distortion, at twice the size and then shrunk."""
    width_px, height_px, focal_px = 480, 360, 520.0
    camera = np.array([[focal_px, 0.0, width_px / 2], [0.0, focal_px, height_px / 2], [0.0, 0.0, 1.0]])
    to_mm = np.array([[0.1, 0.0, -0.05 * art.shape[1]], [0.0, 0.1, -0.05 * art.shape[0]], [0.0, 0.0, 1.0]])
    turned = cv2.Rodrigues(pose[:3])[0]
    plane = np.column_stack((turned[:, 0], turned[:, 1], pose[3:]))
    twice = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
    seen = cv2.warpPerspective(
        art, twice @ camera @ plane @ to_mm, (2 * width_px, 2 * height_px), flags=cv2.INTER_AREA, borderValue=150
    )
    noise = np.random.default_rng(0).normal(0.0, 1.0, (height_px, width_px))
    small = cv2.resize(seen, (width_px, height_px), interpolation=cv2.INTER_AREA) + noise
    cv2.imwrite(str(path), np.clip(small, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 98])
