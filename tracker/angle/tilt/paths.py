"""The plane of motion: the map to it from the picture, and the residuals of the markers' paths from circles in it.

The map is a homography after the lens's radial distortion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Final

import numpy as np

from torsight.core.optics.circles import near
from torsight.core.optics.hanging import whitening
from torsight.core.series import correlation_time
from torsight.core.units import Flags, Floats, Ints

PACES: Final = 3.0 ** np.arange(-3.0, 2.0)
"""Nodes of the lag over the speed, in rms speeds: linear in the speed's logarithm between them, constant outside."""
CIRCLES: Final = np.s_[7:12]
"""Indices, among the values, of the circles' centre, the near marker's arm, the far one's radius, and the near one's
offset across its arm. Before them are tilt, lens and read-outs, behind them the coefficients of lag and motion blur."""


def rectify(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return points (..., 2) as seen along the axis, up to a rotation and a scale, and the derivatives (..., 2, 2)."""
    flat, slopes = mapped(points[..., 0], points[..., 1], values)
    return np.stack(flat, axis=-1), np.stack(slopes, axis=-1).reshape(*points.shape, 2)


def mapped(x: Floats, y: Floats, values: Floats) -> tuple[tuple[Floats, Floats], tuple[Floats, ...]]:
    """Return the mapped x and y, and the derivatives of the new x by x and y, and of the new y by x and y."""
    e1, e2, l1, l2, k = values[:5].tolist()
    bend = 1.0 + k * (x * x + y * y)
    u, v = x * bend, y * bend
    deep = 1.0 / (1.0 + l1 * u + l2 * v)
    flat_x, flat_y = ((1.0 + e1) * u + e2 * v) * deep, (e2 * u + (1.0 - e1) * v) * deep
    x_u, y_u = (1.0 + e1 - l1 * flat_x) * deep, (e2 - l1 * flat_y) * deep
    x_v, y_v = (e2 - l2 * flat_x) * deep, (1.0 - e1 - l2 * flat_y) * deep
    u_x, both, v_y = bend + 2.0 * k * x * x, 2.0 * k * x * y, bend + 2.0 * k * y * y
    slopes = (x_u * u_x + x_v * both, x_u * both + x_v * v_y, y_u * u_x + y_v * both, y_u * both + y_v * v_y)
    return (flat_x, flat_y), slopes


@dataclass(frozen=True, eq=False)
class Paths:
    """Both markers' positions (n, 2, 2) and covariances (n, 2, 2, 2), the stick's direction (n,), the far one's lead.

    The marker that is nearer to the axis comes first; ``between_rad`` is about the angle from its arm to the far one's.
    For the lead (n, 2) of the far marker see :meth:`tracker.angle.row_time.Readout.lead_rad`. ``way`` (n,) is the sense
    of rotation. ``carried`` (n, k) are the regressors of the offset along the circle by codec and motion blur, of the
    usual size in the unit of the positions: a lag at each of ``PACES``, with the sign of the sense, and the speed's
    square. Residuals of frames with the same number ``alike`` (n,) are averaged: single frames scatter more along the
    motion than across it, and over a short arc a map that exchanges both would gain by that alone.
    """

    points: Floats
    covariance: Floats
    direction_rad: Floats
    way: Floats
    lead_rad: Floats
    carried: Floats
    alike: Ints
    between_rad: float

    def rows(self, kept: Flags) -> Paths:
        """Return some of the frames."""
        return replace(self, **{item.name: getattr(self, item.name)[kept] for item in fields(self)[:-1]})

    def averaged(self, left: Floats) -> Floats:
        """Return the sums (m, q) of residuals (n, q) over each group of frames, over the root of the group's size."""
        group, root = self._groups
        columns = left.shape[1]
        places = group[:, None] * columns + np.arange(columns)
        return np.bincount(places.ravel(), left.ravel()).reshape(-1, columns) / root

    @cached_property
    def _groups(self) -> tuple[Ints, Floats]:
        """Index of every frame's group (n,), and the square roots of the groups' sizes (m, 1)."""
        _, group, count = np.unique(self.alike, return_inverse=True, return_counts=True)
        return group, np.sqrt(count)[:, None]

    def misfit(self, values: Floats) -> Floats:
        """Return the markers' residuals (n, 3) in units of white noise; see :meth:`off`."""
        away, variance = self.off(values)
        return np.asarray(away / np.sqrt(variance))

    def off(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the markers' residuals (n, 3), and their variances (n, 3) by white noise.

        The residuals are those of the near marker along its arm, of the far one's radius, and of the near marker across
        its arm, relative to the far one's direction: the angle between both arms would be undefined where the near
        marker lies on the axis. The noise is that of the picture, propagated through the map: a map that shrinks must
        not gain by making all residuals smaller.
        """
        (x, y), (xx, xy, yx, yy) = mapped(*self._places, values)
        away = (x - values[7]) + 1j * (y - values[8])
        far = np.abs(away[:, 1])
        out = (away[:, 1] / far)[:, None] * np.exp([-1j * self.between_rad, 0.0])
        along = self._variance(out.real * xx + out.imag * yx, out.real * xy + out.imag * yy)
        aside = self._variance(out.real * yx - out.imag * xx, out.real * yy - out.imag * xy)
        near = away[:, 0] * np.conj(out[:, 0]) * np.exp(1j * (self.lead_rad @ values[5:7]))
        share = values[9] / values[10]
        beside = near.imag - values[11] + self.carried @ values[CIRCLES.stop :] * np.hypot(1.0, share)
        return (
            np.column_stack([near.real - values[9], far - values[10], beside]),
            np.column_stack([along, aside[:, 0] + share**2 * aside[:, 1]]),
        )

    def across(self, values: Floats) -> float:
        """Return the ratio of the errors across the stick to those along it, which its length shows, at least 1.

        A common displacement of both markers, by play of the axis or a trembling camera, does not turn the stick. It is
        as large along the arms as across them, so the mean square along the arms, with the same weight of the far
        marker, is subtracted. The excess counts as far as it is larger than chance (the positive part of James and
        Stein's estimate).
        """
        away, variance = self.off(values)
        share = values[9] / values[10]
        # Lag and motion blur are errors of the angle, though fitted here, except for their mean over all frames.
        carried = self.carried @ values[CIRCLES.stop :] * np.hypot(1.0, share)
        away[:, 2] -= carried - carried.mean()
        alike = (away[:, 0] - share * away[:, 1]) / np.sqrt(variance[:, 0] + share**2 * variance[:, 1])
        left = np.column_stack([away[:, 2] / np.sqrt(variance[:, 2]), alike])
        across, along = np.square(left[near(left)]).T
        more, usual = float(np.mean(across) - np.mean(along)), float(np.mean(along))
        chance = 2.0 * float(np.var(along)) * correlation_time([along - usual]) / len(along)
        return math.sqrt(1.0 + max(more - chance / more, 0.0)) if more > 0.0 else 1.0

    def _variance(self, by_x: Floats, by_y: Floats) -> Floats:
        """Return the variances (n, 2) of linear combinations of each marker's coordinates, with these coefficients."""
        xx, both, yy = self._spreads
        return np.asarray(by_x**2 * xx + by_x * by_y * both + by_y**2 * yy)

    @cached_property
    def _places(self) -> tuple[Floats, Floats]:
        return np.ascontiguousarray(self.points[..., 0]), np.ascontiguousarray(self.points[..., 1])

    @cached_property
    def _spreads(self) -> tuple[Floats, Floats, Floats]:
        own = self.covariance
        return own[..., 0, 0].copy(), own[..., 0, 1] + own[..., 1, 0], own[..., 1, 1].copy()

    def weighing(self, values: Floats, *, usual: float) -> Callable[[Floats], Floats]:
        """Return a function that whitens averaged residuals (m, q); ``usual`` is the usual correlated error."""
        # The harmonic mean of the variances: frames of uncertain position, where the base was hidden, count little.
        white = float(np.sqrt(0.5 / np.mean(1.0 / np.trace(self.covariance, axis1=2, axis2=3))))
        whiten = whitening(self.direction_rad, self.misfit, values, usual=usual / white, way=self.way)
        mean = self.averaged(np.eye(len(whiten))) @ np.linalg.inv(whiten)
        factor = np.linalg.inv(np.linalg.cholesky(mean @ mean.T))
        return lambda left: np.asarray(factor @ left)


def by_pace(pace: Floats) -> Floats:
    """Return the weights (n, k) that interpolate a function at speeds (n,) from its values at ``PACES``."""
    at = np.log(np.clip(pace, PACES[0], PACES[-1]))
    return np.stack([np.interp(at, np.log(PACES), one) for one in np.eye(len(PACES))], axis=1)
