"""Fit of the circles of two markers on one stick that turns about a fixed axis, from one camera or several.

Marker k of the stick moves on a circle; in the first camera's coordinates::

    X_k(θ) = p + h_k d + r_k (cos(θ + b_k) u + sin(θ + b_k) v),    h_1 = b_1 = 0

with d the axis' direction, p its intersection with the first marker's plane, and u, v across it (:func:`axis_basis`).
All frames share d, p, r, h and b; each frame has its own θ. The residuals are those of bundle adjustment (Triggs and
others, 2000): the markers' distances in the pictures from the projections of X_k, with each frame's θ optimised for the
shared values (variable projection; Golub and Pereyra, 1973). They are computed in ray coordinates, with covariances
propagated through the lens: to first order this is the same as in pixels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from torsight.core.minimise import least_squares
from torsight.core.optics.camera import Intrinsics
from torsight.core.optics.geometry import applied, carried, cross_matrix, homogeneous, ray_from_pixel
from torsight.core.optics.hanging import whitening
from torsight.core.series import BY_CHANCE, robust_sigma
from torsight.core.units import Flags, Floats


@dataclass(frozen=True, eq=False)
class Sight:
    """Both markers of a stick in the pictures of one camera.

    ``ray`` (n, 2, 2) is X/Z, Y/Z of the inner and the outer marker, NaN where not seen; ``covariance`` (n, 4, 4) is
    their joint covariance. Rotation and shift transform the first camera's coordinates to this camera's.
    """

    ray: Floats
    covariance: Floats
    rotation: Floats = field(default_factory=lambda: np.eye(3))
    shift: Floats = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(
        cls,
        position_px: Floats,
        covariance_px2: Floats,
        intrinsics: Intrinsics,
        *,
        shared_px2: Floats | None = None,
        rotation: Floats | None = None,
        shift: Floats | None = None,
    ) -> Sight:
        """Return the sights of a camera at pixel positions (n, 2, 2).

        ``covariance_px2`` (n, 2, 2, 2) is each marker's own covariance; ``shared_px2`` (n,) is the variance along each
        axis of an error that both markers share, such as that of a camera that moved.
        """
        ray, slope = ray_from_pixel(position_px, intrinsics)
        seen = np.asarray(np.isfinite(ray).all(axis=-1))
        ray = np.where(seen[..., None], ray, np.nan)
        slope = np.where(seen[..., None, None], slope, 0.0)
        own = carried(np.where(seen[..., None, None], covariance_px2, 1.0), slope)
        covariance = np.zeros((len(ray), 4, 4))
        for marker, part in enumerate((slice(0, 2), slice(2, 4))):
            # Where a marker is not seen, the variance is arbitrary: it is not used.
            covariance[:, part, part] = np.where(seen[:, marker, None, None], own[:, marker], np.eye(2))
        if shared_px2 is not None:
            both = slope.reshape(-1, 4, 2)
            covariance += shared_px2[:, None, None] * (both @ np.swapaxes(both, -1, -2))
        return cls(
            ray, covariance, np.eye(3) if rotation is None else rotation, np.zeros(3) if shift is None else shift
        )

    @cached_property
    def seen(self) -> Flags:
        """Mask (n, 2) of the markers that are seen."""
        return np.asarray(np.isfinite(self.ray[..., 0]))

    def rows(self, rows: NDArray[np.intp] | Flags) -> Sight:
        """Return the sight restricted to the given frames."""
        return replace(self, ray=self.ray[rows], covariance=self.covariance[rows])

    def without(self, marker: int) -> Sight:
        """Return the sight as if one marker had not been seen."""
        ray, covariance = self.ray.copy(), self.covariance.copy()
        part = slice(2 * marker, 2 * marker + 2)
        ray[:, marker] = np.nan
        covariance[:, part], covariance[:, :, part] = 0.0, 0.0
        covariance[:, part, part] = np.eye(2)
        return replace(self, ray=ray, covariance=covariance)

    @cached_property
    def precision(self) -> Floats:
        """Inverse (n, 4, 4) of the covariance; 0 for a marker that is not seen."""
        known = np.repeat(self.seen, 2, axis=1)
        return np.asarray(np.linalg.inv(self.covariance) * known[:, :, None] * known[:, None, :])

    @cached_property
    def lines(self) -> tuple[Floats, Floats]:
        """The camera's centre (3,) and the lines of sight (n, 2, 3) in the first camera's coordinates."""
        return -self.rotation.T @ self.shift, homogeneous(self.ray) @ self.rotation

    def error(self, points: Floats, along: Floats) -> tuple[Floats, Floats]:
        """Return the residuals (n, 2, 2) of points (n, 2, 3) from the markers, and their derivative along ``along``.

        Both are 0 for a marker that is not seen.
        """
        place, way = points @ self.rotation.T + self.shift, along @ self.rotation.T
        ray = place[..., :2] / place[..., 2:]
        slope = (way[..., :2] - ray * way[..., 2:]) / place[..., 2:]
        known = self.seen[..., None]
        return np.where(known, ray - self.ray, 0.0), np.where(known, slope, 0.0)


# Indices of the shared values.
_TILT, _POINT, _RADII = slice(0, 2), slice(2, 5), slice(5, 7)
_BETWEEN, _RISE, _VALUES = 7, 8, 9


def axis_basis(direction: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors u, v across the axis, u nearest to the picture's right and v to its top.

    An angle that grows from u to v is counter-clockwise as displayed, for a direction towards the camera.
    """
    u = np.array([1.0, 0.0, 0.0]) - direction[0] * direction
    # The direction of a vector shorter than the root of the rounding error would be rounding error.
    if u @ u < np.finfo(np.float64).eps:
        u = np.array([0.0, 0.0, 1.0]) - direction[2] * direction
    u /= math.sqrt(u @ u)
    return u, cross_matrix(direction) @ u


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """The stick's angle in every frame (n,): θ of the first marker about the axis, from u to v, within a turn.

    The angle is NaN where no marker is seen; its variance is that due to the pictures' errors alone. ``chi_squared`` is
    the misfit, ``freedom`` its degrees of freedom.
    """

    angle_rad: Floats
    variance_rad2: Floats
    chi_squared: Floats
    freedom: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Circles:
    """A fit of both markers' circles to the sights of the cameras, one sight per camera, with the same frames.

    ``frame`` (3, 3) holds u, v and the direction to which the tilt is relative. ``values`` are the tilt (2), the point
    on the axis in the first marker's plane (3), the radii (2), and angle and height of the second marker relative to
    the first. ``free`` marks those that are fitted: one camera does not determine the scale, and both markers are
    assumed to lie in one plane across the axis. ``whiten`` (n, n) transforms the rows of residuals to independent ones.
    """

    sights: Sequence[Sight]
    frame: Floats
    values: Floats
    free: Flags
    whiten: Floats | None = None
    covariance: Floats = field(default_factory=lambda: np.zeros((_VALUES, _VALUES)))
    chi_squared: float = np.inf

    @classmethod
    def begun(cls, sights: Sequence[Sight], direction: Floats, points: Floats) -> Circles:
        """Return the start of a fit from a direction of the axis and approximate positions (n, 2, 3) in space.

        For a single camera these are the intersections of its lines of sight with any plane across the axis.
        """
        single = len(sights) == 1
        point = common_centre(points, direction)
        u, v = axis_basis(direction)
        away = points - point
        x, y, height = away @ u, away @ v, (away @ direction).mean(axis=0)
        turn = np.arctan2(y, x)
        between = float(np.angle(np.exp(1j * (turn[:, 1] - turn[:, 0])).mean()))
        point = point + height[0] * direction
        radii = np.hypot(x, y).mean(axis=0)
        scale = float(point[2]) if single else 1.0
        rise = 0.0 if single else float(height[1] - height[0])
        values = np.array([0.0, 0.0, *(point / scale), *(radii / scale), between, rise])
        free = np.ones(_VALUES, np.bool_)
        free[[_POINT.stop - 1, _RISE]] = not single
        return cls(sights, np.stack((u, v, direction)), values, free)

    @property
    def direction(self) -> Floats:
        """Direction of the axis."""
        return tilted(self.frame, self.values[_TILT])

    @property
    def point(self) -> Floats:
        """Point on the axis in the first marker's plane."""
        return np.asarray(self.values[_POINT])

    @property
    def radii(self) -> Floats:
        """Both markers' distances from the axis (2,)."""
        return np.asarray(self.values[_RADII])

    @property
    def between_rad(self) -> float:
        """Angle from the first marker to the second, about the axis."""
        return float(self.values[_BETWEEN])

    @property
    def rise(self) -> float:
        """Height of the second marker above the first, along the axis."""
        return float(self.values[_RISE])

    @property
    def residuals(self) -> int:
        """Number of independent residuals."""
        seen = sum(sight.seen.sum(axis=1) for sight in self.sights)
        return int(np.maximum(2 * seen - 1, 0).sum())

    def misfit(self, values: Floats) -> Floats:
        """Return the residuals (n, 4 × cameras − 1) of the markers from their circles, in units of white noise.

        First those across each marker's path, then those along it, without the component that the frame's own θ takes
        up.
        """
        across, along, slopes = [], [], []
        points, ways = _on_circles(self.frame, values, self._best_angle(values, self._first_angle(values)))
        for sight in self.sights:
            error, slope = sight.error(points, ways)
            size = np.linalg.norm(slope, axis=-1, keepdims=True)
            ahead = np.where(size > 0.0, slope / np.where(size > 0.0, size, 1.0), np.array([1.0, 0.0]))
            aside = np.stack((-ahead[..., 1], ahead[..., 0]), axis=-1)
            turn = np.zeros((len(error), 4, 4))
            for marker, part in enumerate((slice(0, 2), slice(2, 4))):
                turn[:, marker, part], turn[:, 2 + marker, part] = aside[:, marker], ahead[:, marker]
            both = np.stack((error.reshape(-1, 4), slope.reshape(-1, 4)), axis=-1)
            factor = np.linalg.cholesky(carried(sight.covariance, turn))
            white = np.linalg.solve(factor, turn @ both)
            across.append(white[:, :2, 0])
            along.append(white[:, 2:, 0])
            slopes.append(white[:, 2:, 1])
        rest = _without_direction(np.concatenate(along, axis=1), np.concatenate(slopes, axis=1))
        return np.concatenate((*across, rest), axis=1)

    def turns(self, *, values: Floats | None = None, near_rad: Floats | None = None) -> Turns:
        """Return the stick's angle in every frame, for the fitted values or others.

        ``near_rad`` (n,) are start values of the angles, if known.
        """
        values = self.values if values is None else values
        angle = self._best_angle(values, self._first_angle(values) if near_rad is None else near_rad)
        _, information, chi_squared = self._normal_equation(values, angle)
        known = information > 0.0
        with np.errstate(divide="ignore"):
            variance = np.where(known, 1.0 / information, np.nan)
        seen = sum(sight.seen.sum(axis=1) for sight in self.sights)
        return Turns(np.where(known, angle, np.nan), variance, chi_squared, np.maximum(2.0 * seen - 1.0, 0.0))

    def weighed(self, *, usual: float) -> Circles:
        """Return the fit with residuals whitened by their correlation; see :mod:`torsight.core.optics.hanging`."""
        directions, values = self.turns().angle_rad, self.values[self.free]
        return replace(
            self, whiten=whitening(directions, lambda part: self.misfit(self._with(part)), values, usual=usual)
        )

    def fitted(self) -> Circles:
        """Return the least-squares fit."""

        def residuals(part: Floats) -> Floats:
            error = self.misfit(self._with(part))
            return np.asarray(error if self.whiten is None else self.whiten @ error).ravel()

        part, spread, chi_squared = least_squares(residuals, self.values[self.free])
        covariance = np.zeros((_VALUES, _VALUES))
        covariance[np.ix_(self.free, self.free)] = spread
        return replace(self, values=self._with(part), covariance=covariance, chi_squared=chi_squared)

    def without_far(self) -> Circles:
        """Return the fit without outlier frames."""
        rows = near(self.misfit(self.values))
        return replace(self, sights=[sight.rows(rows) for sight in self.sights]).fitted() if not rows.all() else self

    def _with(self, part: Floats) -> Floats:
        values = self.values.copy()
        values[self.free] = part
        return values

    def _first_angle(self, values: Floats) -> Floats:
        """Return θ (n,) from the intersections of the lines of sight with the circles' planes."""
        direction = tilted(self.frame, values[_TILT])
        u, v = axis_basis(direction)
        across = np.stack((u, v), axis=1)
        middle = values[_POINT] + np.outer([0.0, values[_RISE]], direction)
        total = np.zeros(len(self.sights[0].ray), np.complex128)
        for sight in self.sights:
            eye, lines = sight.lines
            with np.errstate(all="ignore"):
                toward = lines @ direction
                away = ((middle - eye) @ direction / toward)[..., None] * (lines @ across) - (middle - eye) @ across
                turn = np.arctan2(away[..., 1], away[..., 0]) - np.array([0.0, values[_BETWEEN]])
                # Weight: a plane that is seen nearly edge-on gives little information.
                facing = np.abs(toward) / np.sqrt(np.sum(lines**2, axis=-1))
                pointing = facing * np.exp(1j * turn)
            total += np.where(sight.seen & np.isfinite(pointing), pointing, 0.0).sum(axis=1)
        return np.angle(total)

    def _best_angle(self, values: Floats, angle: Floats) -> Floats:
        """Return the least-squares θ (n,), from a guess near it, by two Gauss-Newton steps.

        The error of the first guess is the pictures' noise over a radius, and each step about squares it.
        """
        for _ in range(2):
            gradient, information, _ = self._normal_equation(values, angle)
            angle = angle - gradient / np.where(information > 0.0, information, 1.0)
        return angle

    def _normal_equation(self, values: Floats, angle: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the gradient of χ² / 2 by θ (n,) at given θ, the Fisher information about θ, and the misfit χ²."""
        gradient, information, chi_squared = np.zeros((3, len(angle)))
        points, ways = _on_circles(self.frame, values, angle)
        for sight in self.sights:
            error, slope = (part.reshape(-1, 4) for part in sight.error(points, ways))
            pull = applied(sight.precision, slope)
            gradient += np.sum(pull * error, axis=1)
            information += np.sum(pull * slope, axis=1)
            chi_squared += np.sum(applied(sight.precision, error) * error, axis=1)
        return gradient, information, chi_squared


def _on_circles(frame: Floats, values: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Return the positions (n, 2, 3) of both markers on their circles, and their derivatives by θ."""
    direction = tilted(frame, values[_TILT])
    u, v = axis_basis(direction)
    turn = angle[:, None] + np.array([0.0, values[_BETWEEN]])
    cos, sin = (values[_RADII] * part for part in (np.cos(turn), np.sin(turn)))
    middle = values[_POINT] + np.outer([0.0, values[_RISE]], direction)
    return (middle + cos[..., None] * u + sin[..., None] * v, cos[..., None] * v - sin[..., None] * u)


def _without_direction(error: Floats, direction: Floats) -> Floats:
    """Return errors (n, k) without their component along a direction (n, k), as k − 1 coordinates (Householder)."""
    mirror = direction.copy()
    mirror[:, 0] += np.linalg.norm(direction, axis=1)
    square = np.sum(mirror**2, axis=1, keepdims=True)
    part = np.sum(mirror * error, axis=1, keepdims=True) / np.where(square > 0.0, square, 1.0)
    return np.asarray((error - 2.0 * part * mirror)[:, 1:])


def near(misfit: Floats) -> Flags:
    """Return the mask (n,) of frames whose misfits (n, k) are within chance; others confused neighbouring dots."""
    off = np.abs(misfit).max(axis=1)
    return np.asarray(off < BY_CHANCE * max(robust_sigma(off), 1e-9))


def on_unit_plane(lines: Floats, direction: Floats, through: Floats) -> Floats:
    """Return the intersections of lines of sight with the plane through a point across a direction."""
    return np.asarray(lines * ((through @ direction) / (lines @ direction))[..., None])


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
    """Return the unit vector that is tilted by ``tilt`` (2,) against the third vector of a frame."""
    vector = tilt[0] * frame[0] + tilt[1] * frame[1] + frame[2]
    return np.asarray(vector / math.sqrt(vector @ vector))
