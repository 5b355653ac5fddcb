"""Which two of several pairs of dots are the sticks: what the film's motion says of each couple of pairs.

Dots that look like a stick's markers may lie on a ruler or a frame beside the rig. A picture does not tell them from
the markers; the film does. Of a rig is known that its base stands, that its moving stick goes around an axis, and that
both sticks run to that axis. So every pair is followed by itself, and a couple (base i, moving j) explains the film by

    −2 ln p = s_i + t_j − s_j + δ_ij² / σ_j² + ln σ_j² − 2 ln f_ij / (1 − f_ij),    σ_j² = r² + δ_jj² + σ_c²

up to a constant of all couples. s_k and t_k are χ² of pair k as one that stands and as one that goes around circles, of
a usual frame (what errs is correlated over a film, and counts once; in some frames the other stick lies over a pair).
δ_ij is how far the axis that pair j shows lies beside the line of pair i. Markers are put on the middle of a stick
within their radius r, and sticks of one rig are made alike: as far as the axis is beside the moving stick's own line it
may be beside the base's. σ_c is what is not known of the axis; of a stick that hardly turned that is all, and no couple
is better than another. f_ij is the share of the line from pair i to the axis that is as bright as a stick: a stick goes
on to the axis, and what lies elsewhere does not. It counts once the axis is known to a marker's radius.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.detect.sticks import Stick, reaches, towards_axis
from tracker.follow.followed_dots import DotState
from tracker.follow.marker import markers_on
from tracker.follow.motion_model import STALE
from tracker.follow.rotation_axis import STANDS_PX, axis_weight, suppose_axis
from tracker.frames.frame import Frame
from tracker.innovation import SURE
from tracker.rows import SEEN

Places = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Couple:
    """Two pairs of dots as base and moving stick, inner markers first, and how likely they are among all couples."""

    base: Stick
    moving: Stick
    probability: float

    def swaps(self, other: Couple) -> bool:
        """Return whether the base here is the moving stick there, and the other way round."""
        return self.base.is_of(other.moving) and self.moving.is_of(other.base)

    def to_json(self) -> dict[str, Any]:
        """Return what ``track.json`` says of it, as in a marker file."""
        sticks = {name: stick.places_px for name, stick in (("base", self.base), ("moving", self.moving))}
        return {**sticks, "probability": self.probability}


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """What a pair's readings say: χ² if it stands and if it turns, about which axis (2,), and how far its line is off.

    ``variance_px2`` is that of the axis; px.
    """

    stands: float
    turns: float
    axis: Floats
    variance_px2: float
    beside_px: float


def weigh_couples(
    luma: NDArray[np.uint8], couples: Sequence[tuple[Stick, Stick]], frames: Iterable[Frame]
) -> list[Couple]:
    """Return couples of pairs, each with either as the base, the likeliest first.

    ``luma`` is the picture in which they were found, ``frames`` are those after it: they are taken until a couple is as
    sure as :data:`tracker.innovation.SURE`, or to their end. Couples of which the film tells nothing keep their
    order.
    """
    pairs = {id(pair): pair for couple in couples for pair in couple}
    states = {key: DotState(markers_on(luma, pair)) for key, pair in pairs.items()}
    places: dict[int, list[Places]] = {key: [] for key in pairs}
    height, width = luma.shape

    def weighed() -> list[Couple]:
        motion = {key: _motion(state, places[key], (width, height)) for key, state in states.items()}
        return _weighed(luma, couples, motion)

    for number, frame in enumerate(frames, 1):
        if frame.luma is not None:
            for key, state in states.items():
                seen = state.step(frame.luma, frame.time_s, np.zeros(2))
                if (seen["state"] == SEEN).all():
                    places[key].append(seen["x"] + 1j * seen["y"])
        if number % STALE == 0 and (found := weighed())[0].probability > SURE:
            return found
    return weighed()


def _weighed(
    luma: NDArray[np.uint8], couples: Sequence[tuple[Stick, Stick]], motion: dict[int, _Motion]
) -> list[Couple]:
    both = [pair for one, two in couples for pair in ((one, two), (two, one))]
    score = np.array([_score(luma, base, motion[id(base)], motion[id(moving)]) for base, moving in both])
    chance = np.exp(score - score.max())
    chance /= chance.sum()
    found: list[Couple] = []
    for index in np.argsort(-chance, kind="stable").tolist():
        base, moving = both[index]
        found.append(Couple(*_inner_first(base, moving, motion[id(moving)]), probability=float(chance[index])))
    return found


def _inner_first(base: Stick, moving: Stick, motion: _Motion) -> tuple[Stick, Stick]:
    """Return a couple with the markers nearer to the axis first: that of the motion, or where both lines cross."""
    if math.sqrt(motion.variance_px2) > moving.length_px:
        return towards_axis(base, moving)
    x, y = motion.axis.tolist()
    return base.towards(x, y), moving.towards(x, y)


def _motion(state: DotState, places: Sequence[Places], size_px: tuple[int, int]) -> _Motion:
    """Return what the places (n, 2), complex, of a pair say; nothing in favour of anything where it was never seen."""
    width, height = size_px
    axis = state.scene.sticks["axis"][0].copy()
    # Before anything moves the axis may be anywhere around the middle of the picture.
    anywhere_px2 = 0.25 * (width**2 + height**2)
    suppose_axis(axis, 0.5 * width, 0.5 * height, math.sqrt(anywhere_px2))
    if not places or not axis["known"]:
        return _Motion(0.0, 0.0, np.array([0.5 * width, 0.5 * height]), anywhere_px2, 0.0)
    at, arms = np.array(places), axis["arm"][:, 0] + 1j * axis["arm"][:, 1]
    stick = at[:, 1] - at[:, 0]
    left = at - complex(*axis["centre"]) - (stick / np.abs(stick))[:, None] * arms
    middle = np.median(at.real, axis=0) + 1j * np.median(at.imag, axis=0)
    stands, turns = (float(np.median(np.sum(np.abs(off) ** 2, axis=1))) / STANDS_PX**2 for off in (at - middle, left))
    # Arms are told along the line through both markers: what is across it is how far the axis is beside.
    return _Motion(stands, turns, axis["centre"], STANDS_PX**2 / axis_weight(axis), abs(float(arms.mean().imag)))


def _score(luma: NDArray[np.uint8], base: Stick, still: _Motion, moving: _Motion) -> float:
    """Return the logarithm of how well a couple explains the film, up to a constant of all couples."""
    x, y = moving.axis.tolist()
    ux, uy = (
        (base.outer.x_px - base.inner.x_px) / base.length_px,
        (base.outer.y_px - base.inner.y_px) / base.length_px,
    )
    beside_px = ux * (y - base.inner.y_px) - uy * (x - base.inner.x_px)
    radius_px = max(base.inner.radius_px, base.outer.radius_px)
    spread = radius_px**2 + moving.beside_px**2 + moving.variance_px2
    misfit = still.stands + moving.turns - moving.stands + beside_px**2 / spread
    seen: float = math.log(reaches(luma, base.towards(x, y), x, y)) if moving.variance_px2 < radius_px**2 else 0.0
    return float(seen - 0.5 * (misfit + math.log(spread)))
