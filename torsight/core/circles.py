"""Circles of two markers about one axis as one camera sees them, and the geometry that any axis needs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.hanging import hanging_errors
from torsight.core.minimise import least_squares

Floats = NDArray[np.float64]

_ENOUGH: Final = 1e-6


def axis_basis(direction: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors u, v across the axis, u nearest to the picture's right and v to its top.

    An angle that grows from u to v is counter-clockwise as displayed, for a direction towards the camera.
    """
    u = np.array([1.0, 0.0, 0.0]) - direction[0] * direction
    if np.linalg.norm(u) < 1e-6:
        u = np.array([0.0, 0.0, 1.0]) - direction[2] * direction
    u /= np.linalg.norm(u)
    return u, np.cross(direction, u)


@dataclass(frozen=True, slots=True, eq=False)
class Circles:
    """A fit of both markers' circles to their lines of sight.

    ``values``: tilt against ``frame`` (2), where the axis meets the plane one in front of the lens (2), both radii, the
    angle between. ``whiten`` takes the rows of residuals to independent ones.
    """

    lines: Floats
    spread: Floats
    frame: Floats
    values: Floats
    whiten: Floats | None = None
    covariance: Floats = field(default_factory=lambda: np.zeros((7, 7)))
    chi_squared: float = np.inf

    @classmethod
    def begun(cls, lines: Floats, spread: Floats, direction: Floats) -> Circles:
        """Begin with a direction of the axis."""
        point = common_centre(on_unit_plane(lines, direction, lines.mean(axis=(0, 1))), direction)
        point = point / point[2]
        polar = polar_of(lines, direction, point)
        between = float(np.angle(np.exp(1j * (polar[:, 1, 1] - polar[:, 0, 1])).mean()))
        values = np.array([0.0, 0.0, point[0], point[1], *polar[..., 0].mean(axis=0), between])
        return cls(lines, spread, np.stack((*axis_basis(direction), direction)), values)

    @property
    def direction(self) -> Floats:
        """Direction of the axis."""
        return tilted(self.frame, self.values[:2])

    @property
    def point(self) -> Floats:
        """Point on the axis."""
        return np.array([self.values[2], self.values[3], 1.0])

    def misfit(self, values: Floats) -> Floats:
        """Return by how much radii and the angle between are off (n, 3), in units of white noise."""
        direction = tilted(self.frame, values[:2])
        centre = np.array([values[2], values[3], 1.0])
        polar = polar_of(self.lines, direction, centre)
        # Differences of r1, r2 and the angle between, with their covariance through each marker's own two rays.
        apart = polar[:, 1, 1] - polar[:, 0, 1] - values[6]
        error = np.stack(
            (polar[:, 0, 0] - values[4], polar[:, 1, 0] - values[5], np.angle(np.exp(1j * apart))), axis=-1
        )
        slopes = polar_slopes(self.lines, direction, centre)
        joint = np.zeros((len(self.lines), 3, 4))
        joint[:, 0, :2], joint[:, 2, :2] = slopes[:, 0, 0], -slopes[:, 0, 1]
        joint[:, 1, 2:], joint[:, 2, 2:] = slopes[:, 1, 0], slopes[:, 1, 1]
        both = np.zeros((len(self.lines), 4, 4))
        both[:, :2, :2], both[:, 2:, 2:] = self.spread[:, 0], self.spread[:, 1]
        return whitened(error, joint @ both @ np.swapaxes(joint, -1, -2)).reshape(-1, 3)

    def weighed(self, *, usual: float) -> Circles:
        """Return the fit with residuals taken as they hang together; see :mod:`torsight.core.hanging`."""
        polar = polar_of(self.lines, self.direction, self.point)
        return replace(self, whiten=hanging_errors(polar[:, 1, 1], self.misfit, self.values, usual=usual).whiten)

    def fitted(self) -> Circles:
        """Return the best fit."""

        def residuals(values: Floats) -> Floats:
            error = self.misfit(values)
            return np.asarray(error if self.whiten is None else self.whiten @ error).ravel()

        values, covariance, chi_squared = least_squares(residuals, self.values, enough=_ENOUGH)
        return replace(self, values=values, covariance=covariance, chi_squared=chi_squared)


def on_unit_plane(lines: Floats, direction: Floats, through: Floats) -> Floats:
    """Return where lines of sight meet the plane across a direction through a point."""
    return np.asarray(lines * ((through @ direction) / (lines @ direction))[..., None])


def polar_of(lines: Floats, direction: Floats, point: Floats) -> Floats:
    """Return radius and angle (n, 2, 2) about the axis of where lines of sight meet the plane across it."""
    u, v = axis_basis(direction)
    away = on_unit_plane(lines, direction, point) - point
    x, y = away @ u, away @ v
    return np.stack((np.hypot(x, y), np.arctan2(y, x)), axis=-1)


def polar_slopes(lines: Floats, direction: Floats, point: Floats) -> Floats:
    """Return the derivative (n, 2, 2, 2) of radius and angle with respect to the ray."""
    u, v = axis_basis(direction)
    reach = (lines @ direction)[..., None]
    place = lines * ((point @ direction) / reach)
    away = place - point
    x, y = (away @ u)[..., None], (away @ v)[..., None]
    # d place / d ray_i = (D/reach)·(e_i − line·direction_i/reach)
    depth = (point @ direction) / reach
    by_ray_u = depth * (u[:2] - (lines @ u)[..., None] * direction[:2] / reach)
    by_ray_v = depth * (v[:2] - (lines @ v)[..., None] * direction[:2] / reach)
    radius = np.hypot(x, y)
    return np.stack(((x * by_ray_u + y * by_ray_v) / radius, (x * by_ray_v - y * by_ray_u) / radius**2), axis=-2)


def common_centre(position: Floats, direction: Floats) -> Floats:
    """Return the centre of circles of several markers about one axis, by linear least squares."""
    u, v = axis_basis(direction)
    middle = position.mean(axis=(0, 1))
    x, y = (position - middle) @ u, (position - middle) @ v
    markers = x.shape[1]
    own = np.broadcast_to(np.eye(markers), (*x.shape, markers))
    design = np.concatenate((2.0 * x[..., None], 2.0 * y[..., None], own), axis=-1).reshape(-1, 2 + markers)
    answer = np.linalg.lstsq(design, (x**2 + y**2).ravel(), rcond=None)[0]
    return np.asarray(middle + answer[0] * u + answer[1] * v)


def tilted(frame: Floats, tilt: Floats) -> Floats:
    """Return a direction that is tilted against the third vector of a frame."""
    vector = tilt[0] * frame[0] + tilt[1] * frame[1] + frame[2]
    return np.asarray(vector / np.linalg.norm(vector))


def whitened(error: Floats, covariance: Floats) -> Floats:
    """Return errors (..., k) in units in which their covariance is one, flat."""
    factor = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.solve(factor, error[..., None])).ravel()
