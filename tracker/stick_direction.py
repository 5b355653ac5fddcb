"""The direction of a stick from two of its points."""

from __future__ import annotations

import numpy as np

from torsight.core.units import Floats

Points = tuple[Floats, Floats]
"""Positions (n, 2) in a plane, and their covariances (n, 2, 2)."""


def stick_direction(inner: Points, outer: Points) -> tuple[Floats, Floats]:
    """Return the direction (n,) from a stick's inner to its outer marker, and its variance."""
    offset = outer[0] - inner[0]
    square = np.sum(offset**2, axis=1)
    across = np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    variance = np.einsum("ni,nij,nj->n", across, inner[1] + outer[1], across) / square**2
    return np.arctan2(offset[:, 1], offset[:, 0]), variance


def square(upper: Floats) -> Floats:
    """Return covariances (…, 2, 2) from their elements xx, xy, yy (…, 3), as stored in readings and rows."""
    return np.stack([upper[..., [0, 1]], upper[..., [1, 2]]], axis=-2)


def turned_by(points: Floats, angle_rad: Floats) -> Floats:
    """Return points (…, 2) turned about the origin from x towards y, each by its angle (…)."""
    cos, sin, x, y = np.cos(angle_rad), np.sin(angle_rad), points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
