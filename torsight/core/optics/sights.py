"""A stick's two markers in one camera's pictures: lines of sight, covariances, and residuals of points in space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from torsight.core.optics.camera import Intrinsics
from torsight.core.optics.geometry import carried, homogeneous, ray_from_pixel
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
