"""Benefit of each correction of the camera on rendered films, from pixels to the angle.

A rig that turns at a steady speed is filmed by a stereo pair over a grid of tilts, lenses and distances; both films are
tracked; the camera is the film's own. Codec and quality are options, so that the error caused by compression can be
compared.

    python benchmarks/calibration/films.py --codec h264 --crf 12
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
from pathlib import Path

import numpy as np
from ways import angles_by_way, error_deg

from torsight.core.errors import NoResultError
from torsight.core.files.storage import read_table
from torsight.core.optics.camera import Camera, Pose
from torsight.core.optics.geometry import rotation_vector
from torsight.core.tracks import MarkerTracks
from torsight.synthetic.filming import optics
from torsight.synthetic.filming.camera_work import marker_points
from torsight.synthetic.scene import Scene, scene_from
from torsight.synthetic.scene_files import render_scene
from tracker.detect.marker_file import MarkerHints
from tracker.frames.source import open_source
from tracker.track import track_film

TILTS_DEG = (0.0, 10.0, 20.0, 30.0)
RADIAL = (0.0, -0.15, -0.30)
DISTANCES_MM = (200.0, 400.0)


def scene(tilt_deg: float, k1: float, distance_mm: float, *, codec: str, crf: int) -> Scene:
    """Return the scene of one film pair: just over one turn in 12 s."""
    toe_in_deg = 15.0
    return scene_from(
        {
            "seed": 1,
            "motion": {"kind": "turn", "start_deg": 40.0, "rate_deg_s": 32.0, "duration_s": 12.0},
            "film": {"fps": 15.0, "codec": codec, "crf": crf},
            "camera": {
                "focal_px": 1100.0,
                "tilt_deg": tilt_deg,
                "tilt_towards_deg": 90.0,
                "distortion": [k1, -0.2 * k1, 0.0004, -0.0003, 0.0],
                "distance_mm": distance_mm,
            },
            "stereo": {
                "baseline_mm": float(distance_mm * np.tan(np.radians(toe_in_deg))),
                "toe_in_deg": toe_in_deg,
            },
        }
    )


def known_camera(film: Scene) -> Camera:
    """Return the film's own camera with the pose of the axis."""
    left = optics.views(film)[0]
    camera = optics.camera_of(film)
    pose = Pose(rotation_vector(left.rotation), left.translation_mm, film.camera.base_z_mm, film.camera.moving_z_mm)
    return Camera(camera.intrinsics, pose=pose, right=camera.right)


def tracks_of(path: Path, view: optics.View, film: Scene) -> MarkerTracks:
    """Track one film; the markers are given where the first frame shows them, to a tenth of a pixel."""
    start = view.project(marker_points(film, np.radians(film.motion.start_deg))).round(1)
    return track_film(open_source(path), markers=MarkerHints(start, "dot", "scene")).tracks


def errors(film: Scene, folder: Path) -> dict[str, np.ndarray]:
    """Render, track and compare; the angle's error in degrees for each way to correct."""
    render_scene(film, out=folder)
    sides = []
    for side, view in zip(("left", "right"), optics.views(film), strict=True):
        try:
            tracks = tracks_of(next(folder.glob(f"film_{side}*")), view, film)
        except NoResultError:
            if side == "left":
                raise
            # Without the right film all but the last way remain.
            sides.append(None)
        else:
            sides.append((tracks.position_px, tracks.covariance_px2))
    truth = read_table(folder / "truth.csv", required=("angle_deg",))["angle_deg"].to_numpy()
    measured = angles_by_way(sides[0], sides[1], known_camera(film))
    return {way: error_deg(angle, np.radians(truth)) for way, angle in measured.items()}


def _rms(error_deg: np.ndarray) -> str:
    known = error_deg[np.isfinite(error_deg)]
    return f"{np.sqrt(np.mean(known**2)):.3f}" if len(known) else "no track"


def main() -> None:
    """Print the table: rms error of the angle in degrees."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--codec", default="h264")
    parser.add_argument("--crf", type=int, default=12)
    options = parser.parse_args()
    header = False
    for distance_mm, k1, tilt_deg in itertools.product(DISTANCES_MM, RADIAL, TILTS_DEG):
        film = scene(tilt_deg, k1, distance_mm, codec=options.codec, crf=options.crf)
        try:
            with tempfile.TemporaryDirectory() as folder:
                found = errors(film, Path(folder))
        except NoResultError as error:
            print(f"| {distance_mm:g} | {k1:g} | {tilt_deg:g} | none: {error} |")
            continue
        if not header:
            print("| distance, mm | k1 | tilt, ° | frames | " + " | ".join(found) + " |")
            print("| --- " * (4 + len(found)) + "|")
            header = True
        seen = next(iter(found.values()))
        cells = " | ".join(f"{_rms(error)}" for error in found.values())
        print(f"| {distance_mm:g} | {k1:g} | {tilt_deg:g} | {np.isfinite(seen).sum()} of {len(seen)} | {cells} |")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
