"""Films in which something goes wrong that the tracker is to bear or to tell, at moderate and at strong size.

Run: python benchmarks/tracking/mishaps.py [--only WORD] [--frames 150]

Columns: share of the frames with an angle; rms error, degrees; errors over their sigmas (rms); whether what is told is
right, or what should be; what is told: the commonest cause of frames without an angle, where it is told, and further
warnings and advice by the names in ``WORDS``. Films that are to be told of have the names that should be, and with a
minus sign those that must not be; films without any are measured alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pandas as pd
from drawing import Cover, Film, Hand, Lamp, write_film
from hardships import OVER_A_TURN, SLOW, STANDARD, swing

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "tracker")]

import flat_films  # noqa: E402
from flat_films import FlatFilm, Sprite, tag, texture_picture  # noqa: E402

from torsight.core.errors import TorsightError  # noqa: E402

WORDS = {
    "glare": "glares on the markers:",
    "flicker": "the light flickers",
    "jump": "picture jumps at",
    "stick?": "may not be on one stick",
    "repeats": "the picture repeats",
    "alike": "looks the same",
    "bump": "camera was moved during",
    "turns?": "whole turns is not certain",
    "rivals": "Other dots look like",
    "tilt?": "tilt is not known",
    "mirrored": "tags are seen mirrored",
}
"""Words of the advice, the warnings and the errors by a name."""


class Made(NamedTuple):
    """A film, what is told of its markers (None: nothing), and what should be told of it."""

    name: str
    film: Film | FlatFilm
    told: str = ""
    hints: dict[str, Any] | None = None
    floating: bool = False
    """Whether its zero is not known: texture, uneven ink, and a wrong place that was given."""


@dataclass
class Outcome:
    """How a film came out."""

    valid: np.ndarray
    error_deg: np.ndarray
    sigma_deg: np.ndarray
    told: list[str] = field(default_factory=list)


FEWEST = 117
"""Least number of frames of a film: the last mishap begins after 3.8 s."""


def enough(text: str) -> int:
    """Return a number of frames; too few are refused."""
    if int(text) < FEWEST:
        raise argparse.ArgumentTypeError(f"{text} frames are too few: give at least {FEWEST}")
    return int(text)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=enough, default=150)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    print(HEAD)
    with tempfile.TemporaryDirectory() as name:
        for made in films(5, options.frames):
            if options.only in made.name:
                print(line(made, run(made, Path(name))), flush=True)


HEAD = f"{'film':44s} {'share':>6s} {'rms':>8s} {'pull':>6s} right told"


def line(made: Made, found: Outcome) -> str:
    """Return the line of a film."""
    told = found.valid & np.isfinite(found.error_deg) & (found.sigma_deg < 180.0)
    error, sigma = found.error_deg[told], found.sigma_deg[told]
    rms, pull = (np.sqrt(np.mean(np.square(one))) if told.any() else np.nan for one in (error, error / sigma))
    right = "yes" if is_right(made.told, found.told) else f"no: {made.told}"
    return f"{made.name:44s} {found.valid.mean():6.3f} {rms:8.4f} {pull:6.2f} {right} | {' '.join(found.told)}"


def is_right(wanted: str, told: list[str]) -> bool:
    """Return whether what was told is what should be."""
    return all((one[1:] not in told) if one.startswith("-") else (one in told) for one in wanted.split())


def run(made: Made, folder: Path) -> Outcome:
    """Draw a film, track it through the command's function, and compare its files with the truth."""
    from torsight.cli.track import track_to_folder

    film, out = made.film, folder / "out"
    pair: dict[str, Any] = {}
    if isinstance(film, Film):
        if made.name.startswith("two cameras"):
            right = replace(
                film, covers=[], tilt_deg=19.0, tilt_towards_deg=118.0, turn_camera_deg=4.0, offset_mm=(12.0, -9.0)
            )
            (folder / "pair.toml").write_text(film.pair_toml(right))
            pair = {"right": write_film(right, folder / "right"), "camera": folder / "pair.toml"}
        path, truth_deg = write_film(film, folder / "film"), film.angle_deg(film.times_s)
        (folder / "markers.toml").write_text(film.markers_toml())
        hints: Any = folder / "markers.toml" if film.given else None
    else:
        path, truth_deg, hints = film.write(folder / "film.mp4", codec="libx264", crf=18), film.truth_deg, made.hints
    try:
        track_to_folder(path, markers=hints, out=out, **pair)
    except TorsightError as error:
        told = [name for name, words in WORDS.items() if words in str(error)]
        return Outcome(np.zeros(len(truth_deg), bool), truth_deg, truth_deg, [*told, f"error: {str(error)[:90]}"])
    angle, content = pd.read_csv(out / "angle.csv"), json.loads((out / "track.json").read_text())
    valid = angle["valid"].to_numpy() == 1
    error = angle["angle_deg"].to_numpy() - truth_deg
    if valid.any():
        first = error[valid][0]
        error -= np.nanmedian(error) if made.floating else 360.0 * np.round(first / 360.0)
    advice = " ".join(content["advice"])
    told = list(content["frames"]["causes"])[: "frames have no angle" in advice]
    told += [name for name, words in WORDS.items() if name not in told and words in advice]
    return Outcome(valid, error, angle["angle_sigma_deg"].to_numpy(), told)


