"""A drawn rig with known angles as a lossless film, and a temperature log for it: for the tests of the live view."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

SIZE_PX = (320, 240)
CENTRE_PX = (160.0, 120.0)
BASE_RAD = math.radians(200.0)
FPS = 30.0


def angles_deg(frames: int) -> np.ndarray:
    """Return a sweep from 60 degrees down by 80 and back, starting at once."""
    return 60.0 - 40.0 * (1.0 - np.cos(2.0 * np.pi * np.arange(frames) / frames))


def picture(angle_deg: float, *, seed: int, light: float = 1.0) -> np.ndarray:
    """Two light sticks with two dark dots each, drawn much finer than pixels, with noise."""
    luma = np.full((SIZE_PX[1], SIZE_PX[0]), 90, np.uint8)
    # The sticks' dots are at different distances from the axis: where one passes over the other they do not meet.
    for turn_rad, radii in (
        (BASE_RAD, (14, 26, 62, 78)),
        (BASE_RAD + math.radians(angle_deg), (14, 44, 94, 110)),
    ):
        places = [
            (CENTRE_PX[0] + radius * math.cos(turn_rad), CENTRE_PX[1] - radius * math.sin(turn_rad)) for radius in radii
        ]
        corners = [(round(256 * x), round(256 * y)) for x, y in places]
        cv2.line(luma, corners[0], corners[3], 215, 18, cv2.LINE_AA, 8)
        for corner in corners[1:3]:
            cv2.circle(luma, corner, 256 * 5, 30, -1, cv2.LINE_AA, 8)
    noise = np.random.default_rng(seed).normal(0.0, 1.5, luma.shape)
    return np.clip(luma * light + noise, 0, 255).astype(np.uint8)


def write_film(path: Path, frames: int) -> np.ndarray:
    """Write the film of the sweep and return the angle of every frame, deg."""
    angles = angles_deg(frames)
    film_angles(path, angles, fps=FPS)
    return angles


def film_angles(path: Path, angles: np.ndarray, *, fps: float) -> None:
    """Write the film of given angles, deg."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), fps, SIZE_PX)
    for index, angle in enumerate(angles.tolist()):
        writer.write(cv2.cvtColor(picture(angle, seed=index), cv2.COLOR_GRAY2BGR))
    writer.release()


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
