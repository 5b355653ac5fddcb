"""Cameras as files: intrinsics, the pose of the rotation axis, the planes of the sticks, a second camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_numbers, get_table, get_whole
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.frozen import Frozen
from torsight.core.optics.geometry import rotation_matrix
from torsight.core.units import Floats

_PLACES = {"fx_px": (0, 0), "fy_px": (1, 1), "cx_px": (0, 2), "cy_px": (1, 2)}
"""Row and column of each key in the camera's matrix."""


@dataclass(frozen=True, slots=True, eq=False)
class Intrinsics:
    """Pinhole camera, for pictures of one size (width, height).

    The matrix (3, 3) holds fx, fy, cx and cy in pixels, ``distortion`` (5,) OpenCV's k1, k2, p1, p2 and k3.
    """

    size_px: tuple[int, int]
    matrix: Floats
    distortion: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Pose of the rotation axis in OpenCV's convention: the transform from world to camera coordinates.

    The world's z axis is the rotation axis and points towards the camera. Rotation vector (3,), rad, and position (3,)
    of the world's origin in camera coordinates; heights of the planes in which the two sticks' markers lie.
    """

    rvec: Floats
    tvec_mm: Floats
    base_z_mm: float
    moving_z_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class RightCamera:
    """The second camera of a stereo pair.

    Rotation vector (3,), rad, and translation (3,) lead from left to right camera coordinates.
    """

    intrinsics: Intrinsics
    rvec: Floats
    tvec_mm: Floats


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Camera(Frozen):
    """One calibrated camera, with the pose of the axis (mono) or a second camera (stereo).

    ``extra`` keeps the calibration's description (board, pictures, errors) as in the file, ``source`` is its path, for
    messages.
    """

    intrinsics: Intrinsics
    pose: Pose | None = None
    right: RightCamera | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    source: str = "the camera file"

    def __post_init__(self) -> None:
        Frozen.__post_init__(self)
        if self.pose is None:
            return
        height_mm = float(-(rotation_matrix(self.pose.rvec).T @ self.pose.tvec_mm)[2])
        highest_mm = max(self.pose.base_z_mm, self.pose.moving_z_mm)
        if height_mm <= highest_mm:
            raise ConfigError(
                "the camera is not in front of the sticks",
                where=f"{self.source}, [pose], [planes]",
                value=f"the camera at z = {height_mm:.1f} mm",
                limit=f"beyond the sticks' planes, at {highest_mm:g} mm",
                do="z is the rotation axis, towards the camera: turn the board's axes over, or correct the planes",
            )

    def __repr__(self) -> str:
        width, height = self.intrinsics.size_px
        more = "a pair" if self.right is not None else "no pose" if self.pose is None else "with its pose"
        return f"Camera({width} × {height} px, focal length {self.intrinsics.matrix[0, 0]:.0f} px, {more})"


def read_camera(path: AnyPath) -> Camera:
    """Read ``CAMERA.toml``.

    Raises ConfigError for an unknown or missing key, or a value of the wrong kind or out of range; InputError when the
    file cannot be read.
    """
    path = Path(path)
    content = read_toml(path, kind="camera")
    check_keys(content, ("intrinsics", "pose", "planes", "right", "calibration"), where=str(path))
    if "intrinsics" not in content:
        raise ConfigError("has no table [intrinsics]", where=str(path), do="make it with 'torsight calibrate'")
    intrinsics = _intrinsics(get_table(content, "intrinsics", where=str(path)), where=f"{path}, [intrinsics]")
    pose = None
    if "pose" in content:
        place = _place(get_table(content, "pose", where=str(path)), where=f"{path}, [pose]")
        planes = get_table(content, "planes", where=str(path))
        check_keys(planes, ("base_z_mm", "moving_z_mm"), where=f"{path}, [planes]")
        pose = Pose(
            **place,
            base_z_mm=get_number(planes, "base_z_mm", where=f"{path}, [planes]", default=0.0),
            moving_z_mm=get_number(planes, "moving_z_mm", where=f"{path}, [planes]", default=0.0),
        )
    right = None
    if "right" in content:
        table = get_table(content, "right", where=str(path))
        check_keys(table, ("intrinsics", "from_left"), where=f"{path}, [right]")
        motion = get_table(table, "from_left", where=f"{path}, [right]", required=True)
        right = RightCamera(
            intrinsics=_intrinsics(
                get_table(table, "intrinsics", where=f"{path}, [right]", required=True),
                where=f"{path}, [right.intrinsics]",
            ),
            **_place(motion, where=f"{path}, [right.from_left]"),
        )
    return Camera(intrinsics=intrinsics, pose=pose, right=right, extra=content.get("calibration", {}), source=str(path))


def _place(table: Mapping[str, Any], *, where: str) -> dict[str, Floats]:
    """Return the rotation vector (3,), rad, and the translation (3,), mm, in a table."""
    names = ("rvec", "tvec_mm")
    check_keys(table, names, where=where)
    return {name: np.array(get_numbers(table, name, 3, where=where)) for name in names}


def require_second(camera: Camera | None, *, where: str) -> RightCamera:
    """Return the second camera of a stereo pair; a camera file without one is refused."""
    if camera is None or camera.right is None:
        raise ConfigError(
            "two films need a camera file with a second camera",
            where=where,
            limit="[right.intrinsics] and [right.from_left]",
            do="calibrate the pair with 'torsight calibrate LEFT… --right RIGHT…'",
        )
    return camera.right


def require_size(camera: Camera, size_px: tuple[int, int], *, film: str, right: RightCamera | None = None) -> None:
    """Refuse a camera file for another picture size; the message names swapped width and height, or a scaling.

    ``film`` is the film or picture that the camera, or the ``right`` one of a pair, is used for.
    """
    intrinsics, table = (camera.intrinsics, "intrinsics") if right is None else (right.intrinsics, "right.intrinsics")
    if size_px == intrinsics.size_px:
        return
    width, height = intrinsics.size_px
    do = "calibrate with pictures of this size, taken with the same camera, focus and zoom"
    if size_px == (height, width):
        do = "the picture is turned by a quarter: film as in the calibration, or calibrate as you film"
    elif size_px[0] * height == size_px[1] * width:
        do = "the picture was scaled or filmed in another mode: film as in the calibration, or " + do
    raise ConfigError(
        "is for another picture size",
        where=f"{camera.source}, [{table}] width, height",
        value=f"{width} × {height}",
        limit=f"{size_px[0]} × {size_px[1]}, the size of {film}",
        do=do,
    )


def camera_content(camera: Camera) -> dict[str, Any]:
    """Return the camera as tables of ``CAMERA.toml``."""
    content: dict[str, Any] = {"intrinsics": _intrinsics_content(camera.intrinsics)}
    if camera.pose is not None:
        content["pose"] = {"rvec": camera.pose.rvec.tolist(), "tvec_mm": camera.pose.tvec_mm.tolist()}
        content["planes"] = {"base_z_mm": camera.pose.base_z_mm, "moving_z_mm": camera.pose.moving_z_mm}
    if camera.right is not None:
        content["right"] = {
            "intrinsics": _intrinsics_content(camera.right.intrinsics),
            "from_left": {"rvec": camera.right.rvec.tolist(), "tvec_mm": camera.right.tvec_mm.tolist()},
        }
    if camera.extra:
        content["calibration"] = dict(camera.extra)
    return content


def _intrinsics_content(intrinsics: Intrinsics) -> dict[str, Any]:
    return {
        "width": intrinsics.size_px[0],
        "height": intrinsics.size_px[1],
        **{name: float(intrinsics.matrix[place]) for name, place in _PLACES.items()},
        "distortion": intrinsics.distortion.tolist(),
    }


def _intrinsics(table: Mapping[str, Any], *, where: str) -> Intrinsics:
    check_keys(table, ("width", "height", *_PLACES, "distortion"), where=where)
    matrix = np.eye(3)
    for name, place in _PLACES.items():
        matrix[place] = get_number(table, name, where=where, lower=1e-9 if name.startswith("f") else -np.inf)
    distortion = np.array(get_numbers(table, "distortion", 5, where=where)) if "distortion" in table else np.zeros(5)
    width, height = (get_whole(table, key, where=where, lower=1) for key in ("width", "height"))
    return Intrinsics(size_px=(width, height), matrix=matrix, distortion=distortion)
