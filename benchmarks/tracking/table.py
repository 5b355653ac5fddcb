"""Every film in one table: drawn ones of every hardship, of tags and of texture, and real ones.

Run: python benchmarks/tracking/table.py [--frames 150] [--real FOLDER] [--only WORD]

Columns: frames with an angle, share of the frames; rms error, degrees (of real films that of the moving stick in the
picture against the centroids of its dots: nobody knows how the camera stood; of these and of texture, whose zero are
points of one noisy frame, less the usual difference); errors over their sigmas (rms); cost of following a frame, ms of
CPU and over that of decoding its luma. The drawn films are VGA in H.264 at CRF 18 unless their names say otherwise, by
the tests' renderers; those of ``mishaps.py`` have columns of their own, among them what is told of the mishap;
FOLDER, by default real_films in TORSIGHT_SHARED_DATA, holds disc_on_pivot.mp4 and rolling_cylinder.mp4.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "tracker")]

import hardships  # noqa: E402
import mishaps  # noqa: E402
from flat_films import FlatFilm, Hand, Sprite, tag, texture_picture  # noqa: E402

from torsight.core.parallel.threads import one_thread  # noqa: E402
from tracker.angle.orient import orient  # noqa: E402
from tracker.angle.plane import stick_direction  # noqa: E402
from tracker.detect.marker_file import MarkerHints, read_markers  # noqa: E402
from tracker.frames.source import open_source  # noqa: E402
from tracker.initialise import find_start  # noqa: E402
from tracker.track import track_film  # noqa: E402

TAGS = {"kind": "tag", "family": "4X4_50", "base_id": 0, "moving_id": 1}
INNER, OUTER = 60.0, 150.0
HUB_RIM = [[198.7, 110.0], [202.0, 34.7]]
STAND = [[42.7, 75.3], [12.0, 75.0]]
"""Dots of the disc, and two places on its stand, in the first frame."""
MARKS = [[292.3, 103.2], [294.8, 126.5]]
CLAMP = [[160.0, 155.0], [216.0, 158.0]]
"""Marks of the cylinder, and two places on the clamp under its ramp, in the first frame."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=mishaps.enough, default=150)
    parser.add_argument("--only", default="")
    shared = os.environ.get("TORSIGHT_SHARED_DATA")
    parser.add_argument("--real", type=Path, default=Path(shared) / "real_films" if shared else None)
    options = parser.parse_args()
    print(f"{'film':44s} {'angles':>9s} {'share':>6s} {'rms':>8s} {'pull':>5s} {'ms':>6s} {'× decode':>8s}")
    with tempfile.TemporaryDirectory() as name:
        for made in hardships.films(5, options.frames):
            if options.only in made.name:
                hardship(made, Path(name))
        for title, film, hints in drawn(options.frames):
            if options.only in title:
                path = film.write(Path(name) / "film.mp4", codec="libx264", crf=18)
                row(title, path, hints, film.truth_deg, floating=False)
        print(mishaps.HEAD)
        for made in mishaps.films(5, options.frames):
            if options.only in made.name:
                print(mishaps.line(made, mishaps.run(made, Path(name))), flush=True)
    for title, path, hints, truth_deg in real(options.real) if options.real else ():
        if options.only in title:
            row(title, path, hints, truth_deg(path), floating=True)


def hardship(made: Any, folder: Path) -> None:
    """Track a drawn film with dots as its name says, and print its line."""
    pair = made.name.startswith("two cameras")
    found = (hardships.run_pair if pair else hardships.run)(made, folder)
    path = next(folder.glob("left.*" if pair else "film.*"))
    hints = read_markers(folder / "markers.toml") if made.given else None
    line(made.name, found.valid, found.error_deg, found.sigma_deg, costs(path, hints))
    path.unlink()


def real(folder: Path) -> Iterator[tuple[str, Path, dict[str, Any], Any]]:
    """Give the real films, what is told of their markers, and what finds their true angles."""
    disc, cylinder = folder / "disc_on_pivot.mp4", folder / "rolling_cylinder.mp4"
    for kind in ({"base": "texture", "moving": "dot"}, {"base": "texture", "moving": "texture"}):
        hints = {"kind": kind, "base": STAND, "moving": HUB_RIM}
        yield f"disc on pivot, real, {kind['moving']} on {kind['base']}", disc, hints, disc_deg
    hints = {"kind": "texture", "base": STAND, "moving": (np.array(HUB_RIM) + 5.0).tolist()}
    yield "disc on pivot, real, clicked 7 px beside", disc, hints, disc_deg
    # Its axis moves and its marks are small: outside what the tracker is for.
    hints = {"kind": "texture", "base": CLAMP, "moving": MARKS}
    yield "rolling cylinder, real, texture", cylinder, hints, cylinder_deg


