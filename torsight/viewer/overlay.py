"""Overlay of the film: markers, sticks, and the arc of the angle between the sticks; geometry without a viewer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.tracks import MARKERS
from torsight.core.units import Floats
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, MOVING_COLOUR, Colour
from torsight.core.words.wording import fixed

ARC_COLOUR: Final = GIVEN_COLOUR

ARC_STEP_RAD: Final = np.deg2rad(6.0)
"""Longest chord of the drawn arc."""


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """Overlay of one frame, in pixels of the picture.

    It holds the markers (k, 2) that were found, with their names; lines (2, 2) through both markers of a stick, base
    first, with the names of the sticks; the arc (m, 2) from the base stick to the moving stick, empty where the angle
    is not known, with the angle as a label.
    """

    points_px: Floats
    names: tuple[str, ...]
    sticks_px: tuple[Floats, ...]
    sticks: tuple[str, ...]
    arc_px: Floats
    label: str

    def strokes(self) -> tuple[list[Floats], list[Colour], list[str]]:
        """Return sticks and arc as lines, with their colours and labels."""
        lines = list(self.sticks_px)
        colours = [colour_of(stick) for stick in self.sticks]
        words = [""] * len(lines)
        if len(self.arc_px):
            lines.append(self.arc_px)
            colours.append(ARC_COLOUR)
            words.append(self.label)
        return lines, colours, words


def colour_of(name: str) -> Colour:
    """Return the colour of a stick, or of a marker on it, by its name."""
    return BASE_COLOUR if name.startswith("base") else MOVING_COLOUR


def overlay(position_px: Floats, angle_rad: float, *, scale: float) -> Overlay:
    """Return the overlay of one frame.

    Markers (4, 2) are in the film's pixels and the order of ``torsight.core.tracks.MARKERS``, the angle is positive
    counter-clockwise as displayed; NaN where not known. ``scale`` is the number of shown pixels per pixel of the film.
    """
    shown = position_px * scale
    found = np.asarray(np.isfinite(shown).all(axis=1))
    pairs = [(stick, shown[first : first + 2]) for stick, first in (("base", 0), ("moving", 2))]
    whole = [(stick, ends) for stick, ends in pairs if np.isfinite(ends).all()]
    arc = _arc(shown, angle_rad) if found.all() and np.isfinite(angle_rad) else np.empty((0, 2))
    degrees = f"{fixed(float(np.rad2deg(angle_rad)), 1)}°" if np.isfinite(angle_rad) else "angle not known"
    return Overlay(
        points_px=shown[found],
        names=tuple(name for name, good in zip(MARKERS, found.tolist(), strict=True) if good),
        sticks_px=tuple(ends for _, ends in whole),
        sticks=tuple(stick for stick, _ in whole),
        arc_px=arc,
        label=degrees,
    )


def _arc(shown: Floats, angle_rad: float) -> Floats:
    """Return the arc about the point where the two sticks' lines are nearest to their inner markers.

    Whole turns beyond the first are not drawn twice; the label carries them.
    """
    base, moving = shown[1] - shown[0], shown[3] - shown[2]
    centre = _crossing(shown[0], base, shown[2], moving)
    radius = 0.5 * min(
        np.hypot(*(shown[0] - centre)) + np.hypot(*base), np.hypot(*(shown[2] - centre)) + np.hypot(*moving)
    )
    start = np.arctan2(-base[1], base[0])
    turn = np.sign(angle_rad) * (abs(angle_rad) % (2.0 * np.pi))
    along = start + np.linspace(0.0, turn, max(2, int(abs(turn) / ARC_STEP_RAD) + 2))
    return np.column_stack([centre[0] + radius * np.cos(along), centre[1] - radius * np.sin(along)])


def _crossing(first: Floats, along: Floats, second: Floats, across: Floats) -> Floats:
    """Return the crossing of two lines, or the middle between their inner markers where they are nearly parallel."""
    determinant = along[0] * across[1] - along[1] * across[0]
    middle = (first + second) / 2.0
    if abs(determinant) < 0.05 * np.hypot(*along) * np.hypot(*across):
        return np.asarray(middle)
    gap = second - first
    step = (gap[0] * across[1] - gap[1] * across[0]) / determinant
    crossing = first + step * along
    # Two short sticks that are nearly aligned may cross far outside the rig.
    far = np.hypot(*(crossing - middle)) > 2.0 * max(np.hypot(*along), np.hypot(*across))
    return np.asarray(middle if far else crossing)
