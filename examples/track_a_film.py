"""From a film to the angle of every frame, in Python.

Run: python examples/track_a_film.py film.mp4 [camera.toml]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from torsight.core import DEG, StickAngles, read_camera, write_angles
from tracker import open_source, orient, track_film


def angles_of(film: Path, camera: Path | None = None) -> StickAngles:
    """Return the angle of every frame; without a camera file the tilt is learned from the markers' own paths."""
    found = track_film(open_source(film))
    return orient(found.tracks, None if camera is None else read_camera(camera)).angles


def main(film: Path, camera: Path | None = None) -> None:
    """Print range and uncertainty, and write ``angle.csv`` beside the film."""
    angles = angles_of(film, camera)
    angle_deg = angles.angle_rad[angles.valid] / DEG
    print(f"{angles.valid.sum()} of {len(angles)} frames, from {angle_deg.min():.2f}° to {angle_deg.max():.2f}°")
    print(f"each known to {np.median(angles.sigma_rad[angles.valid]) / DEG:.4f}°")
    write_angles(film.with_name("angle.csv"), angles)


if __name__ == "__main__":
    main(*(Path(word) for word in sys.argv[1:]))
