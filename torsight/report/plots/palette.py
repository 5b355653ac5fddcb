"""Colours of the page and its plots as a style sheet: for a light screen, a dark one, and paper."""

from __future__ import annotations

from typing import Final

from torsight.core.words.colours import DARK, LIGHT

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
