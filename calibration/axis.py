"""The pose of the rotation axis in a calibrated camera.

In: pictures of a board that lies on the disk (px), or the tracks of the moving stick's markers (px). Out: a
:class:`~torsight.core.optics.camera.Pose` (camera from world, mm; z along the axis, towards the camera) with the
standard deviation of its direction.

One picture of a board determines the disk's plane; the axis passes it at ``axis_mm`` in ``BOARD.toml`` (by default the
board's middle). In several pictures with the disk turned in between, the axis is the line about which the board turned:
then neither the board's position on the disk nor its tilt against the disk matters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from calibration.boards.board_file import Board
from calibration.cameras.lens import CORNER_SIGMA_PX
from calibration.views.detect import View
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.files.provenance import file_hash
from torsight.core.files.storage import read_table
from torsight.core.files.tables import marker_values
from torsight.core.minimise import jacobian_of, least_squares
from torsight.core.optics.axis import Axis, axis_in_picture, pose_along, pose_from_axis, tilt_of
from torsight.core.optics.camera import Camera, Intrinsics, Pose
from torsight.core.optics.circles import axis_basis, tilted
from torsight.core.optics.geometry import project, ray_from_pixel, rotation_matrix, rotation_vector
from torsight.core.parallel.threads import one_thread
from torsight.core.tracks import round_covariance
from torsight.core.units import Floats
from torsight.core.words.shown import Shown
from torsight.core.words.wording import number


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


_SMALLEST_TURN_DEG: Final = 15.0
"""Smallest turn of the disk: an error of 0.1° in a board's pose then tilts the axis by 0.1° / (15° in rad) = 0.4°."""
_LARGEST_ERROR_PX: Final = 15.0 * CORNER_SIGMA_PX
"""Largest error of the corners: the right camera gives a tenth of it; a changed focus or zoom many times as much."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DiskPose(AxisPose):
    """The rotation axis from a board on the disk: camera from world, with the origin on the board's face.

    ``tilt_deg`` is the axis' tilt against the line of sight to the origin. The standard deviations, from the scatter of
    the corners, are those of the axis' direction and of its position across it (0 where ``axis_mm`` gives the
    position). ``error_px`` is the root mean square distance between measured and computed corners, ``turned_deg`` the
    turn of the disk in each picture relative to the first, ``wobble_deg`` the angle between the board's face and the
    plane across the axis.
    """

    pose: Pose
    tilt_deg: float
    direction_sigma_deg: float
    place_sigma_mm: float
    error_px: float
    turned_deg: tuple[float, ...]
    wobble_deg: float

    def facts(self) -> dict[str, str]:
        """Return tilt, place, error and the disk's turns."""
        return {
            "tilt": f"{self.tilt_deg:.2f}° ± {self.direction_sigma_deg:.2f}°",
            "place": f"± {number(self.place_sigma_mm)} mm" if self.place_sigma_mm else "as axis_mm says",
            "error": f"{number(self.error_px)} px",
            "turned": ", ".join(f"{turn:.1f}°" for turn in self.turned_deg),
            "wobble": f"{self.wobble_deg:.2f}°",
        }


def pose_on_disk(
    views: Sequence[View], intrinsics: Intrinsics, board: Board, *, base_z_mm: float = 0.0, moving_z_mm: float = 0.0
) -> DiskPose:
    """Return the rotation axis from the board on the disk, in one or several positions of the disk.

    The camera must not move. The heights are those of the two sticks' markers above the board's face, towards the
    camera.

    Raises InputError when the corners do not fit the camera, because it is another camera or its focus or zoom was
    changed; NoResultError when several pictures show the disk in nearly the same position.
    """
    poses = [_board_pose(view, intrinsics) for view in views]
    solved = _fixed_place(views[0], intrinsics, poses[0], board)
    if len(views) > 1:
        solved = _turned(views, intrinsics, poses)
    direction, origin, wobble, turned, error_px, sigma_rad, place_mm = solved
    if error_px > _LARGEST_ERROR_PX:
        raise InputError(
            "the board on the disk does not fit this camera",
            where=", ".join(view.name for view in views),
            value=f"its corners are {error_px:.1f} px off",
            limit=f"{_LARGEST_ERROR_PX:g} px",
            do="take it with the calibrated camera, focus and zoom untouched; between turns move only the disk",
        )
    return DiskPose(
        pose=pose_along(origin, direction, base_z_mm=base_z_mm, moving_z_mm=moving_z_mm),
        tilt_deg=float(np.degrees(tilt_of(origin, direction))),
        direction_sigma_deg=float(np.degrees(sigma_rad)),
        place_sigma_mm=place_mm,
        error_px=error_px,
        turned_deg=tuple(float(value) for value in np.degrees(turned)),
        wobble_deg=wobble,
    )


_Solved = tuple[Floats, Floats, float, Floats, float, float, float]


