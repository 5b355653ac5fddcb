"""The pose of the rotation axis from a board that lies on the disk.

One picture determines the disk's plane; the axis passes it at ``axis_mm`` in ``BOARD.toml`` (by default the board's
middle). In several pictures with the disk turned in between, the axis is the line about which the board turned: then
neither the board's position on the disk nor its tilt against the disk matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np

from calibration.boards.board_file import Board
from calibration.cameras.lens import CORNER_SIGMA_PX
from calibration.views.detect import View
from torsight.core.errors import InputError, NoResultError
from torsight.core.minimise import jacobian_of, least_squares
from torsight.core.optics.axis import pose_along, tilt_of
from torsight.core.optics.camera import Intrinsics, Pose
from torsight.core.optics.circles import axis_basis, tilted
from torsight.core.optics.geometry import project, ray_from_pixel, rotation_matrix, rotation_vector
from torsight.core.parallel.threads import one_thread
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
