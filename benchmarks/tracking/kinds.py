"""What tags, texture and dots give: drawn films with known angles, and real films; error, share, pull and cost.

Run: python benchmarks/tracking/kinds.py [--frames 150] [--real FOLDER]

Columns: frames with an angle, share of the frames; rms error, degrees (of real films against the centroids of the dots,
less their mean difference); errors over their sigmas (rms); cost of following a frame, ms of CPU and over that of
decoding its luma. The drawn films are VGA in H.264 at CRF 18, by the tests' renderer; FOLDER holds disc_on_pivot.mp4.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "tracker")]

from flat_films import FlatFilm, Hand, Sprite, tag, texture_picture  # noqa: E402

from torsight.core.threads import one_thread  # noqa: E402
from tracker.angle.orient import orient  # noqa: E402
from tracker.detect.marker_file import read_markers  # noqa: E402
from tracker.frames.source import open_source  # noqa: E402
from tracker.initialise import find_start  # noqa: E402
from tracker.track import track_film  # noqa: E402

TAGS = {"kind": "tag", "family": "4X4_50", "base_id": 0, "moving_id": 1}
INNER, OUTER = 60.0, 150.0
HUB_RIM = [[198.7, 110.0], [202.0, 34.7]]
STAND = [[42.7, 75.3], [12.0, 75.0]]
"""Dots of the disc, and two places on its stand, in the first frame."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--real", type=Path)
    options = parser.parse_args()
    print(f"{'film':44s} {'angles':>9s} {'share':>6s} {'rms':>8s} {'pull':>5s} {'ms':>6s} {'× decode':>8s}")
    with tempfile.TemporaryDirectory() as name:
        for title, film, hints in drawn(options.frames):
            path = film.write(Path(name) / "film.mp4", codec="libx264", crf=18)
            row(title, path, hints, film.truth_deg, floating=False)
    if options.real:
        path = options.real / "disc_on_pivot.mp4"
        truth_deg = disc_deg(path)
        for kind in ({"base": "texture", "moving": "dot"}, {"base": "texture", "moving": "texture"}):
            hints = {"kind": kind, "base": STAND, "moving": HUB_RIM}
            row(f"disc on pivot, real, {kind['moving']} on {kind['base']}", path, hints, truth_deg, floating=True)


def drawn(frames: int) -> Iterator[tuple[str, FlatFilm, dict[str, Any]]]:
    """Give films of tags and of textured sticks."""
    ways = {
        "slow": {"angle_deg": lambda t: 160.0 + 60.0 * np.cos(0.8 * t)},
        "10 px per frame": {"angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(10.0 / 120.0) * t},
        "10 px per frame, half exposed": {
            "angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(10.0 / 120.0) * t,
            "exposure": 0.5,
        },
        "seen from 25° aside": {"angle_deg": lambda t: 160.0 + 80.0 * np.cos(1.5 * t), "tilt_deg": 25.0},
        "a hand for 20 frames": {
            "angle_deg": lambda t: 60.0 + 60.0 * t,
            "hands": [Hand(40, 60, "moving", radius_mm=70.0)],
        },
    }
    for way, how in ways.items():
        base, moving = (Sprite(**tag("4X4_50", number, side_mm=48.0, along_mm=120.0)) for number in (0, 1))
        yield f"tags, {way}", FlatFilm([base], [moving], frames=frames, size=(640, 480), **how), TAGS
        rng = np.random.default_rng(4)
        base, moving = (Sprite(texture_picture(rng, 110, 500), along_mm=100.0, width_mm=190.0) for _ in range(2))
        film = FlatFilm([base], [moving], frames=frames, size=(640, 480), **how)
        places = [
            [film.on_stick(stick, float(film.truth_deg[0]), along).tolist() for along in (INNER, OUTER)]
            for stick in (0, 1)
        ]
        yield f"texture, {way}", film, {"kind": "texture", "base": places[0], "moving": places[1]}


def row(title: str, path: Path, hints: dict[str, Any], truth_deg: np.ndarray, *, floating: bool) -> None:
    """Track a film and print its line."""
    result = track_film(open_source(path), markers=read_markers(hints))
    angles = orient(result.tracks, None).angles
    valid = angles.valid
    error = (np.rad2deg(angles.angle_rad) - truth_deg)[valid]
    error -= np.median(error) if floating else 360.0 * np.round(np.median(error) / 360.0)
    rms = np.sqrt(np.mean(error**2)) if len(error) else np.nan
    pull = np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad[valid])) ** 2)) if len(error) else np.nan
    cost_ms, decode_ms = costs(path, hints)
    print(
        f"{title:44s} {valid.sum():4d}/{len(valid):4d} {valid.mean():6.3f} {rms:8.4f} {pull:5.2f} {cost_ms:6.2f} "
        f"{cost_ms / decode_ms:8.2f}",
        flush=True,
    )


@one_thread()
def costs(path: Path, hints: dict[str, Any]) -> tuple[float, float]:
    """Return CPU time of following a frame and of decoding its luma, ms, from one pass; the start is left out."""
    source = open_source(path)
    follower = find_start(source, read_markers(hints)).follower()
    following = decoding = 0.0
    count = 0
    began = time.process_time()
    for frame in source:
        got = time.process_time()
        follower.step(frame)
        done = time.process_time()
        if count:
            following, decoding = following + done - got, decoding + got - began
        count, began = count + 1, done
    return 1e3 * following / max(count - 1, 1), 1e3 * decoding / max(count - 1, 1)


def disc_deg(path: Path) -> np.ndarray:
    """Return the angle of the disc from the centroids of its two dots, frame by frame."""
    found: list[float] = []
    hub, rim = (np.array(point) for point in HUB_RIM)
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            grey = frame.to_ndarray(format="gray").astype(float)
            hub, rim = centroid(grey, hub), centroid(grey, rim)
            arm = rim - hub
            found.append(float(np.arctan2(-arm[1], arm[0])))
            turn = found[-1] - found[-2] if len(found) > 1 else 0.0
            cos, sin = np.cos(turn), np.sin(turn)
            rim = hub + np.array([cos * arm[0] + sin * arm[1], cos * arm[1] - sin * arm[0]])
    return np.rad2deg(np.unwrap(found))


def centroid(grey: np.ndarray, at: np.ndarray, *, reach: int = 9) -> np.ndarray:
    """Return the centroid of what is darker than the ground around a place."""
    for _ in range(4):
        x, y = np.rint(at).astype(int)
        top, left = max(0, y - reach), max(0, x - reach)
        part = grey[top : y + reach + 1, left : x + reach + 1]
        rows, columns = np.mgrid[: part.shape[0], : part.shape[1]]
        weight = np.clip(np.median(part) - 15.0 - part, 0.0, None)
        weight *= np.hypot(columns + left - at[0], rows + top - at[1]) < reach
        if weight.sum() == 0.0:
            break
        at = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum() + [left, top]
    return at


if __name__ == "__main__":
    main()
