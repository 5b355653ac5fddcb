"""Smooth random laws for the rigs of the blind suite: what a rig may hide that no library names."""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.synthetic.effects.rig_laws import NODES, RigLaw

_GROWS: Final = (("friction", "rate"), ("friction", "dwell"))
_LINEAR: Final = (("reading", "time"), ("recoverable", "half_cycle"), ("recoverable", "cycle"))
_SHORTEST, _LONGEST = 0.1, 0.5


def draw_law(
    port: str, driver: str, *, start: float, stop: float, rng: np.random.Generator, spring: str = "both"
) -> RigLaw:
    """Draw a law from a Gaussian process with a Gaussian kernel; its largest value is 1.

    The length is drawn between 1/10 and 1/2 of the range. Over cycles and time a straight line of random slope is
    added. Friction over rate and over dwell only grows, from 0 on: one that falls makes the motion unstable, and what
    is drawn then is the logarithm of its slope.
    """
    place = np.linspace(0.0, 1.0, NODES)
    length = rng.uniform(_SHORTEST, _LONGEST)
    kernel = np.exp(-0.5 * ((place[:, None] - place) / length) ** 2)
    values = np.linalg.cholesky(kernel + 1e-9 * np.eye(NODES)) @ rng.standard_normal(NODES)
    if (port, driver) in _LINEAR:
        values += 2.0 * rng.standard_normal() * (place - 0.5)
    if (port, driver) in _GROWS:
        values = np.concatenate([[0.0], np.cumsum(np.exp(values[1:]))])
    return RigLaw(port, driver, start, stop, values / np.max(np.abs(values)), spring)
