"""The whole stage: from pictures of a board to a camera or a stereo pair, with a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.axis import DiskPose, pose_on_disk
from calibration.boards.board_file import Board
from calibration.cameras.lens import LensCalibration, calibrate_lens
from calibration.cameras.stereo_pair import PairCalibration, calibrate_pair
from calibration.quality.calibration_verdict import GOOD, Verdict, judge_lens, judge_pair, worst_of
from calibration.views.board_views import Seen, find_views
from calibration.views.picture_files import expand, is_film
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.optics.camera import Camera, Intrinsics, require_size
from torsight.core.progress import Progress, silent
from torsight.core.words.shown import Shown
from torsight.core.words.wording import number


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One camera of a calibration: the views in its pictures, and its lens."""

    seen: Seen
    lens: LensCalibration


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration(Shown):
    """The result of the stage, with the verdict on all parts; None for parts that were not measured.

    ``left`` is the (left) camera, None where only the pose was measured, with a known camera. ``pair`` is the pose of
    the right camera relative to the left one, ``disk`` the rotation axis from a board on the disk, which ``disk_seen``
    shows.
    """

    board: Board
    left: Side | None = None
    right: Side | None = None
    pair: PairCalibration | None = None
    disk: DiskPose | None = None
    disk_seen: Seen | None = None
    verdict: Verdict = GOOD

    def facts(self) -> dict[str, str]:
        """Return the verdict, and each camera's views, error and focal length."""
        facts: dict[str, str] = {"verdict": self.verdict.word}
        for name, side in self._sides().items():
            fit, sigma_px = side.lens.fit, float(side.lens.sigma[0])
            focal = f"f {fit.intrinsics.matrix[0, 0]:.1f} ± {sigma_px:.1f} px"
            facts[name] = f"{len(side.lens.kept)} views, error {number(fit.rms_px)} px, {focal}"
        if self.disk is not None:
            facts["axis"] = f"tilt {self.disk.tilt_deg:.2f}° ± {self.disk.direction_sigma_deg:.2f}°"
        return facts

    def _sides(self) -> dict[str, Side]:
        sides = {"camera" if self.right is None else "left camera": self.left, "right camera": self.right}
        return {name: side for name, side in sides.items() if side is not None}

    def _columns(self) -> dict[str, Any]:
        """Return one row per used view: camera, view, error of its corners."""
        rows = [
            (name, int(view), float(error_px))
            for name, side in self._sides().items()
            for view, error_px in zip(side.lens.kept, side.lens.fit.error_px, strict=True)
        ]
        return {key: [row[place] for row in rows] for place, key in enumerate(("camera", "view", "error_px"))}

    def _draw(self, axes: Any) -> None:
        for name, side in self._sides().items():
            residual_px = np.concatenate(side.lens.fit.residual_px)
            axes.plot(*residual_px.T, ".", markersize=2, label=name)
        axes.set(xlabel="measured minus computed corner, x, px", ylabel="y, px", aspect="equal")
        if self._sides():
            axes.legend()


def calibrate_one(images: Sequence[AnyPath], board: Board, *, progress: Progress = silent) -> Calibration:
    """Calibrate one camera from pictures or films of a board.

    Raises InputError when a file cannot be used, or pictures differ in size or camera; NoResultError when the board is
    not found, or the views do not determine a camera.
    """
    side = _side(find_views(images, board, progress=progress), progress=progress)
    verdict = judge_lens(side.lens, side.seen.size_px)
    return Calibration(board, side, verdict=verdict)