def films(seed: int, frames: int) -> Iterator[Made]:
    """Give every film, of at least :data:`FEWEST` frames."""
    one = replace(STANDARD, seed=seed, frames=frames, camera=False)
    for group in (_hands, _jumps, _light, _carried, _repeated, _clicked, _starts, _covered):
        for name, film, told in group(one):
            yield Made(name, film, told, floating="stick?" in told)
    yield from _flat(frames)


Drawn = Iterator[tuple[str, Film, str]]


RIGHT, LEFT = (760.0, 420.0), (-120.0, 250.0)


def _middle_of(film: Film, stick: int, at_s: float) -> tuple[float, float]:
    """Return the middle between the markers of a stick at an instant."""
    x, y = film.markers_px()[round(at_s * film.fps), 2 * stick : 2 * stick + 2].mean(axis=0).tolist()
    return x, y


def _hands(one: Film) -> Drawn:
    """Give films of a hand over a stick: never a jump of the picture."""
    slow = replace(one, angle_deg=SLOW)
    over_moving, over_base = _middle_of(slow, 1, 2.5), _middle_of(slow, 0, 2.5)
    hand = Hand(1.5, 3.5, over_moving, RIGHT)
    ways = {
        "in 0.4 s": hand,
        "in 0.1 s": replace(hand, in_s=0.1),
        "within a frame": replace(hand, in_s=0.02),
        "within a frame, held still": replace(hand, in_s=0.02, tremor_px=0.0),
        "from below, 1 s": Hand(1.5, 2.7, over_moving, (300.0, 620.0), in_s=0.15),
        "large, in 0.2 s": replace(hand, palm_px=95.0, in_s=0.2),
        "pale, in 0.1 s": replace(hand, level=205.0, in_s=0.1),
        "dark, in 0.1 s": replace(hand, level=70.0, in_s=0.1),
        "over all, in 0.1 s": replace(hand, to_px=(322.0, 238.0), palm_px=170.0, in_s=0.1),
        "over all, within a frame": replace(hand, to_px=(322.0, 238.0), palm_px=170.0, in_s=0.02),
        "that stays, in 0.1 s": replace(hand, end_s=99.0, in_s=0.1),
    }
    for way, cover in ways.items():
        yield f"hand {way}", replace(slow, covers=[cover]), "hand -jump"
    for in_s in (0.1, 0.02):
        yield (
            f"hand over the base, in {in_s:g} s",
            replace(slow, covers=[Hand(1.5, 3.5, over_base, LEFT, in_s=in_s)]),
            "-jump",
        )
    yield (
        "hand twice, in 0.1 s",
        replace(slow, covers=[replace(hand, end_s=2.3, in_s=0.1), replace(hand, start_s=2.8, in_s=0.1)]),
        "hand -jump",
    )
    yield (
        "hand over a fast stick, in 0.1 s",
        replace(one, covers=[replace(hand, to_px=_middle_of(one, 1, 1.8), in_s=0.1, palm_px=110.0, end_s=2.6)]),
        "hand -jump",
    )
    for in_s in (0.1, 0.02):
        quick = Hand(1.5, 3.5, (322.0, 238.0), RIGHT, in_s=in_s, palm_px=170.0)
        yield f"hand over all, fast stick, in {in_s:g} s", replace(one, covers=[quick]), "hand -jump"
    yield (
        "hand, 10 frames per s, in 0.1 s",
        replace(slow, fps=10.0, frames=70, covers=[replace(hand, in_s=0.1)]),
        "hand -jump",
    )


