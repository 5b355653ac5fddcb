"""Two cameras against one with known planes: drawn films of a stereo pair, tracked, the angle compared with the truth.

Run: python benchmarks/tracking/stereo.py [--seeds 2] [--crf 18] [--shake 0]

The right camera looks at the rig from the side by the angle between the cameras; dots of the moving stick are 50 px
apart. Columns: tilt of the axis against the left camera's line of sight and angle between the cameras, degrees; for the
better of both single cameras (its own pose and planes, exact) and for the pair (axis and circles from the tracks): rms
error, rms of the sigma, degrees, and rms of error over sigma; the pair's error over the single camera's; tilt of the
axis as found, degrees.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from drawing import Film, write_film
from hardships import swing

sys.path.insert(0, str(Path(__file__).parents[2]))

from torsight.core.series import rms

TILTS_DEG = (0.0, 14.0, 28.0, 40.0)
BETWEEN_DEG = (6.0, 12.0, 25.0)


def pair_of(tilt_deg: float, between_deg: float, seed: int, *, crf: int = 18, shake_px: float = 0.0) -> list[Film]:
    """Return the left and the right film; phase, sense, and where the axis leans are drawn by lot."""
    rng = np.random.default_rng([seed, round(tilt_deg), round(between_deg)])
    left = Film(
        "left",
        swing(rng.uniform(50.0, 310.0), 440.0 * float(rng.choice([-1.0, 1.0])), 8.0),
        seed=seed,
        frames=240,
        base_deg=rng.uniform(0.0, 360.0),
        base_px=(58.0, 108.0),
        moving_px=(52.0, 102.0),
        tilt_deg=tilt_deg,
        tilt_towards_deg=rng.uniform(0.0, 360.0),
        k1=-0.1,
        crf=crf,
        shake_px=shake_px,
    )
    aside = cv2.Rodrigues(np.array([0.0, np.deg2rad(between_deg), 0.0]))[0] @ left.rotation
    tilt, towards, roll = tilt_and_roll(aside)
    right = replace(left, name="right", seed=seed + 1000, tilt_deg=tilt, tilt_towards_deg=towards, turn_camera_deg=roll)
    assert np.allclose(right.rotation, aside)
    return [left, right]


def tilt_and_roll(rotation: np.ndarray) -> tuple[float, float, float]:
    """Return a rotation (3, 3), camera from world, as the film says it: a tilt, where it leans, and a roll; degrees."""
    axis = rotation @ np.diag([1.0, -1.0, -1.0]) @ np.array([0.0, 0.0, 1.0])
    lean = np.cross([0.0, 0.0, 1.0], axis)
    size = np.linalg.norm(lean)
    tilt = cv2.Rodrigues(lean / size * np.arctan2(size, axis[2]))[0] if size > 1e-9 else np.eye(3)
    roll = tilt.T @ rotation @ np.diag([1.0, -1.0, -1.0])
    turn = np.arctan2(roll[1, 0], roll[0, 0])
    # The film tilts first and rolls then: roll · tilt(v) = tilt(roll v) · roll.
    vector = cv2.Rodrigues(roll.T @ tilt @ roll)[0].ravel()
    return (
        float(np.rad2deg(np.linalg.norm(vector))),
        float(np.rad2deg(np.arctan2(vector[1], vector[0]))),
        float(np.rad2deg(turn)),
    )


def measure(films: list[Film], folder: Path) -> dict[str, object]:
    """Return error and sigma (deg) of both single cameras and of the pair, and the pair's report."""
    from torsight.core.optics.camera import read_camera
    from tracker.angle.orient import orient
    from tracker.angle.stereo import orient_pair
    from tracker.detect.marker_file import read_markers
    from tracker.frames.source import open_source
    from tracker.track import track_film

    tracks, found = [], {}
    for film in films:
        path = write_film(film, folder / film.name)
        (folder / f"{film.name}_markers.toml").write_text(film.markers_toml())
        (folder / f"{film.name}.toml").write_text(film.camera_toml())
        hints = read_markers(folder / f"{film.name}_markers.toml")
        tracks.append(track_film(open_source(path), markers=hints).tracks)
        single = orient(tracks[-1], read_camera(folder / f"{film.name}.toml"))
        found[film.name] = against_truth(film, single.angles)
    (folder / "pair.toml").write_text(films[0].pair_toml(films[1]))
    both = orient_pair(tracks[0], tracks[1], read_camera(folder / "pair.toml"))
    return found | {"pair": against_truth(films[0], both.angles), "report": both.report}


def against_truth(film: Film, angles: object) -> tuple[np.ndarray, np.ndarray]:
    """Return error and sigma of every angle that is given, in degrees."""
    good = angles.valid & angles.branch_certain
    error = np.rad2deg(angles.angle_rad) - film.angle_deg(film.times_s)
    error -= 360.0 * np.round(np.median(error[good]) / 360.0)
    return error[good], np.rad2deg(angles.sigma_rad[good])


def row(results: list[dict[str, object]]) -> str:
    """Return the cells of one row, over all seeds."""
    cells, errors = [], []
    for way in ("single", "pair"):
        parts = []
        for result in results:
            name = min(("left", "right"), key=lambda side: rms(result[side][0])) if way == "single" else "pair"
            parts.append(result[name])
        errors.append(rms([rms(error) for error, _ in parts]))
        pull = rms([rms(error / sigma) for error, sigma in parts])
        cells += [f"{errors[-1]:.4f}", f"{rms([rms(sigma) for _, sigma in parts]):.4f}", f"{pull:.2f}"]
    tilt = np.mean([result["report"]["axis"].get("tilt_deg", np.nan) for result in results])
    return " | ".join([*cells, f"{errors[1] / errors[0]:.2f}", f"{tilt:.2f}"])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--crf", type=int, default=18)
    parser.add_argument("--shake", type=float, default=0.0, help="standard deviation of the cameras' shake, px")
    options = parser.parse_args()
    print("| tilt | between | single: rms | sigma | pull | pair: rms | sigma | pull | pair / single | tilt found |")
    print("| --- " * 10 + "|")
    for tilt_deg in TILTS_DEG:
        for between_deg in BETWEEN_DEG:
            results = []
            for seed in range(1, options.seeds + 1):
                films = pair_of(tilt_deg, between_deg, seed, crf=options.crf, shake_px=options.shake)
                with tempfile.TemporaryDirectory() as name:
                    results.append(measure(films, Path(name)))
            print(f"| {tilt_deg:g} | {between_deg:g} | {row(results)} |", flush=True)


if __name__ == "__main__":
    main()
