"""The variable of a law of the phase: the angle in the cosine of the phase law, in steps of the law's nodes."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.stepping.phase import SHARE_DONE
from torsight.core.units import Floats

IN_WINDOW: Final = 10
"""Steps of the phase law's angle through a window, a choice: 18° of the cosine's argument each."""
_PAST_WINDOW: Final = IN_WINDOW // 2
"""Steps beyond either end: three quarters of a window, in which transformations of other laws begin or end."""
OWN_STEPS: Final = np.arange(-_PAST_WINDOW, IN_WINDOW + _PAST_WINDOW + 1.0)
"""The nodes of one direction, heating or cooling."""
BRANCH: Final = len(OWN_STEPS) + 1.0
"""Offset in steps of the nodes of cooling from those of heating, in a law that has both."""


def phase_steps(place: Floats) -> Floats:
    """Return the phase law's angle at places in its window, in steps of the nodes: place = (1 − cos angle) / 2.

    Laws that begin or end with a power of the place are smooth functions of this angle. Beyond the window cosh replaces
    the cosine; beyond the nodes the last node's value holds.
    """
    inside = 2.0 * np.arcsin(np.sqrt(np.clip(place, 0.0, 1.0)))
    beyond = 2.0 * np.arcsinh(np.sqrt(np.maximum(0.0, np.maximum(place - 1.0, -place))))
    steps = (inside + np.where(place < 0.0, -beyond, beyond)) * IN_WINDOW / np.pi
    return np.clip(steps, -_PAST_WINDOW, IN_WINDOW + _PAST_WINDOW)


def phase_places(steps: Floats) -> Floats:
    """Return the inverse of :func:`phase_steps`."""
    angle = steps * np.pi / IN_WINDOW
    inside, beyond = np.sin(0.5 * np.clip(angle, 0.0, np.pi)), np.maximum(0.0, np.maximum(angle - np.pi, -angle))
    return np.asarray(inside**2 + np.where(angle < 0.0, -1.0, 1.0) * np.sinh(0.5 * beyond) ** 2)


def exponential_lead(place: Floats) -> Floats:
    """Return the lead of Tanaka's exponential over the cosine at places, in windows.

    The lead is the place at which the cosine has transformed the same share, minus the place. Before the window's start
    the function is continued without a kink.
    """
    same = np.arccos(1.0 - 2.0 * SHARE_DONE["tanaka"](np.abs(place))) / np.pi
    return np.asarray(np.sign(place) * same - place)
