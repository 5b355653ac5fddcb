"""Colours by their meaning, the same in the report, the viewer, on the page for picking markers, and in pictures.

The seven meaningful colours of the report are distinguishable for people with colour blindness
(``tests/report/plots/test_colours.py``).
"""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]
"""Red, green, blue: 0 to 255."""

_LIGHT_AND_DARK: Final = {
    "paper": ("#ffffff", "#14171b"),
    "card": ("#f6f7f9", "#1d2127"),
    "ink": ("#16191d", "#eceff3"),
    "muted": ("#5b6470", "#a3adb9"),
    "rule": ("#dfe3e8", "#333a43"),
    "measured": ("#9aa3ad", "#7b8694"),
    "before": ("#d55e00", "#f0883e"),
    "after": ("#0072b2", "#56b4e9"),
    "spring-a": ("#b5548a", "#e39bc4"),
    "spring-b": ("#007f5c", "#3ccfa0"),
    "held": ("#e69f00", "#f0c050"),
    "lost": ("#6b7480", "#97a2af"),
    "alarm": ("#a33d00", "#f0a070"),
    "quiet": ("#b4bcc6", "#566070"),
}
LIGHT: Final = {name: light for name, (light, _) in _LIGHT_AND_DARK.items()}
"""Colours by their meaning; every value occurs once, so that a colour has one meaning."""
DARK: Final = {name: dark for name, (_, dark) in _LIGHT_AND_DARK.items()}
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