def drawn(frames: int) -> Iterator[tuple[str, FlatFilm, dict[str, Any]]]:
    """Give films of tags and of textured sticks."""
    ways = {
        "slow": {"angle_deg": lambda t: 160.0 + 60.0 * np.cos(0.8 * t)},
        "10 px per frame": {"angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(10.0 / 120.0) * t},
        "10 px per frame, half exposed": {
            "angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(10.0 / 120.0) * t,
            "exposure": 0.5,
        },
        "in 1920 × 1440": {"angle_deg": lambda t: 160.0 + 60.0 * np.cos(0.8 * t), "enlarged": 3},
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
    orientation = orient(result.tracks, None)
    angles = orientation.angles
    error, sigma = np.rad2deg(angles.angle_rad) - truth_deg, np.rad2deg(angles.sigma_rad)
    if floating:
        seen = orientation.with_errors(result.tracks)
        places = np.where(seen.valid[..., None], seen.position_px, np.nan)
        inner, outer = ((places[:, marker], seen.covariance_px2[:, marker]) for marker in (2, 3))
        direction_rad, variance = stick_direction(inner, outer)
        error, sigma = -np.rad2deg(direction_rad) - truth_deg, np.rad2deg(np.sqrt(variance))
        error = (error - np.nanmedian(error % 360.0) + 180.0) % 360.0 - 180.0
    usual = np.nanmedian(error)
    error -= usual if floating or hints["kind"] == "texture" else 360.0 * np.round(usual / 360.0)
    line(title, angles.valid, error, sigma, costs(path, read_markers(hints)))


def line(title: str, valid: np.ndarray, error: np.ndarray, sigma: np.ndarray, cost_ms: tuple[float, float]) -> None:
    """Print the line of a film; frames whose whole turn is marked as uncertain have an angle, and no error."""
    told = valid & np.isfinite(error) & (sigma < 180.0)
    rms, pull = (np.sqrt(np.mean(np.square(one[told]))) if told.any() else np.nan for one in (error, error / sigma))
    print(
        f"{title:44s} {valid.sum():4d}/{len(valid):4d} {valid.mean():6.3f} {rms:8.4f} {pull:5.2f} {cost_ms[0]:6.2f} "
        f"{cost_ms[0] / cost_ms[1]:8.2f}",
        flush=True,
    )


@one_thread()
def costs(path: Path, hints: MarkerHints | None) -> tuple[float, float]:
    """Return CPU time of following a frame and of decoding its luma, ms, from one pass; the start is left out."""
    source = open_source(path)
    follower = find_start(source, hints).follower()
    steps: list[float] = []
    began = 0.0
    for frame in source:
        # In this thread alone: the decoder's threads work on meanwhile.
        at = time.thread_time()
        follower.step(frame)
        steps.append(time.thread_time() - at)
        began = began or time.process_time()
    following, total, count = sum(steps[1:]), time.process_time() - began, max(len(steps) - 1, 1)
    return 1e3 * following / count, 1e3 * (total - following) / count


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


def cylinder_deg(path: Path) -> np.ndarray:
    """Return the angle of the line through the cylinder's two marks, NaN where they or its face are not seen whole."""
    found: list[float] = []
    with av.open(str(path)) as container:
        for frame in container.decode(video=0):
            grey = frame.to_ndarray(format="gray")
            _, labels, sizes, _ = cv2.connectedComponentsWithStats((grey > 213).astype(np.uint8))
            wide, tall, area = sizes[:, 2], sizes[:, 3], sizes[:, 4]
            # The face has a radius of 14 px and lies above the ramp.
            face = (np.minimum(wide, tall) > 25) & (np.maximum(wide, tall) < 40) & (sizes[:, 1] < 160)
            found.append(np.nan)
            if not face.any():
                continue
            places = np.argwhere(labels == np.argmax(face * area))[:, ::-1].astype(np.float32)
            (x, y), radius = cv2.minEnclosingCircle(places)
            rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]]
            inside = np.hypot(columns - x, rows - y) < 0.95 * radius
            weight = np.clip(np.median(grey[inside]) - 25.0 - grey, 0.0, None) * inside
            # Each mark is a few pixels wide; a finger over the face is wider, and reaches its rim.
            count, labels, sizes, _ = cv2.connectedComponentsWithStats((weight > 0.0).astype(np.uint8))
            marks = [k for k in range(1, count) if sizes[k, 2:4].max() < 6 and weight[labels == k].max() > 40.0]
            if len(marks) == 2:
                one, two = (
                    np.average(np.argwhere(labels == k)[:, ::-1], axis=0, weights=weight[labels == k]) for k in marks
                )
                found[-1] = float(np.arctan2(one[1] - two[1], two[0] - one[0]))
    angle = np.array(found)
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known], period=np.pi)
    return np.rad2deg(angle)


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
