"""Effect of halving and doubling each constant that finds an LED on a film, with a known heating switch.

Films of the synthetic rig with an LED that is lit while a spring is heated: bright, and hardly brighter than the spots
of the background; in quiet, well compressed pictures, and in noisy, flickering, badly compressed ones. Each is read
with the place given exactly and 2, 4 and 6 px beside it. Columns: share of the readings that find every change of the
switch and no other; of all changes that are found, the share that lie within two frames of one; rms distance of these,
in frames.

Run: python benchmarks/sync/led.py
"""

from __future__ import annotations

import itertools
import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.half_and_twice import half_and_twice
from sync import led
from torsight.core.errors import NoResultError
from torsight.core.files.storage import read_table
from torsight.synthetic import render_scene, scene_from
from tracker.frames.source import open_source

CONSTANTS = ("_NEAR_PX", "_BRIGHTEST", "_FLICKER_S")
FPS, PLACE, REACH = 20.0, (60, 60), 40


class Cut:
    """A film's frames around the LED, as a source; the film itself is decoded once."""

    def __init__(self, film: Path) -> None:
        x, y = PLACE
        self.frames = [
            replace(one, luma=one.luma[y - REACH : y + REACH, x - REACH : x + REACH].copy())
            for one in open_source(film)
            if one.luma is not None
        ]
        self.frame_count = len(self.frames)

    def __iter__(self) -> Any:
        return iter(self.frames)


def films(folder: Path) -> list[tuple[Cut, np.ndarray]]:
    """Return films, cut around the LED, with the times at which the switch changed."""
    made = []
    ways = itertools.product((250.0, 160.0), (2.0, 4.0), ((1.5, 0.0, 18), (6.0, 0.05, 32)))
    for number, (level, radius, (noise, flicker, crf)) in enumerate(ways):
        content = {
            "seed": number,
            "protocol": {"time_factor": 0.02, "repeat": 2},
            "film": {"fps": FPS, "crf": crf},
            "camera": {"width_px": 320, "height_px": 240, "focal_px": 550.0},
            "led": {"radius_px": radius, "position_px": [float(one) for one in PLACE], "level": level},
            "light": {"read_noise": noise, "flicker": flicker},
        }
        render_scene(scene_from(content), out=folder / str(number))
        log = read_table(folder / str(number) / "temps.csv")
        lit = log["heat_a"].to_numpy(bool) | log["heat_b"].to_numpy(bool)
        made.append((Cut(folder / str(number) / "film.mp4"), log["time_s"].to_numpy()[1:][lit[1:] != lit[:-1]]))
    return made


def read(made: list[tuple[Cut, np.ndarray]]) -> str:
    """Return how the changes of the LEDs are found."""
    whole, off = [], []
    for cut, changes_s in made:
        for beside in (0, 2, 4, 6):
            time_s, value = led.brightness(cut, (REACH + beside, REACH))
            try:
                found = led.led_changes(time_s, value, where="").time_s
            except NoResultError:
                whole.append(False)
                continue
            away = FPS * np.abs(found[:, None] - changes_s[None, :]).min(axis=1)
            whole.append(len(found) == len(changes_s) and bool((away < 2.0).all()))
            off += away.tolist()
    near = np.array(off) < 2.0
    rms = np.sqrt(np.mean(np.array(off)[near] ** 2))
    return f"whole {np.mean(whole):4.0%} of the changes right {near.mean():6.1%} rms {rms:5.2f} frames"


def main() -> None:
    """Print one row per constant and factor."""
    with tempfile.TemporaryDirectory() as folder:
        made = films(Path(folder))
    print(f"as it is: {read(made)}", flush=True)
    for name in CONSTANTS:
        for factor in half_and_twice(name, led):
            print(f"{name:12s} x{factor:<3g} {read(made)}", flush=True)


if __name__ == "__main__":
    main()
