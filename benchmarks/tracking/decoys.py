"""Dots that look like markers beside a rig: share of films with the right markers, or else with a warning.

Run: python benchmarks/tracking/decoys.py [--first 0] [--films 40]

Films by the tests' renderer, one to three pairs of decoys each, at random places, without hints on the markers. Listed
are films with the right markers (median error of the angle, whole turns apart, below 2 degrees) and with wrong ones,
each without and with a warning that other dots may be the markers, and films without a result.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "tracker")]

from decoy_films import DecoyFilm  # noqa: E402

from torsight.core.errors import NoResultError  # noqa: E402
from tracker.angle.orient import orient  # noqa: E402
from tracker.frames.source import open_source  # noqa: E402
from tracker.track import track_film  # noqa: E402


def main() -> None:
    """Print what became of every film that is not right without a warning, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--films", type=int, default=40)
    options = parser.parse_args()
    count: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.films):
            film = DecoyFilm.of(seed)
            found, about = outcome(film, film.write(Path(folder) / "film.mkv"))
            count[found] += 1
            if found != "right":
                print(f"{seed:4d} {found}: {about}", flush=True)
    print(dict(count))


def outcome(film: DecoyFilm, path: Path) -> tuple[str, str]:
    """Return what became of a film, and what is to be said of it."""
    try:
        result = track_film(open_source(path))
    except NoResultError as error:
        return "no result", str(error)
    angles = orient(result.tracks, None).angles
    error = np.rad2deg(angles.angle_rad) - film.truth_deg
    off = float(np.nanmedian(np.abs((error + 180.0) % 360.0 - 180.0)))
    markers = result.report["markers"]
    rivals = markers.get("rivals", [])
    about = f"off by {off:.1f} deg, {angles.valid.mean():.2f} of the frames, range {np.ptp(film.angle_deg):.0f} deg"
    about += f", sure by {markers['probability']:.2f}"
    about += "".join(f"; {rival['probability']:.2f} {rival['base']}" for rival in rivals)
    return ("right" if off < 2.0 else "wrong") + (", told" if rivals else ""), about


if __name__ == "__main__":
    main()
