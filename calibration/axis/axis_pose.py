"""Presentation of a measured pose of the rotation axis: its table and its plot."""

from __future__ import annotations

from typing import Any

import numpy as np

from torsight.core.optics.camera import Pose
from torsight.core.optics.geometry import rotation_matrix
from torsight.core.words.shown import Shown


class AxisPose(Shown):
    """Base of poses of the rotation axis: one row, and a plot of the axis in front of the camera."""

    __slots__ = ()

    pose: Pose

    def _columns(self) -> dict[str, Any]:
        """Return one row: the pose as in ``CAMERA.toml``."""
        vectors = {"rvec": self.pose.rvec, "tvec": self.pose.tvec_mm}
        units = {"rvec": "rad", "tvec": "mm"}
        names = {f"{name}_{axis}_{units[name]}": [vectors[name][i]] for name in vectors for i, axis in enumerate("xyz")}
        return {**names, "base_z_mm": [self.pose.base_z_mm], "moving_z_mm": [self.pose.moving_z_mm]}

    def _draw(self, axes: Any) -> None:
        """Draw the axis from the side, over a quarter of its distance, in the camera's x and z."""
        origin = self.pose.tvec_mm
        direction = rotation_matrix(self.pose.rvec)[:, 2]
        ends = np.stack([origin, origin + direction * np.linalg.norm(origin) / 4.0])
        axes.plot(0.0, 0.0, "ks", label="camera")
        axes.plot(ends[:, 2], ends[:, 0], label="rotation axis, from its origin")
        axes.set(xlabel="along the line of sight, z, mm", ylabel="to the right, x, mm", aspect="equal")
        axes.legend()
