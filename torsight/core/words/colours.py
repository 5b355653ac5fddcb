"""Colours of the two sticks, the same in the viewer, on the page for picking markers, and in pictures."""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]
"""Red, green, blue: 0 to 255."""

BASE_COLOUR: Final[Colour] = (60, 207, 160)
MOVING_COLOUR: Final[Colour] = (86, 180, 233)


def hex_of(colour: Colour) -> str:
    """Return a colour as CSS and matplotlib write it."""
    return f"#{bytes(colour).hex()}"
