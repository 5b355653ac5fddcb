"""A drawn rig with known angles as a lossless film, and a temperature log for it: for the tests of the live view."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from grey_film import write_grey

from torsight.viewer.live.screen import Latency

SIZE_PX = (320, 240)
CENTRE_PX = (160.0, 120.0)
BASE_RAD = math.radians(200.0)
RULER_PX = (250.0, 200.0)
RULER_RAD = math.radians(75.0)
FPS = 30.0


def angles_deg(frames: int) -> np.ndarray:
    """Return a sweep from 60 degrees down by 80 and back, starting at once."""
    return 60.0 - 40.0 * (1.0 - np.cos(2.0 * np.pi * np.arange(frames) / frames))


def picture(angle_deg: float, *, seed: int, light: float = 1.0, ruler: bool = False) -> np.ndarray:
    """Two light sticks with two dark dots each, drawn much finer than pixels, with noise; and a ruler beside them."""
    luma = np.full((SIZE_PX[1], SIZE_PX[0]), 90, np.uint8)
    # The sticks' dots are at different distances from the axis: where one passes over the other they do not meet.
    for turn_rad, radii in (
        (BASE_RAD, (14, 26, 62, 78)),
        (BASE_RAD + math.radians(angle_deg), (14, 44, 94, 110)),
    ):
        _draw_bar(luma, CENTRE_PX, turn_rad, radii)
    if ruler:
        _draw_bar(luma, RULER_PX, RULER_RAD, (-36, -20, 20, 36))
    noise = np.random.default_rng(seed).normal(0.0, 1.5, luma.shape)
    return np.clip(luma * light + noise, 0, 255).astype(np.uint8)


def _draw_bar(luma: np.ndarray, origin_px: tuple[float, float], turn_rad: float, radii: tuple[int, ...]) -> None:
    places = [
        (origin_px[0] + radius * math.cos(turn_rad), origin_px[1] - radius * math.sin(turn_rad)) for radius in radii
    ]
    corners = [(round(256 * x), round(256 * y)) for x, y in places]
    cv2.line(luma, corners[0], corners[3], 215, 18, cv2.LINE_AA, 8)
    for corner in corners[1:3]:
        cv2.circle(luma, corner, 256 * 5, 30, -1, cv2.LINE_AA, 8)


def write_film(path: Path, frames: int, *, ruler: bool = False) -> np.ndarray:
    """Write the film of the sweep and return the angle of every frame, deg."""
    angles = angles_deg(frames)
    film_angles(path, angles, fps=FPS, ruler=ruler)
    return angles


def film_angles(path: Path, angles: np.ndarray, *, fps: float, ruler: bool = False) -> None:
    """Write the film of given angles, deg."""
    pictures = (picture(angle, seed=index, ruler=ruler) for index, angle in enumerate(angles.tolist()))
    write_grey(path, pictures, fps=fps)


def picture_angles_deg(markers: pd.DataFrame) -> np.ndarray:
    """Return the angle between the sticks as it lies in the picture, from ``markers.csv``, folded to ±180."""
    dx, dy = (
        (markers[f"moving_outer_{axis}_px"] - markers[f"moving_inner_{axis}_px"]).to_numpy() for axis in ("x", "y")
    )
    return np.remainder(np.degrees(np.arctan2(-dy, dx) - BASE_RAD) + 180.0, 360.0) - 180.0


def log_text(seconds: float, *, rate_hz: float = 20.0) -> str:
    """Return a log in which spring A is heated."""
    time_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    rows = [f"{t:.3f},{25.0 + 8.0 * t:.3f},{25.0 + 0.2 * t:.3f}" for t in time_s]
    return "\n".join(["time_s,temp_a_c,temp_b_c", *rows]) + "\n"


class Kept:
    """A screen that keeps what it is to show."""

    left_out = 0

    def __init__(self) -> None:
        self.latency = Latency()
        self.entries: list[tuple[Any, ...]] = []

    def wait_until_open(self, _limit_s: float) -> bool:
        return True

    def put(self, *entry: Any) -> None:
        self.entries.append(entry)

    def series(self, entity: str) -> tuple[np.ndarray, np.ndarray]:
        """Return all that was sent of a curve."""
        parts = [entry[2:] for entry in self.entries if entry[:2] == ("series", entity)]
        return tuple(np.concatenate([part[place] for part in parts]) for place in (0, 1))