def _board_pose(view: View, intrinsics: Intrinsics) -> Floats:
    """Return rvec and tvec (6,) of the board: the better of a plane's two candidate poses, each refined."""
    ray, _ = ray_from_pixel(view.corners_px, intrinsics)
    with one_thread():
        _, rvecs, tvecs, _ = cv2.solvePnPGeneric(
            view.points_mm, ray.reshape(-1, 1, 2), np.eye(3), np.zeros(5), flags=cv2.SOLVEPNP_IPPE
        )
    refined = [
        least_squares(
            lambda pose: _error(view, intrinsics, pose),
            np.concatenate((np.asarray(rvec).reshape(3), np.asarray(tvec).reshape(3))),
        )
        for rvec, tvec in zip(rvecs, tvecs, strict=True)
    ]
    return min(refined, key=lambda item: item[2])[0]


def _error(view: View, intrinsics: Intrinsics, pose: Floats) -> Floats:
    return (project(view.points_mm, intrinsics, rvec=pose[:3], tvec_mm=pose[3:]) - view.corners_px).ravel()


def _fixed_place(view: View, intrinsics: Intrinsics, pose: Floats, board: Board) -> _Solved:
    _, covariance, chi_squared = least_squares(lambda pose: _error(view, intrinsics, pose), pose)
    rotation = rotation_matrix(pose[:3])
    origin = rotation @ np.array([*board.axis_mm, 0.0]) + pose[3:]
    points = len(view.points_mm)
    variance = chi_squared / (2 * points - 6)
    # Rotations about the board's own two axes tilt its face: extract their covariance from the rotation vector's.
    jacobian = jacobian_of(lambda rvec: rotation_vector(rotation_matrix(rvec) @ rotation.T), pose[:3])
    tilts = (rotation.T @ jacobian @ covariance[:3, :3] @ jacobian.T @ rotation)[:2, :2] * variance
    sigma = float(np.sqrt(np.linalg.eigvalsh(tilts)[-1]))
    return -rotation[:, 2], origin, 0.0, np.zeros(1), float(np.sqrt(chi_squared / points)), sigma, 0.0


def _turned(views: Sequence[View], intrinsics: Intrinsics, poses: Sequence[Floats]) -> _Solved:
    direction, point, turned = _first_guess(poses)
    frame = np.stack((*axis_basis(direction), direction))

    def unpacked(values: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        place = point + values[2] * frame[0] + values[3] * frame[1]
        turns = np.concatenate((np.zeros(1), values[10:]))
        return tilted(frame, values[:2]), place, values[4:7], values[7:10], turns

    def residuals(values: Floats) -> Floats:
        direction, place, rvec, tvec, turns = unpacked(values)
        first = rotation_matrix(rvec)
        errors = []
        for view, turn in zip(views, turns, strict=True):
            rotation = rotation_matrix(direction * turn)
            points = (view.points_mm @ first.T + tvec - place) @ rotation.T + place
            errors.append((project(points, intrinsics) - view.corners_px).ravel())
        return np.concatenate(errors)

    start = np.concatenate((np.zeros(4), poses[0], turned[1:]))
    values, covariance, chi_squared = least_squares(residuals, start)
    direction, place, rvec, tvec, turns = unpacked(values)
    count = residuals(values).size
    covariance = covariance * chi_squared / (count - len(values))
    face = rotation_matrix(rvec)[:, 2]
    origin = place + direction * float(face @ (tvec - place)) / float(face @ direction)
    wobble = float(np.degrees(np.arccos(np.clip(abs(face @ direction), -1.0, 1.0))))
    sigma, place_sigma = (
        float(np.sqrt(np.linalg.eigvalsh(covariance[part, part])[-1])) for part in (slice(0, 2), slice(2, 4))
    )
    return direction, origin, wobble, turns, float(np.sqrt(2.0 * chi_squared / count)), sigma, place_sigma


def _first_guess(poses: Sequence[Floats]) -> tuple[Floats, Floats, Floats]:
    """Return the axis' direction, a point on it and the turns, from the motions between the first and other poses."""
    first, start = rotation_matrix(poses[0][:3]), poses[0][3:]
    turns = [rotation_matrix(pose[:3]) @ first.T for pose in poses]
    vectors = np.array([rotation_vector(turn) for turn in turns])
    largest = vectors[np.argmax(np.linalg.norm(vectors, axis=1))]
    if np.degrees(np.linalg.norm(largest)) < _SMALLEST_TURN_DEG:
        raise NoResultError(
            "the disk is in nearly the same position in all pictures of the board on it",
            value=f"turned by {np.degrees(np.linalg.norm(largest)):.1f}°",
            limit=f"at least {_SMALLEST_TURN_DEG:g}°",
            do="turn the disk in between, or give one picture and axis_mm in BOARD.toml",
        )
    summed = np.sum(vectors * np.sign(vectors @ largest)[:, None], axis=0)
    direction = summed / np.linalg.norm(summed)
    if direction @ start > 0.0:
        direction = -direction
    system = np.concatenate([np.eye(3) - turn for turn in turns])
    right = np.concatenate([pose[3:] - turn @ start for pose, turn in zip(poses, turns, strict=True)])
    point = np.linalg.lstsq(system, right, rcond=1e-6)[0]
    # The point's position along the axis is arbitrary: take the one nearest to the board.
    point = point + direction * float(direction @ (start - point))
    return direction, point, vectors @ direction


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