def _jumps(one: Film) -> Drawn:
    """Give films of which a part is cut out: a jump of the picture, and no hand."""
    slow = replace(one, angle_deg=SLOW)

    def cut(angle_deg: Callable[[np.ndarray], np.ndarray], by_s: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda t: angle_deg(t + by_s * (t >= 2.0))

    yield "cut, slow, 3 s out", replace(slow, angle_deg=cut(SLOW, 3.0)), "jump -hand"
    yield "cut, slow, 6 s out", replace(slow, angle_deg=cut(SLOW, 6.0)), "jump -hand"
    yield "cut, fast, 0.3 s out", replace(one, angle_deg=cut(OVER_A_TURN, 0.3)), "jump -hand"
    yield "cut, fast, 1 s out", replace(one, angle_deg=cut(OVER_A_TURN, 1.0)), "jump -hand"
    later = replace(slow, angle_deg=cut(SLOW, 3.0))
    yield (
        "cut, and a hand later",
        replace(later, covers=[Hand(3.2, 4.5, _middle_of(later, 1, 3.8), RIGHT, in_s=0.1)]),
        "hand jump",
    )


def _once(turn: complex, shift: complex, at_s: float = 2.0) -> dict[str, Any]:
    return {"carried": lambda t: (np.where(t >= at_s, turn, 1.0 + 0j), np.where(t >= at_s, shift, 0j))}


def _eased(turn: complex, shift: complex, in_s: float = 1.2) -> dict[str, Any]:
    def carried(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = np.clip((t - 1.5) / in_s, 0.0, 1.0)
        share = share**2 * (3.0 - 2.0 * share)
        return np.exp(np.log(turn) * share), shift * share

    return {"carried": carried}


def _carried(one: Film) -> Drawn:
    """Give films of a camera that is put elsewhere during the film."""
    slow = replace(one, angle_deg=swing(160.0, 130.0, 5.0))
    small, large = np.exp(0.09j), np.exp(0.6j)
    yield "camera carried: 5°, 15 px", replace(slow, **_eased(small, 12.0 - 9.0j)), "bump -hand"
    yield "camera carried: 34°, 60 px, 0.9", replace(slow, **_eased(0.9 * large, 48.0 - 36.0j)), "bump -hand"
    yield "camera carried: 0.8 of the size", replace(slow, **_eased(0.8 + 0j, 10j)), "bump -hand"
    yield "camera carried in 0.4 s: 34°, 60 px", replace(slow, **_eased(large, 48.0 - 36.0j, 0.4)), "bump -hand"
    yield "camera carried in 0.4 s: 80 px", replace(slow, **_eased(1.0 + 0j, 70.0 - 40.0j, 0.4)), "bump -hand"
    yield (
        "camera carried in 2.5 s: 90°, tilted",
        replace(slow, tilt_deg=12.0, **_eased(1j, 20.0 + 0j, 2.5)),
        "bump -hand",
    )
    yield "camera carried, fast stick: 34°", replace(one, **_eased(0.9 * large, 20.0 - 30.0j)), "bump -hand"
    yield "camera put elsewhere: 5°, 25 px", replace(slow, **_once(small, 20.0 - 15.0j)), "bump -hand"
    yield "camera put elsewhere: 34°, 64 px", replace(slow, **_once(large, 40.0 - 50.0j)), "bump -hand"
    yield (
        "camera put elsewhere: 1.1 of the size",
        replace(slow, **_once(1.1 * np.exp(-0.2j), 15.0 + 10.0j)),
        "bump -hand",
    )
    yield (
        "camera put elsewhere: 0.8 of the size",
        replace(slow, **_once(0.8 * np.exp(-0.4j), 15.0 + 10.0j)),
        "bump -hand",
    )
    yield "camera put elsewhere, tilted: 34°", replace(slow, tilt_deg=12.0, **_once(large, 40.0 - 50.0j)), "bump -hand"


def _light(one: Film) -> Drawn:
    """Give films of glare of a lamp on the moving stick's path, and flicker."""
    slow = replace(one, angle_deg=SLOW)
    outer, middle = tuple(slow.markers_px()[int(2.5 * one.fps), 3].tolist()), _middle_of(slow, 1, 2.5)
    yield "glare over the outer marker", replace(slow, lamps=[Lamp(outer, 11.0)]), "glare -hand -jump"
    yield "glare over both markers", replace(slow, lamps=[Lamp(middle, 75.0)]), "glare -hand -jump"
    yield "glare over a fast stick", replace(one, lamps=[Lamp((420.0, 150.0), 60.0)]), "glare -hand -jump"
    for depth in (0.15, 0.5, 0.9):
        # By the truth dim frames err 1.2 times as much as bright ones at 50 %.
        yield f"flicker {depth:.0%}", replace(slow, flicker=depth), "flicker" if depth == 0.9 else "-flicker"
    yield "flicker 60%, noise 5, lossless", replace(slow, flicker=0.6, noise=5.0, crf=None), "flicker"
    yield (
        "swing in and out of a lamp's light, no flicker",
        replace(one, angle_deg=swing(170.0, 120.0, 0.6), exposure=0.6),
        "-flicker",
    )


def _repeated(one: Film) -> Drawn:
    """Give films converted to another rate of frames."""
    swings = replace(one, angle_deg=swing(70.0, 160.0, 3.0))
    for rate in (24.0, 15.0):
        yield (
            f"{rate:g} pictures per s shown as 30",
            replace(swings, shown=lambda t, r=rate: np.floor(t * r + 1e-6) / r),
            "repeats",
        )
    for every in (12, 4):
        repeat = lambda t, e=every: (np.rint(t * 30.0) - (np.rint(t * 30.0) % e == e - 1)) / 30.0  # noqa: E731
        yield f"every {every}th picture repeated", replace(swings, shown=repeat), "repeats"


def _clicked(one: Film) -> Drawn:
    """Give films with markers given at places that are none."""
    slow = replace(one, angle_deg=swing(160.0, 130.0, 5.0))
    for aside in (25.0, 60.0):
        screw = {"screws": [(0, 125.0, aside)], "clicked": {1: 0}}
        yield f"screw {aside:g} px beside the base given", replace(slow, **screw), "stick?"
    yield (
        "screw 40 px beside the moving stick given",
        replace(slow, screws=[(1, 120.0, 40.0)], clicked={3: 0}),
        "stick?",
    )
    half = {"overhang": 0.0, "texture": 2.0}
    yield "dots half over ground like them", replace(slow, ground=45.0, **half), "unlike"
    yield "dots half over ground near to them", replace(slow, ground=75.0, **half), "-hand"


def _starts(one: Film) -> Drawn:
    """Give starts that make the choice of the markers hard; nothing is given."""
    found = replace(one, given=False)
    rest = replace(
        found, exposure=0.8, angle_deg=lambda t: 180.0 + 60.0 * (1.0 - np.cos(7.0 * np.maximum(t - 0.2, 0.0)))
    )
    yield "found, abrupt start in one line", rest, "-rivals"
    # A sum of ramps: a remainder and a quotient may be rounded to different sides of a step.
    steps = np.arange(-1, 13)
    jumps = lambda t: 145.0 + 35.0 * np.clip((t[..., None] - 0.45 * steps - 0.37) / 0.08, 0.0, 1.0).sum(axis=-1)  # noqa: E731
    yield "found, steps from rest to rest", replace(found, exposure=0.5, angle_deg=jumps), "-rivals"
    later = replace(
        found,
        exposure=0.9,
        angle_deg=lambda t: 60.0 + 500.0 * np.maximum(t - 1.0, 0.0) - 450.0 * np.maximum(t - 3.0, 0.0),
    )
    yield "found, at rest, then 500 degrees/s", later, "shutter -late"
    hand = Hand(0.0, 1.2, _middle_of(found, 0, 0.0), LEFT, in_s=0.2)
    yield "found, a hand over the base at first", replace(found, covers=[replace(hand, start_s=-1.0)]), "-rivals"
    yield (
        "found, a hand over all at first",
        replace(found, covers=[replace(hand, start_s=-1.0, to_px=(322.0, 238.0), palm_px=170.0)]),
        "late",
    )
    yield (
        "found, at first too fast to be seen",
        replace(found, exposure=0.95, angle_deg=lambda t: 40.0 + 1500.0 * np.minimum(t, 1.0) + 40.0 * t),
        "-late",
    )
    tails = [(0, -26.0, 0.0), (1, -24.0, 0.0)]
    start = lambda t: 60.0 + 200.0 * np.maximum(t - 1.6, 0.0)  # noqa: E731
    for target in (0, 1):
        hidden = replace(found, angle_deg=start, exposure=0.8, covers=[Cover(0.1, 1.5, target, 24.0, 128.0)])
        yield f"found, base dot {target} hidden from 0.1 s on", hidden, "-rivals"
        both = {"screws": [(0, -26.0, 0.0), (1, -24.0, 0.0)]}
        yield f"the same, screws on the tails, {target}", replace(hidden, **both), "-rivals"
        line = replace(hidden, angle_deg=lambda t: 180.0 + 200.0 * np.maximum(t - 1.6, 0.0))
        yield f"the same, in one line, {target}", line, "-rivals"
    over = replace(found, angle_deg=lambda t: 60.0 * np.maximum(t - 0.8, 0.0))
    yield "found, over the base at first", over, "-rivals"
    sides = [(0, -58.0, 0.0), (1, -52.0, 0.0)]
    yield "found, dots on both sides of the axis", replace(found, screws=sides), "-rivals"
    yield "the same, half a turn", replace(found, screws=sides, angle_deg=swing(160.0, 130.0, 5.0)), "-rivals"
    yield "found, the axis between the base's dots", replace(found, base_px=(-70.0, 150.0)), "-rivals"
    yield "found, the axis between the moving stick's", replace(found, moving_px=(-70.0, 138.0)), "-rivals"
    paper = {name: getattr(found, name) for name in ("name", "frames", "seed", "camera", "given")}
    for count in (20, 50):
        yield f"found, dots, {count} letters around", LettersAndDots(angle_deg=SLOW, letters=count, **paper), "-rivals"
    yield "found, a screw on each stick's tail", replace(found, screws=tails), "-rivals"
    yield (
        "found, screws on the base's tail and side",
        replace(found, screws=[(0, -26.0, 0.0), (0, -100.0, 30.0), (0, 100.0, -60.0)]),
        "-rivals",
    )


def _covered(one: Film) -> Drawn:
    """Give films of the base under a moving stick of the same arms that is not seen itself."""
    same = replace(
        one, moving_px=one.base_px, angle_deg=lambda t: np.interp(t, [0.0, 1.5, 3.5, 5.0], [60.0, 0.0, 0.0, -60.0])
    )
    yield "same arms, rests over the base", same, "-jump"
    hand = Hand(1.2, 3.2, _middle_of(one, 0, 0.0), LEFT, in_s=0.3)
    yield "same arms, rests over the base under a hand", replace(same, covers=[hand]), "hand -jump"
    past = replace(one, moving_px=one.base_px, angle_deg=lambda t: 70.0 - 28.0 * t)
    yield "same arms, slowly past the base under a hand", replace(past, covers=[hand]), "hand -jump"
    yield (
        "same arms, past the base, shutter 0.9",
        replace(past, angle_deg=lambda t: 100.0 - 100.0 * t, exposure=0.9),
        "-jump",
    )
    for half_px in (1.5, 4.0):
        wire = Cover(0.5, 4.0, 3, half_px, 25.0)
        yield (
            f"two cameras, a wire of {2 * half_px:g} px in one",
            replace(one, tilt_deg=9.0, covers=[replace(wire, follows=False)]),
            "-jump",
        )
    yield "rests 4 s, moves 1 s", replace(one, angle_deg=lambda t: 60.0 + 80.0 * np.clip(t - 2.0, 0.0, 1.0)), ""
    yield (
        "rests 9 s, moves 1 s, CRF 28",
        replace(one, frames=2 * one.frames, crf=28, angle_deg=lambda t: 60.0 + 80.0 * np.clip(t - 2.0, 0.0, 1.0)),
        "",
    )


# --- tags and texture -------------------------------------------------------------------------------------------------

TAGS = {"kind": "tag", "family": "4X4_50", "base_id": 0, "moving_id": 1}


def _flat(frames: int) -> Iterator[Made]:
    """Give films of tags and of textured sticks."""
    half = {"frames": frames // 2, "size": (480, 420)}
    slow = {"angle_deg": lambda t: 80.0 + 30.0 * t}
    for wander in (0.6, 1.2):
        inked = _inked(wander)
        yield Made(f"tags, ink {wander:g}", FlatFilm(*inked, **slow, **half), "", TAGS, floating=True)
        hand = [flat_films.Hand(frames // 4, frames, (-150.0, 30.0), radius_mm=16.0, level=200.0)]
        yield Made(
            f"tags, ink {wander:g}, then a corner covered",
            FlatFilm(*inked, hands=hand, **slow, **half),
            "",
            TAGS,
            floating=True,
        )
        hand = [flat_films.Hand(0, frames // 4, (-104.0, -16.0), radius_mm=9.0, level=180.0)]
        yield Made(
            f"tags, ink {wander:g}, first a corner covered",
            FlatFilm(*inked, hands=hand, **slow, **half),
            "",
            TAGS,
            floating=True,
        )
    start = {"angle_deg": lambda t: 60.0 + 150.0 * np.maximum(t - 0.3, 0.0) ** 2, "frames": 45, "size": (480, 420)}
    for exposure in (0.5, 0.95):
        yield Made(f"tags, from rest, exposed {exposure:g}", FlatFilm(*_tags(), exposure=exposure, **start), "", TAGS)
        yield _textured(f"texture, from rest, exposed {exposure:g}", exposure=exposure, **start)
    for wide in (30, 21, 15):
        yield _textured(f"texture, {wide} px wide on rough ground", high=wide * 3, grain=40.0, **slow, **half)
    for row_s in (15e-3 / 420, 30e-3 / 420):
        fast = {"angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(22.0 / 120.0) * t, **half}
        yield Made(
            f"tags, 22 px per frame, rows {1e3 * 420 * row_s:g} ms",
            Rolling(*_tags(), row_s=row_s, exposure=0.3, **fast),
            "",
            TAGS,
        )
    for exposure in (0.3, 0.8):
        fast = {"angle_deg": lambda t: 60.0 + 30.0 * np.rad2deg(30.0 / 120.0) * t, **half}
        yield Made(
            f"tags, 30 px per frame, exposed {exposure:g}", FlatFilm(*_tags(), exposure=exposure, **fast), "", TAGS
        )
    for spot in (5, 9):
        yield _textured(
            f"texture, spots of {spot} px on blank sticks, uneven light", spot=spot, light=1.2, **slow, **half
        )
    past = {"angle_deg": lambda t: 45.0 - 36.0 * t}
    yield _textured("texture, slowly past the base", **past, **half)
    yield _textured(
        "texture, rests over the base",
        angle_deg=lambda t: np.interp(t, [0.0, 0.8, 1.8, 2.5], [50.0, 0.0, 0.0, 50.0]),
        **half,
    )
    for teeth in (48, 24):
        wheel = Sprite(_wheel(teeth), along_mm=0.0, width_mm=340.0)
        base = Sprite(texture_picture(np.random.default_rng(1), 110, 200), along_mm=205.0, width_mm=60.0)
        film = FlatFilm([base], [wheel], **{**half, "size": (560, 420)}, angle_deg=lambda t: 60.0 + 25.0 * t)
        given = (
            [film.on_stick(0, 60.0, at).tolist() for at in (190.0, 220.0)],
            [film.on_stick(1, 60.0, at).tolist() for at in (90.0, 150.0)],
        )
        yield Made(
            f"texture, wheel of {teeth} like marks",
            film,
            "alike",
            {"kind": "texture", "base": given[0], "moving": given[1]},
            floating=True,
        )
    on_texture = _textured("dots given on texture", **slow, **half)
    yield on_texture._replace(told="unlike", hints={**(on_texture.hints or {}), "kind": "dot"})
    yield _textured("texture, glare from frame 30 on", kind=Glaring, **slow, **half)._replace(told="glare")
    for along in (60.0, 150.0):
        yield _textured(
            f"texture, a sheet slides over the base at {along:g}", kind=Sliding, slides=along, **slow, **half
        )
    for count in (20, 50):
        yield Made(
            f"tags found, {count} letters around",
            Letters(*_tags(), letters=count, **slow, **{**half, "size": (640, 480)}),
        )
    yield Made("tags of 4X4_1000 found", FlatFilm(*_tags("4X4_1000", (612, 907)), **slow, **half))
    yield Made("tags found, mirrored", FlatFilm(*_tags(), mirrored=True, **slow, **half), "mirrored")
    yield Made("tags, numbers found", FlatFilm(*_tags("5X5_50", (3, 8)), **slow, **half))


def _tags(family: str = "4X4_50", numbers: tuple[int, int] = (0, 1)) -> tuple[list[Sprite], list[Sprite]]:
    base, moving = ([Sprite(**tag(family, number, side_mm=48.0, along_mm=120.0))] for number in numbers)
    return base, moving


def _inked(wander: float) -> list[list[Sprite]]:
    """Two tags whose edges wander by some units of 0.5 px."""
    rng, inked = np.random.default_rng(5), []
    for number in (0, 1):
        sprite = tag("4X4_50", number, side_mm=48.0, along_mm=120.0)
        rows, columns = sprite["picture"].shape
        y, x = np.mgrid[:rows, :columns].astype(np.float32)
        by = [cv2.GaussianBlur(rng.normal(size=(rows, columns)).astype(np.float32), (0, 0), 5.0) for _ in "xy"]
        at = [axis + 2.0 * wander * one / one.std() for axis, one in zip((x, y), by, strict=True)]
        sprite["picture"] = cv2.remap(sprite["picture"], *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        inked.append([Sprite(**sprite)])
    return inked


def _textured(name: str, *, high: int = 110, spot: int = 0, kind: type[FlatFilm] = FlatFilm, **how: Any) -> Made:
    """Return a film of two textured sticks, with points on them."""
    sticks = [
        [Sprite(texture_picture(np.random.default_rng(seed), high, 500), along_mm=100.0, width_mm=170.0)]
        for seed in (1, 2)
    ]
    if spot:
        blank = np.full((high, 500), 150.0, np.float32)
        for column in (132, 397):
            cv2.ellipse(blank, (column, high // 2), (3 * spot, 2 * spot), 30.0, 0.0, 360.0, 50.0, -1)
        sticks = [[replace(stick[0], picture=blank)] for stick in sticks]
    film = kind(*sticks, **how)
    places = [
        [film.on_stick(stick, float(film.truth_deg[0]), along).tolist() for along in (60.0, 150.0)] for stick in (0, 1)
    ]
    return Made(name, film, "", {"kind": "texture", "base": places[0], "moving": places[1]}, floating=True)


def _wheel(teeth: int) -> np.ndarray:
    """Return a disc with like radial marks."""
    y, x = np.mgrid[-340:341, -340:341].astype(np.float32) / 2.0
    radius, turn = np.hypot(x, y), np.arctan2(y, x)
    marks = 150.0 + 60.0 * np.sign(np.cos(teeth * turn)) * np.sign(np.sin(radius / 9.0))
    return np.where(radius < 168.0, cv2.GaussianBlur(marks, (0, 0), 1.2), 150.0).astype(np.float32)


class Glaring(FlatFilm):
    """A lamp is mirrored in the whole moving stick from a frame on."""

    def sprites(self, number: int) -> tuple[list[Sprite], list[Sprite]]:
        """Those of the base and of the moving stick in a frame."""
        blank = Sprite(np.full((8, 16), 250.0, np.float32), along_mm=100.0, width_mm=170.0)
        return self.base, [*self.moving, *[blank] * (number >= 30)]


@dataclass
class Sliding(FlatFilm):
    """A sheet with texture slides along over a place on the base, at 1.5 px per frame."""

    slides: float = 60.0

    def sprites(self, number: int) -> tuple[list[Sprite], list[Sprite]]:
        """Those of the base and of the moving stick in a frame."""
        sheet = Sprite(
            texture_picture(np.random.default_rng(9), 100, 100), self.slides, 34.0, across_mm=75.0 - 1.5 * number
        )
        return [*self.base, sheet], self.moving


@dataclass
class Letters(FlatFilm):
    """Black squares with random modules lie around, as letters are."""

    letters: int = 20

    def pictures(self) -> Iterator[np.ndarray]:
        """Draw the frames."""
        return _with_letters(super().pictures(), self.letters)


@dataclass(frozen=True)
class LettersAndDots(Film):
    """Black squares with random modules lie around dots."""

    letters: int = 20

    def pictures(self) -> Iterator[np.ndarray]:
        """Draw the frames."""
        return _with_letters(super().pictures(), self.letters)


def _with_letters(pictures: Iterator[np.ndarray], letters: int) -> Iterator[np.ndarray]:
    """Draw so many black squares with random modules along the borders of pictures 640 px wide."""
    rng = np.random.default_rng(7)
    places = [(row, column) for row in (8, 56, 372, 420) for column in range(8, 590, 44)]
    places = [places[k] for k in rng.permutation(len(places))[:letters]]
    squares = [np.where(np.kron(np.pad(rng.random((4, 4)) < 0.5, 1), np.ones((6, 6))), 225.0, 30.0) for _ in places]
    for picture in pictures:
        for (row, column), square in zip(places, squares, strict=True):
            picture[row - 4 : row + 40, column - 4 : column + 40] = 225
            picture[row : row + 36, column : column + 36] = cv2.GaussianBlur(square, (0, 0), 0.6)
        yield picture


@dataclass
class Rolling(FlatFilm):
    """The rows are read one after the other, in bands."""

    row_s: float = 0.0

    def pictures(self) -> Iterator[np.ndarray]:
        """Draw the frames."""
        edges = list(itertools.pairwise(np.linspace(0, self.size[1], 15).astype(int)))
        plain = [FlatFilm.pictures(_later(self, 0.5 * (first + end - 1) * self.row_s)) for first, end in edges]
        for parts in zip(*plain, strict=True):
            yield np.concatenate([part[a:b] for part, (a, b) in zip(parts, edges, strict=True)])


def _later(film: FlatFilm, by_s: float) -> FlatFilm:
    return replace(film, angle_deg=lambda t: film.angle_deg(t + by_s))


if __name__ == "__main__":
    main()
