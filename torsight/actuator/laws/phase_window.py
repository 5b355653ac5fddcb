"""The place in a transformation's window as the variable of a law: the phase law's own angle, in steps of its nodes."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.stepping.phase import SHARE_DONE
from torsight.core.units import Floats

IN_WINDOW: Final = 10
"""Steps of the phase law's angle through a window, a choice: 18° each, a tenth of a window of a cosine."""
_PAST_WINDOW: Final = 5
"""And so many beyond either end: three quarters of a window, in which transformations of other laws begin or end."""
OWN_STEPS: Final = np.arange(-_PAST_WINDOW, IN_WINDOW + _PAST_WINDOW + 1.0)
"""The nodes of one way."""
BRANCH: Final = len(OWN_STEPS) + 1.0
"""By how many steps cooling stands behind heating on the nodes of a law of both."""


def phase_steps(place: Floats) -> Floats:
    """Return the phase law's angle at places in its window, in steps of the nodes: (1 − cos) / 2 of it is the place.

    Laws that begin or end with a power of the place are smooth over it. Beyond the window cosh takes the cosine's
    place; beyond the nodes the last one stands.
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
    """Return by how many windows Tanaka's exponential is ahead of the cosine at places: where that has done as much.

    Before the start, where nothing is done, it goes on without a kink.
    """
    same = np.arccos(1.0 - 2.0 * SHARE_DONE["tanaka"](np.abs(place))) / np.pi
    return np.asarray(np.sign(place) * same - place)