def calibrate_two(
    images: Sequence[AnyPath], right: Sequence[AnyPath], board: Board, *, progress: Progress = silent
) -> Calibration:
    """Calibrate a stereo pair from pictures in the same order on both sides, or from two films that start together.

    Raises InputError when the sides differ in number, a file cannot be used, or pictures of one side differ in size or
    camera; NoResultError when the board is not found, or the views do not determine the cameras.
    """
    _require_pairing(expand(images), expand(right))
    seen_left = find_views(images, board, progress=progress)
    # Two films use the frames that were chosen from the left one; with pictures each lens may use its own.
    films = any(is_film(path) for path in expand(images))
    only = frozenset(view.index for view in seen_left.views) if films else None
    seen_right = find_views(right, board, step=seen_left.step, only=only, progress=progress)
    sides = _side(seen_left, progress=progress), _side(seen_right, progress=progress)
    pair = calibrate_pair(sides[0].lens, sides[1].lens, progress=progress)
    lenses = [judge_lens(side.lens, side.seen.size_px) for side in sides]
    of_pair = judge_pair(
        pairs=len(pair.index),
        epipolar_px=float(pair.epipolar_px.mean()),
        baseline_share=pair.baseline_sigma_mm / pair.baseline_mm,
    )
    verdict = worst_of([*zip(("left", "right"), lenses, strict=True), ("pair", of_pair)])
    return Calibration(board, *sides, pair, verdict=verdict)


def measure_axis(
    images: Sequence[AnyPath],
    board: Board,
    intrinsics: Intrinsics,
    *,
    device: str = "",
    base_z_mm: float = 0.0,
    moving_z_mm: float = 0.0,
    progress: Progress = silent,
) -> tuple[DiskPose, Seen]:
    """Return the rotation axis from pictures of the board on the disk.

    ``device`` names the camera and its focal length, if the pictures of its calibration state them.

    Raises ConfigError when the board is symmetric under a turn and several positions of the disk are shown, or the
    camera file is for another picture size; InputError when the pictures are of another camera; NoResultError when the
    board is not found in one of them.
    """
    seen = find_views(images, board, progress=progress)
    require_size(Camera(intrinsics), seen.size_px, film=seen.sources[0].name)
    if device and seen.device and device != seen.device:
        raise InputError(
            "is from another camera or focal length than the calibration",
            where=seen.sources[0].name,
            value=seen.device,
            limit=device,
            do="take it with the calibrated camera, zoom untouched",
        )
    missing = [source.name for source in seen.sources if source.note]
    if missing:
        raise NoResultError(
            "the board on the disk was not found",
            where=missing[0],
            limit=board.describe(),
            do="leave the picture out, or take it again with the whole board in it",
        )
    if len(seen.views) > 1 and (board.turned_looks_the_same or board.columns == board.rows):
        raise ConfigError(
            "this board does not show by how much the disk was turned",
            where="BOARD.toml",
            value=board.describe(),
            limit="columns + rows odd, or a ChArUco board",
            do="give one picture of the board on the disk, or take another board",
        )
    pose = pose_on_disk(seen.views, intrinsics, board, base_z_mm=base_z_mm, moving_z_mm=moving_z_mm)
    return pose, seen


def camera_of(calibration: Calibration, known: Camera | None = None) -> Camera:
    """Return the camera for ``CAMERA.toml``, without the table ``[calibration]``."""
    lens = calibration.left.lens.fit if calibration.left else known
    if lens is None:
        raise ConfigError("needs pictures of a board, or a camera that is known", where="calibrate")
    return Camera(
        intrinsics=lens.intrinsics,
        pose=calibration.disk.pose if calibration.disk else None,
        right=calibration.pair.right if calibration.pair else None,
    )


def _side(seen: Seen, *, progress: Progress) -> Side:
    return Side(seen, calibrate_lens(seen.views, seen.size_px, progress=progress))


def _require_pairing(left: Sequence[Path], right: Sequence[Path]) -> None:
    if len(left) != len(right):
        raise InputError(
            "left and right are not pairs",
            where="IMAGES and --right",
            value=f"{len(left)} left, {len(right)} right",
            limit="as many right as left, in the same order",
            do="leave out pictures without a partner",
        )
    twins = [one for one, other in zip(left, right, strict=True) if one.resolve() == other.resolve()]
    if twins:
        raise InputError(
            "is given as left and as right", where=str(twins[0]), do="give the second camera's pictures with --right"
        )
