"""Colours of the page and its plots: for a light screen, a dark one, and paper.

The seven that carry a meaning stay apart for people who see fewer colours (``tests/report/plots/test_colours.py``).
"""

from __future__ import annotations

from typing import Final

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
"""Colours by their meaning; every value is used once, so that a colour tells its meaning."""

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

PAPER: Final = {**LIGHT, "card": "#ffffff", "ink": "#000000", "muted": "#444444", "rule": "#bbbbbb"}


def style_variables() -> str:
    """Return the colours as variables of a style sheet."""
    return (
        f":root {{ color-scheme: light dark; {_variables(LIGHT)} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {_variables(DARK)} }} }}\n"
        f"@media print {{ :root {{ color-scheme: light; {_variables(PAPER)} }} }}\n"
    )


def at_night() -> dict[str, str]:
    """Return the dark screen's colour for each one of the light screen."""
    return {LIGHT[name]: DARK[name] for name in LIGHT}


def _variables(colours: dict[str, str]) -> str:
    return " ".join(f"--{name}: {value};" for name, value in colours.items())
