"""Error caused by every hardship: films with known angles, one hardship each, tracked and compared with the truth.

Run: python benchmarks/tracking/hardships.py [--seed 5] [--only WORD] [--frames 200] [--keep FOLDER]

Columns: frames with an angle, share of the frames; rms and worst error of these, degrees; errors over their sigmas
(rms); rms over that of a least-squares disc fit started at the true positions, on the same film; angles that are given
as right and are not (off by more than 1 degree and 5 sigmas; off by whole turns that are marked as uncertain are not
counted); marker positions that are given as right and lie more than half a radius off; whole turns left uncertain.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from drawing import Cover, Film, write_film
from numba import njit

sys.path.insert(0, str(Path(__file__).parents[2]))

from torsight.core.series import rms


def swing(start_deg: float, range_deg: float, period_s: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a motion there and back."""
    return lambda t: start_deg + range_deg * (np.cos(2.0 * np.pi * t / period_s) - 1.0) / 2.0


def strokes(start_deg: float, range_deg: float, period_s: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return heating and cooling in turn, fast at first, as long as each other."""

    def angle_deg(t: np.ndarray) -> np.ndarray:
        left = np.exp(-6.6 * (t % (0.5 * period_s)) / period_s)
        return start_deg + range_deg * np.where(t % period_s < 0.5 * period_s, 1.0 - left, left)

    return angle_deg


OVER_A_TURN = swing(70.0, 440.0, 8.0)
SLOW = swing(160.0, 130.0, 14.0)
STANDARD = Film("plain, H.264 CRF 18", OVER_A_TURN)


def films(seed: int, frames: int) -> list[Film]:
    """Return one film per hardship."""
    one = replace(STANDARD, seed=seed, frames=frames)
    slow = replace(one, angle_deg=SLOW)
    dark = {"stick": 52.0, "dot": 205.0, "ground": 118.0}
    little = {
        "stick": 120.0,
        "dot": 40.0,
        "ground": 70.0,
        "noise": 4.0,
        "averaged_grey": 40.0,
        "crf": 28,
        "camera": False,
    }
    hand = Cover(1.6, 3.6, 3, 24.0, 128.0)
    made: list[Film] = [
        replace(one, name="plain, lossless", crf=None),
        one,
        replace(one, name="plain, H.264 CRF 23", crf=23),
        replace(one, name="plain, H.264 CRF 30", crf=30),
        replace(slow, name="slow, H.264 CRF 23", crf=23),
        replace(slow, name="slow, H.264 CRF 30", crf=30),
        replace(one, name="markers found, not given", given=False),
        replace(one, name="moving stick below", base_on_top=True),
        replace(one, name="several turns", angle_deg=lambda t: 40.0 + 160.0 * t),
        replace(one, name="same arms on both sticks", moving_px=one.base_px),
        replace(slow, name="hand over outer marker 2 s", covers=[hand]),
        replace(slow, name="hand over inner marker 2 s", covers=[replace(hand, target=2)]),
        replace(slow, name="hand over moving stick 2 s", covers=[replace(hand, target="moving")]),
        replace(one, name="hand over fast stick 1 s", covers=[replace(hand, target="moving", end_s=2.6)]),
        replace(one, name="hand over fast stick 2 s", covers=[replace(hand, target="moving", end_s=3.6)]),
        replace(slow, name="hand over base marker 2 s", covers=[replace(hand, target=1)]),
        replace(slow, name="wire over outer marker 2 s", covers=[replace(hand, half_px=2.0, level=25.0)]),
        replace(
            slow, name="wire that stays in the way", covers=[replace(hand, half_px=2.5, level=25.0, follows=False)]
        ),
        replace(slow, name="white wire over inner marker", covers=[replace(hand, target=2, half_px=2.5, level=235.0)]),
        replace(slow, name="light off 1 s", dark_s=(2.0, 3.0)),
        replace(one, name="light off 1 s, fast", dark_s=(2.0, 3.0)),
        replace(one, name="flicker 30 %", flicker=0.3),
        replace(one, name="shake 1 px", shake_px=1.0),
        replace(one, name="shake 2 px", shake_px=2.0),
        replace(one, name="camera bumped by 13 px", bump_px=(2.5, 11.0, -7.0)),
        replace(one, name="20 px per frame", angle_deg=swing(70.0, 440.0, 5.1)),
        replace(one, name="20 px per frame, smeared", angle_deg=swing(70.0, 440.0, 5.1), exposure=0.5),
        replace(one, name="200 degrees/s, 25 per s, found", angle_deg=lambda t: 100 - 200 * t, fps=25.0, given=False),
        replace(one, name="motion blur, half a frame", exposure=0.5),
        replace(one, name="motion blur, whole frame", exposure=0.95),
        replace(
            one,
            name="dark, noisy and smeared",
            stick=36.0,
            dot=9.0,
            ground=18.0,
            texture=2.0,
            noise=5.5,
            exposure=0.95,
        ),
        replace(
            one,
            name="wide faint sticks, slow past",
            angle_deg=swing(40.0, 80.0, 10.0),
            stick=36.0,
            dot=9.0,
            ground=18.0,
            texture=2.0,
            noise=3.0,
            radius_px=8.0,
            half_px=26.0,
        ),
        replace(one, name="rolling shutter, camera file", row_s=15e-3 / 480),
        replace(one, name="rolling shutter, no camera", row_s=15e-3 / 480, camera=False),
        replace(one, name="rolling shutter, held upright", row_s=15e-3 / 640, read_along=0, camera=False),
        replace(one, name="frames dropped, 15 %", drop=0.15),
        replace(one, name="variable frame rate", jitter=1.0),
        replace(one, name="light dots on dark sticks", given=False, **dark),
        replace(one, name="uneven light 0.8", uneven=0.8, given=False),
        replace(one, name="rough background", texture=32.0, ground=110.0, given=False),
        replace(one, name="noise 6", noise=6.0),
        replace(one, name="little light, frames averaged", **little),
        replace(one, name="the same, heated and cooled", angle_deg=strokes(50.0, 100.0, 6.6), **little),
        *[_of_radius(one, radius, given=False) for radius in (3.0, 4.5, 9.0, 12.0, 16.0, 20.0)],
        *[replace(one, name=f"tilt {t}, camera file", tilt_deg=t, k1=-0.12) for t in (10, 20, 30)],
        *[replace(one, name=f"tilt {t}, no camera file", tilt_deg=t, camera=False) for t in (5, 10, 20, 30)],
        replace(slow, name="tilt 10, no camera, short arc", tilt_deg=10, camera=False),
        replace(one, name="two cameras", tilt_deg=9.0, k1=-0.08),
        replace(one, name="two cameras, markers found", tilt_deg=4.0, given=False, crf=23),
        replace(one, name="two cameras, rolling shutter", tilt_deg=9.0, k1=-0.08, row_s=15e-3 / 480),
        replace(one, name="tilt 6 and lens, no camera", tilt_deg=6, k1=-0.15, camera=False, crf=23),
    ]
    return made


def _of_radius(film: Film, radius: float, *, given: bool) -> Film:
    """Return a film with dots of a radius, on sticks as wide as they need."""
    reach = max(1.0, radius / 12.0)
    return replace(
        film,
        name=f"radius {radius:g} px, found",
        radius_px=radius,
        half_px=1.45 * radius + 1.5,
        base_px=(58.0 * reach, 150.0 + 2.0 * radius),
        moving_px=(54.0 * reach, 140.0 + 2.0 * radius),
        given=given,
    )


@dataclass
class Outcome:
    """How one film came out."""

    frames: int
    valid: np.ndarray
    error_deg: np.ndarray
    sigma_deg: np.ndarray
    reference_deg: np.ndarray
    misplaced: int
    uncertain: int

    def line(self) -> str:
        """Return the row of the table."""
        v = self.valid & (self.sigma_deg < 180.0)
        if not v.any():
            return f"{self.valid.mean():6.3f}  nothing to compare"
        error, sigma = self.error_deg[v], self.sigma_deg[v]
        ratio = rms(error / sigma)
        wrong = int((np.abs(error) > np.maximum(1.0, 5.0 * sigma)).sum())
        both = v & np.isfinite(self.reference_deg)
        against = rms(self.error_deg[both]) / rms(self.reference_deg[both]) if both.any() else math.nan
        return (
            f"{self.valid.mean():6.3f} {rms(error):8.4f} {np.abs(error).max():8.4f} {ratio:6.2f} {against:6.2f} "
            f"{wrong:6d} {self.misplaced:6d} {self.uncertain:6d}"
        )


HEAD = "film                                valid      rms    worst   pull  / fit  wrong astray  turn?"


def run(film: Film, folder: Path) -> Outcome:
    """Draw a film, track it through the command's function, compare its files with the truth."""
    from torsight.cli.track import track_to_folder

    path = write_film(film, folder / "film")
    camera = folder / "camera.toml"
    camera.write_text(film.camera_toml())
    markers = folder / "markers.toml"
    markers.write_text(film.markers_toml())
    out = folder / "out"
    track_to_folder(path, camera=camera if film.camera else None, markers=markers if film.given else None, out=out)
    return compare(film, path, out)


def run_pair(film: Film, folder: Path) -> Outcome:
    """Draw two films of one rig, track the pair, and compare with the truth in the left picture."""
    from torsight.cli.track import track_to_folder

    right = replace(film, tilt_deg=19.0, tilt_towards_deg=118.0, turn_camera_deg=4.0, offset_mm=(12.0, -9.0), k1=-0.05)
    left_path = write_film(film, folder / "left")
    right_path = write_film(right, folder / "right")
    camera, markers = folder / "pair.toml", folder / "markers.toml"
    camera.write_text(film.pair_toml(right))
    markers.write_text(film.markers_toml())
    out = folder / "out"
    track_to_folder(left_path, right=right_path, camera=camera, markers=markers if film.given else None, out=out)
    table = pd.read_csv(out / "markers.csv")
    for stick, radii in (("base", film.base_px), ("moving", film.moving_px)):
        inner, outer = (table[[f"{stick}_{end}_{axis}_mm" for axis in "xyz"]].to_numpy() for end in ("inner", "outer"))
        length = np.linalg.norm(outer - inner, axis=1)
        off = np.nanmedian(length) - (radii[1] - radii[0])
        print(f"  {stick} length off by {off:+.4f} mm of {radii[1] - radii[0]:g}, spread {np.nanstd(length):.4f} mm")
    return compare(film, left_path, out)


def compare(film: Film, path: Path, out: Path) -> Outcome:
    """Compare ``angle.csv`` and ``markers.csv`` with the truth."""
    angle = pd.read_csv(out / "angle.csv")
    table = pd.read_csv(out / "markers.csv")
    truth = film.angle_deg(film.times_s)
    if len(angle) != len(truth):
        raise SystemExit(f"{film.name}: {len(angle)} rows for {len(truth)} frames")
    places = film.markers_px()
    misplaced = 0
    for index, name in enumerate(("base_inner", "base_outer", "moving_inner", "moving_outer")):
        seen = table[f"{name}_valid"].to_numpy() == 1
        off = np.hypot(*(table[[f"{name}_x_px", f"{name}_y_px"]].to_numpy() - places[:, index]).T)
        misplaced += int((off[seen] > max(0.5 * film.radius_px, 2.5)).sum())
    valid = angle["valid"].to_numpy() == 1
    error = angle["angle_deg"].to_numpy() - truth
    # The first angle is told within half a turn of zero: whole turns of the start do not count.
    first = np.flatnonzero(valid)
    if len(first):
        error -= 360.0 * np.round(error[first[0]] / 360.0)
    sigma = angle["angle_sigma_deg"].to_numpy()
    return Outcome(
        len(truth), valid, error, sigma, reference(film, path), misplaced, int((valid & (sigma > 180.0)).sum())
    )


# --- the least-squares disc, started at the true positions ------------------------------------------------------------


def reference(film: Film, path: Path) -> np.ndarray:
    """Return the error (deg) of angles from discs fitted at the true positions; NaN where a disc is not free."""
    import av

    places, angles = film.markers_px(), film.angle_deg(film.times_s)
    found = np.full_like(places, np.nan)
    with av.open(str(path)) as container:
        for number, frame in enumerate(container.decode(video=0)):
            rows = np.frombuffer(frame.planes[0], np.uint8).reshape(-1, frame.planes[0].line_size)
            luma = np.ascontiguousarray(rows[: frame.height, : frame.width]).astype(np.float64)
            centres = film.centres_mm(float(angles[number]))
            for marker in range(4):
                if _free(film, places[number], marker):
                    found[number, marker] = _fit(film, luma, places[number, marker], centres[marker])
    for cover in film.covers:
        hidden = (film.times_s >= cover.start_s - 0.1) & (film.times_s < cover.end_s + 0.1)
        found[hidden] = np.nan
    if film.dark_s is not None:
        found[(film.times_s >= film.dark_s[0] - 0.05) & (film.times_s < film.dark_s[1] + 0.05)] = np.nan
    directions = []
    for first, z in ((0, 0.0), (2, film.moving_z)):
        inner, outer = (film.plane_point(found[:, first + i], z) for i in (0, 1))
        directions.append(np.rad2deg(np.arctan2(*(outer - inner).T[::-1])))
    base = directions[0]
    if film.shake_px == 0.0 and film.bump_px is None and film.carried is None:
        base = np.full_like(base, film.base_deg + np.nanmean((base - film.base_deg + 180.0) % 360.0 - 180.0))
    return (directions[1] - base - angles + 180.0) % 360.0 - 180.0


def _free(film: Film, places: np.ndarray, marker: int) -> bool:
    """Return whether the other stick is away from a marker."""
    other = places[2:] if marker < 2 else places[:2]
    u = other[1] - other[0]
    length = float(np.hypot(*u))
    along = float(np.clip((places[marker] - other[0]) @ u / length**2, -1.2, 1.6))
    return float(np.hypot(*(places[marker] - other[0] - along * u))) > film.half_px + film.radius_px + 3.0


def _fit(film: Film, luma: np.ndarray, place: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Fit position, size, contrast and background of an ellipse whose form is known from the true camera."""
    step = np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0]])
    seen = film.project(centre + step)
    to_plane = np.linalg.inv(np.column_stack([seen[0] - seen[1], seen[2] - seen[3]]))
    half = min(film.radius_px + 2.5, film.half_px - 0.8)
    edge = math.sqrt(film.blur_px**2 + 1.0 / 12.0)
    return _disc_fit(luma, place.copy(), to_plane, film.radius_px, edge, half)


@njit(cache=True)
def _disc_fit(luma, place, to_plane, radius, edge, half):  # noqa: ANN001, ANN202
    p = np.array([place[0], place[1], radius, 0.0, 0.0])
    height, width = luma.shape
    reach = int(2.2 * half) + 2
    cx, cy = round(place[0]), round(place[1])
    if cx < reach or cy < reach or cx >= width - reach or cy >= height - reach:
        return np.array([np.nan, np.nan])
    for turn in range(12):
        normal, right = np.zeros((5, 5)), np.zeros(5)
        _add_pixels(luma, place, p, to_plane, edge, half, normal, right)
        if turn == 0:
            # Light and contrast are linear; the rest waits for them.
            linear = np.linalg.solve(normal[3:, 3:], right[3:])
            p[3] += linear[0]
            p[4] += linear[1]
            continue
        for i in range(5):
            normal[i, i] += 1e-6 + 1e-6 * normal[i, i]
        step = np.linalg.solve(normal, right)
        p += step
        if abs(step[0]) + abs(step[1]) < 1e-5:
            break
    if not (abs(p[0] - place[0]) + abs(p[1] - place[1]) < radius):
        return np.array([np.nan, np.nan])
    return p[:2]


@njit(cache=True)
def _add_pixels(luma, place, p, to_plane, edge, half, normal, right):  # noqa: ANN001, ANN202
    """Add the pixels' parts to the normal equations of x, y, radius, contrast, background."""
    a, b, c, d = to_plane[0, 0], to_plane[0, 1], to_plane[1, 0], to_plane[1, 1]
    reach = int(2.2 * half) + 2
    cx, cy = round(place[0]), round(place[1])
    row = np.zeros(5)
    for y in range(cy - reach, cy + reach + 1):
        for x in range(cx - reach, cx + reach + 1):
            ox, oy = x - place[0], y - place[1]
            if (a * ox + b * oy) ** 2 + (c * ox + d * oy) ** 2 > half**2:
                continue
            u, v = a * (x - p[0]) + b * (y - p[1]), c * (x - p[0]) + d * (y - p[1])
            r = math.sqrt(u * u + v * v) + 1e-9
            z = (r - p[2]) / edge
            fall = math.exp(-0.5 * z * z) / (edge * 2.5066282746310002)
            row[0], row[1] = p[3] * fall * (u * a + v * c) / r, p[3] * fall * (u * b + v * d) / r
            row[2], row[3], row[4] = p[3] * fall, 0.5 * math.erfc(z / 1.4142135623730951), 1.0
            left = luma[y, x] - p[4] - p[3] * row[3]
            for i in range(5):
                right[i] += row[i] * left
                for j in range(5):
                    normal[i, j] += row[i] * row[j]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--only", default="")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    print(HEAD, flush=True)
    for film in films(options.seed, options.frames):
        if options.only not in film.name:
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = options.keep / film.name.replace(" ", "_").replace("/", "_") if options.keep else Path(name)
            folder.mkdir(parents=True, exist_ok=True)
            try:
                line = (run_pair if film.name.startswith("two cameras") else run)(film, folder).line()
            except Exception as error:  # noqa: BLE001 - a film that fails is a row of the table, too
                line = f"  {type(error).__name__}: {str(error)[:150]}"
            print(f"{film.name:34s} {line}", flush=True)


if __name__ == "__main__":
    main()
