"""The pose of the second camera relative to the first, from pictures of the board taken at the same instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from calibration.cameras.lens import (
    UNTIL_IT_CONVERGES,
    LensCalibration,
    SetAside,
    fit_lens,
    jackknife_sigma,
    without_each,
    worst_view,
)
from calibration.views.detect import FEWEST_CORNERS, View
from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Intrinsics, RightCamera
from torsight.core.optics.geometry import epipolar_distance_px, rotation_vector
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import Progress, silent
from torsight.core.units import Floats, Ints
from torsight.core.words.wording import counted

FEWEST_PAIRS: Final = 3
"""Least number of pairs: one determines the second camera's pose; among three an outlier is recognised."""


@dataclass(frozen=True, slots=True, eq=False)
class _Common:
    """The corners that both cameras see in one pair of pictures."""

    index: int
    points_mm: Floats
    left_px: Floats
    right_px: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PairCalibration:
    """A stereo pair: the second camera with its pose relative to the first, and the distance between both.

    ``sigma`` (6,) are standard deviations of rvec (rad) and tvec_mm, from leaving out pairs (jackknife), including the
    uncertainty of the lenses. ``rms_px`` is the root mean square error of the corners in both pictures with one pose of
    the board per pair, ``epipolar_px`` (n,) the mean distance of the corners from their epipolar lines, ``index`` (n,)
    the pairs' indices in the list of pictures; ``aside`` holds the pairs that were left out, by the same indices.
    """

    right: RightCamera
    sigma: Floats
    baseline_mm: float
    baseline_sigma_mm: float
    rms_px: float
    epipolar_px: Floats
    index: Ints
    aside: tuple[SetAside, ...]


def calibrate_pair(left: LensCalibration, right: LensCalibration, *, progress: Progress = silent) -> PairCalibration:
    """Return the second camera's pose relative to the first; both lenses are fixed.

    ``progress`` is called after every fit of the jackknife.

    Raises NoResultError when too few pictures show the board in both cameras.
    """
    pairs = _common_views(left.kept_views, right.kept_views)
    if len(pairs) < FEWEST_PAIRS:
        raise NoResultError(
            "too few pairs of pictures show the board in both cameras",
            value=counted(len(pairs), "pair"),
            limit=f"at least {FEWEST_PAIRS}; 8 and more are good",
            do="hold the board where both cameras see it, and name left and right pictures in the same order",
        )
    lenses = left.fit.intrinsics, right.fit.intrinsics
    aside: list[SetAside] = []
    with one_thread():
        while True:
            motion, rms_px, error = _fit(pairs, *lenses)
            worst = worst_view(error) if len(pairs) > FEWEST_PAIRS else None
            if worst is None:
                break
            median = float(np.median(error))
            why = f"the two pictures disagree by {error[worst]:.2f} px, the median is {median:.2f} px"
            aside.append(SetAside(pairs.pop(worst).index, why))
        sigma, baseline_sigma_mm = _jackknife(pairs, left, right, motion, progress=progress)
    camera = RightCamera(lenses[1], rvec=motion[:3], tvec_mm=motion[3:])
    epipolar = [
        float(np.mean(epipolar_distance_px(pair.left_px, pair.right_px, left=lenses[0], right=camera)))
        for pair in pairs
    ]
    return PairCalibration(
        right=camera,
        sigma=sigma,
        baseline_mm=float(np.linalg.norm(motion[3:])),
        baseline_sigma_mm=baseline_sigma_mm,
        rms_px=rms_px,
        epipolar_px=np.array(epipolar),
        index=np.array([pair.index for pair in pairs], np.int64),
        aside=tuple(aside),
    )


def _common_views(left: Sequence[View], right: Sequence[View]) -> list[_Common]:
    others = {view.index: view for view in right}
    pairs = []
    for view, other in ((view, others[view.index]) for view in left if view.index in others):
        _, mine, theirs = np.intersect1d(view.corner, other.corner, return_indices=True)
        if len(mine) >= FEWEST_CORNERS:
            pairs.append(_Common(view.index, view.points_mm[mine], view.corners_px[mine], other.corners_px[theirs]))
    return pairs


def _fit(pairs: Sequence[_Common], left: Intrinsics, right: Intrinsics) -> tuple[Floats, float, Floats]:
    """Return rvec and tvec (6,), the rms error over both pictures, and the error per pair."""
    try:
        answer = cv2.stereoCalibrateExtended(
            [pair.points_mm.astype(np.float32) for pair in pairs],
            [pair.left_px.astype(np.float32).reshape(-1, 1, 2) for pair in pairs],
            [pair.right_px.astype(np.float32).reshape(-1, 1, 2) for pair in pairs],
            left.matrix,
            left.distortion,
            right.matrix,
            right.distortion,
            left.size_px,
            np.eye(3),
            np.zeros(3),
            flags=cv2.CALIB_FIX_INTRINSIC,
            criteria=UNTIL_IT_CONVERGES,
        )
    except cv2.error as error:
        raise NoResultError(
            "no arrangement of two cameras fits the pairs",
            value=f"{len(pairs)} pairs",
            do="check that the pictures are in the same order on both sides and that neither camera moved",
        ) from error
    rms_px, rotation, shift, per_view = answer[0], answer[5], answer[6], answer[11]
    motion = np.concatenate(
        (rotation_vector(np.asarray(rotation, np.float64)), np.asarray(shift, np.float64).reshape(3))
    )
    error_px = np.sqrt(np.mean(np.asarray(per_view, np.float64).reshape(len(pairs), 2) ** 2, axis=1))
    return motion, float(rms_px), np.asarray(error_px)


def _jackknife(
    pairs: Sequence[_Common], left: LensCalibration, right: LensCalibration, motion: Floats, *, progress: Progress
) -> tuple[Floats, float]:
    """Return the standard deviations of the motion (6,) and of the baseline, mm.

    Groups of pairs are left out of the fits of the lenses, too, whose uncertainty is the larger part.
    """

    def without(places: range) -> Floats:
        gone = {pairs[place].index for place in places}
        lenses = [
            fit_lens([view for view in camera.kept_views if view.index not in gone], camera.fit.intrinsics.size_px)
            for camera in (left, right)
        ]
        return _fit([pair for pair in pairs if pair.index not in gone], *(lens.intrinsics for lens in lenses))[0]

    values = without_each(len(pairs), without, words="pair without some views", progress=progress)
    baseline = np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
    whole = np.array([np.linalg.norm(motion[3:])])
    return jackknife_sigma(values, motion), float(jackknife_sigma(baseline, whole)[0])
