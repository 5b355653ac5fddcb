"""Colours that mean something can be told apart by those who see fewer of them: report by day and night, and viewer."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest

from torsight.core.words.colours import DARK, LIGHT
from torsight.report.write import PAPER
from torsight.viewer.view_layout import SERIES

MEANING = ("measured", "before", "after", "spring-a", "spring-b", "held")
CLEAR = 10.0
"""Distance in CIELAB: over four times what is just noticed."""

# Machado, Oliveira and Fernandes (2009), severity 1, for linear sRGB.
SIGHT = {
    "all colours": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def seen(colour: tuple[int, ...], sight: str) -> np.ndarray:
    """Return CIELAB of a colour as it is seen."""
    share = np.array(colour) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    picture = np.clip(np.asarray(SIGHT[sight]) @ linear, 0.0, 1.0).astype(np.float32).reshape(1, 1, 3)
    return cv2.cvtColor(picture, cv2.COLOR_LRGB2Lab).reshape(3)


def meaning(colours: dict[str, str]) -> dict[str, tuple[int, ...]]:
    """Return the colours that mean something, as red, green and blue."""
    return {name: tuple(bytes.fromhex(colours[name][1:])) for name in MEANING}


def of_viewer(pane: str) -> dict[str, tuple[int, ...]]:
    # Both borders of a band are of one colour.
    return {one.name: one.colour for one in SERIES if one.entity.startswith(pane) and "above" not in one.entity}


PALETTES = {
    "report": meaning(LIGHT),
    "report by night": meaning(DARK),
    "report on paper": meaning(PAPER),
    "viewer, angle": of_viewer("angle/"),
    "viewer, residual": of_viewer("residual/"),
    "viewer, temperature": of_viewer("temperature/"),
}


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("palette", PALETTES)
def test_any_two_can_be_told_apart(palette: str, sight: str) -> None:
    colours = {name: seen(colour, sight) for name, colour in PALETTES[palette].items()}
    assert len(colours) > 1
    for one, other in itertools.combinations(colours, 2):
        assert np.linalg.norm(colours[one] - colours[other]) > CLEAR, (one, other)


def test_a_red_and_a_green_would_be_refused() -> None:
    assert np.linalg.norm(seen((160, 110, 0), "deuteranopia") - seen((120, 128, 0), "deuteranopia")) < CLEAR
    assert np.linalg.norm(seen((160, 110, 0), "all colours") - seen((120, 128, 0), "all colours")) > CLEAR
