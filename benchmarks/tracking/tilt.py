"""Test of the sigma of a tilt that is estimated from the markers' paths: drawn films, tracked without a camera file.

Run: python benchmarks/tracking/tilt.py [--seeds 2] [--tilt 10]

Phase, distance, lens, compression and where the axis lies in the picture are drawn by lot. Columns: films; rms error of
the angle and rms of its sigma over all films, degrees; errors over sigmas (rms over the films, and of the worst film);
worst error, degrees; share of the films whose tilt counts as known.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from drawing import Film, write_film
from hardships import swing

sys.path.insert(0, str(Path(__file__).parents[2]))

from torsight.core.series import rms

TILTS_DEG = (0.0, 2.0, 5.0, 10.0, 20.0, 30.0)
ARCS_DEG = (440.0, 180.0, 90.0, 45.0)


def film_of(tilt_deg: float, arc_deg: float, seed: int) -> Film:
    """Return a film; it begins with the sticks apart, so that the dots can be named."""
    rng = np.random.default_rng([seed, round(tilt_deg), round(arc_deg)])
    start = rng.uniform(50.0, 310.0)
    return Film(
        "tilt",
        swing(start, arc_deg * float(rng.choice([-1.0, 1.0])), 8.0 if arc_deg > 200.0 else 10.0),
        seed=seed,
        base_deg=rng.uniform(0.0, 360.0),
        tilt_deg=tilt_deg,
        tilt_towards_deg=rng.uniform(0.0, 360.0),
        distance=float(rng.choice([700.0, 1500.0, 3000.0])),
        k1=float(rng.choice([0.0, -0.1, -0.3])),
        moving_px=((52.0, 138.0), (40.0, 150.0), (58.0, 150.0))[int(rng.integers(3))],
        offset_mm=(float(rng.uniform(-25.0, 25.0)), float(rng.uniform(-25.0, 25.0))),
        crf=(None, 18, 23)[int(rng.integers(3))],
        turn_camera_deg=rng.uniform(0.0, 360.0),
        uneven=float(rng.choice([0.0, 0.2, 0.5])),
    )


def measure(film: Film) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return error and sigma (deg) of every angle that is given, and whether the tilt counts as known."""
    from tracker.angle.orient import orient
    from tracker.detect.marker_file import read_markers
    from tracker.frames.source import open_source
    from tracker.track import track_film

    with tempfile.TemporaryDirectory() as name:
        path = write_film(film, Path(name) / "film")
        (Path(name) / "markers.toml").write_text(film.markers_toml())
        tracks = track_film(open_source(path), markers=read_markers(Path(name) / "markers.toml")).tracks
    found = orient(tracks, None)
    good = found.angles.valid & found.angles.branch_certain
    error = np.rad2deg(found.angles.angle_rad) - film.angle_deg(film.times_s)
    error -= 360.0 * np.round(np.median(error[good]) / 360.0)
    return error[good], np.rad2deg(found.angles.sigma_rad[good]), bool(found.report["tilt"]["known"])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tilt", type=float, action="append")
    options = parser.parse_args()
    print("| tilt, ° | arc, ° | films | rms, ° | sigma, ° | errors over sigmas | worst film | worst, ° | known |")
    print("| --- " * 9 + "|")
    for tilt_deg in options.tilt or TILTS_DEG:
        for arc_deg in ARCS_DEG:
            found = [measure(film_of(tilt_deg, arc_deg, seed)) for seed in range(1, options.seeds + 1)]
            ratios = [rms(error / sigma) for error, sigma, _ in found]
            print(
                f"| {tilt_deg:g} | {arc_deg:g} | {len(found)} | {rms([rms(e) for e, _, _ in found]):.3f} "
                f"| {rms([rms(s) for _, s, _ in found]):.3f} | {rms(ratios):.2f} | {max(ratios):.2f} "
                f"| {max(np.abs(e).max() for e, _, _ in found):.2f} | {np.mean([k for _, _, k in found]):.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
