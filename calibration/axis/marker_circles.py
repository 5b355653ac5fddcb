"""The pose of the rotation axis from the markers' circles in a track of one camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from calibration.axis.board_on_disk import AxisPose
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.paths import AnyPath
from torsight.core.files.provenance import file_hash
from torsight.core.files.storage import read_table
from torsight.core.files.tables import marker_values
from torsight.core.optics.axis import Axis, axis_in_picture, pose_from_axis
from torsight.core.optics.camera import Camera, Pose
from torsight.core.tracks import round_covariance
from torsight.core.units import Floats
from torsight.core.words.wording import number

_MARKERS: Final = ("moving_inner", "moving_outer")
_CERTAIN_GAP: Final = 2.0 * math.log(100.0)
"""Difference of χ² from which the tilt's mirror image is excluded: it is then a hundred times less likely."""
_WORST_MISFIT: Final = 5.0
"""Deviation of paths from circles, in the markers' own sigmas, above which there is another cause than noise: with the
fewest frames for an axis chance gives 2.2 once in 10⁹ (χ² of 15 degrees of freedom), and sigmas may be half of the true
ones."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CirclesPose(AxisPose):
    """The rotation axis from the moving stick's markers, with notes for the user.

    The pose's origin is the axis' intersection with the moving markers' plane; the fit is in units of the markers'
    distance.
    """

    pose: Pose
    axis: Axis
    notes: tuple[str, ...]

    def facts(self) -> dict[str, str]:
        """Return tilt, the stick's turn, the circles' misfit, and the notes."""
        tilt_deg, sigma_deg, turned_deg = np.degrees(
            [self.axis.tilt_rad, self.axis.direction_sigma_rad, self.axis.arc_rad]
        )
        facts = {"tilt": f"{tilt_deg:.2f}° ± {sigma_deg:.2f}°", "turned": f"{turned_deg:.0f}°"}
        facts["misfit"] = f"{number(self.axis.misfit)} times the markers' sigmas"
        return facts | {f"note {i + 1}": note for i, note in enumerate(self.notes)}

    def account(self, path: Path) -> dict[str, Any]:
        """Return the table ``[calibration.axis]``."""
        return {
            "tracks": path.name,
            "sha256": file_hash(path),
            "tilt_deg": float(np.degrees(self.axis.tilt_rad)),
            "direction_sigma_deg": float(np.degrees(self.axis.direction_sigma_rad)),
            "turned_deg": float(np.degrees(self.axis.arc_rad)),
            "misfit": self.axis.misfit,
            "notes": list(self.notes),
        }


def pose_from_tracks(
    path: AnyPath, camera: Camera, *, stick_mm: float | None = None, base_above_moving_mm: float = 0.0
) -> CirclesPose:
    """Return the rotation axis from ``markers.csv`` of a film of one camera.

    Parameters
    ----------
    path : str or Path
        The table of marker positions.
    camera : Camera
        The camera that took the film.
    stick_mm : float, optional
        Distance of the moving stick's two markers; if not given, lengths are in units of this distance.
    base_above_moving_mm : float
        Height of the base stick's markers above the moving stick's, towards the camera.

    Raises
    ------
    ConfigError
        When the camera is a stereo pair.
    InputError
        When the table lacks a column, or its positions lie outside the camera's picture or do not fit the camera.
    NoResultError
        When the markers are seen in too few frames or turn too little.
    """
    path = Path(path)
    if camera.right is not None:
        raise ConfigError(
            "takes no --tracks for a stereo pair",
            where="torsight calibrate",
            do="leave it out: the axis of a pair is found from the tracks",
        )
    position, covariance = read_circles(path)
    size = np.array(camera.intrinsics.size_px)
    beyond = (position < -0.5) | (position > size - 0.5)
    if beyond.any():
        raise InputError(
            "has markers outside the camera's picture",
            where=str(path),
            value=f"up to {np.nanmax(position[..., 0]):.0f}, {np.nanmax(position[..., 1]):.0f} px",
            limit=f"{size[0]} × {size[1]}",
            do="take the camera that filmed it",
        )
    axis = axis_in_picture(position, covariance, camera.intrinsics)
    notes = _notes(axis)
    if stick_mm is None:
        notes += ("lengths are in units of the moving stick's marker distance: --stick-mm gives them in mm",)
    pose = pose_from_axis(axis, length_mm=stick_mm or 1.0, base_z_mm=base_above_moving_mm)
    return CirclesPose(pose, axis, notes)


def _notes(axis: Axis) -> tuple[str, ...]:
    notes = []
    if axis.mirror_gap < _CERTAIN_GAP:
        notes.append(
            "perspective is too weak to distinguish this tilt from its mirror image; the angle hardly depends on it"
        )
    if axis.misfit > _WORST_MISFIT:
        notes.append(
            f"the paths are {axis.misfit:.1f} times as far from circles as the markers' sigmas say; "
            "check that neither the camera nor a marker moved"
        )
    return tuple(notes)


def read_circles(path: Path) -> tuple[Floats, Floats]:
    """Return positions (n, 2, 2) and covariances (n, 2, 2, 2) of the moving stick's markers, NaN where not valid."""
    columns = [f"{marker}_{part}" for marker in _MARKERS for part in ("x_px", "y_px", "sigma_px", "valid")]
    table = read_table(path, required=columns)
    values = marker_values(table, "x_px", "y_px", "sigma_px", names=_MARKERS)
    values[~(values[..., 2] > 0.0)] = np.nan
    return values[..., :2], round_covariance(values[..., 2])
