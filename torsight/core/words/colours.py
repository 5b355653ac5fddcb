"""Colours by their meaning, the same in the report, the viewer, on the page for picking markers, and in pictures.

The seven meaningful colours of the report are distinguishable for people with colour blindness
(``tests/report/plots/test_colours.py``).
"""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]
"""Red, green, blue: 0 to 255."""

LIGHT: Final = {
    "paper": "#ffffff",
    "card": "#f6f7f9",
    "ink": "#16191d",
    "muted": "#5b6470",
    "rule": "#dfe3e8",
    "measured": "#9aa3ad",
    "before": "#d55e00",
    "after": "#0072b2",
    "spring-a": "#b5548a",
    "spring-b": "#007f5c",
    "held": "#e69f00",
    "lost": "#6b7480",
    "alarm": "#a33d00",
    "quiet": "#b4bcc6",
}
"""Colours by their meaning; every value occurs once, so that a colour has one meaning."""

DARK: Final = {
    "paper": "#14171b",
    "card": "#1d2127",
    "ink": "#eceff3",
    "muted": "#a3adb9",
    "rule": "#333a43",
    "measured": "#7b8694",
    "before": "#f0883e",
    "after": "#56b4e9",
    "spring-a": "#e39bc4",
    "spring-b": "#3ccfa0",
    "held": "#f0c050",
    "lost": "#97a2af",
    "alarm": "#f0a070",
    "quiet": "#566070",
}
"""The same for a dark screen, and for the viewer."""


def rgb(colour: str) -> Colour:
    """Return a colour of a style sheet as red, green and blue."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


BASE_COLOUR: Final = rgb(DARK["spring-b"])
MOVING_COLOUR: Final = rgb(DARK["after"])
GIVEN_COLOUR: Final[Colour] = (240, 228, 66)
"""Colour of given and of measured quantities, beside those of the sticks."""


def hex_of(colour: Colour) -> str:
    """Return a colour as CSS and matplotlib write it."""
    return f"#{bytes(colour).hex()}"
