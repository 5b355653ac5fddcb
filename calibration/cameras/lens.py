"""Calibration of one camera from the views of a board: intrinsics with uncertainty, and outlier views.

A view is set aside when its error is more than three times the median of all views (and above 0.3 px), worst first,
each time with a new fit. This is done twice: with corners measured in the wide window, which reveals views with
uncertain corners, then with the narrow window, which gives the result.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import cv2
import numpy as np

from calibration.views.detect import View, board_normals
from torsight.core.errors import NoResultError
from torsight.core.optics.camera import Intrinsics
from torsight.core.optics.geometry import project, rotation_matrix
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import Progress, silent
from torsight.core.series import rms
from torsight.core.units import Floats, Ints
from torsight.core.words.wording import counted

FEWEST_VIEWS: Final = 4
"""Least number of views for a calibration. A view of a plane gives two equations for the intrinsics (Z. Zhang, IEEE
TPAMI 22 (2000) 1330): four give twice as many as the focal lengths and the centre need."""
SMALLEST_SPREAD_DEG: Final = 8.0
"""Least difference of the board's orientations; with less the focal length is not determined. Twelve views of the
tests' board (0.1 px of noise) determine it to 0.3 % if they differ by 33°, to 5 % by 13° and to 22 % by 11°."""
PARAMETERS: Final = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
"""Order of the intrinsics' standard deviations."""

CORNER_SIGMA_PX: Final = 0.1
"""Error of the measured corners of a hand-held board in ordinary light."""
_WORSE_THAN_MEDIAN: Final = 3.0
_NEVER_BAD_PX: Final = 3.0 * CORNER_SIGMA_PX
"""A view or pair is set aside if its error is more than this multiple of the median, and more than this error, that of
a hand-held board in ordinary light. Views with errors of 1 and 3 px are all set aside with half of either, 97 in 100
with twice of the first, and never a good one (benchmarks/calibration/constants.py)."""
_MOST_GROUPS: Final = 20
"""Largest number of fits of the jackknife: its sigma then has a standard error of 1 / √(2 · 19) = 16 %."""
_LARGEST_FOCAL_SIGMA: Final = 0.05
"""Largest relative sigma of the focal length: at a distance of 20 sticks it is a stick's length of depth."""

UNTIL_IT_CONVERGES: Final = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
"""End of OpenCV's fits; its default of 30 steps may end earlier."""


@dataclass(frozen=True, slots=True)
class SetAside:
    """A view that was left out: its index among the views, and the reason."""

    view: int
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """One fit of a lens to views.

    ``sigma`` (9,) are standard deviations in the order of :data:`PARAMETERS`, from the fit (independent errors of all
    corners); ``error_px`` (n,) is the root mean square distance between measured and computed corners per view,
    ``residual_px`` measured minus computed. ``rvec`` and ``tvec_mm`` (n, 3) transform from board to camera.
    """

    intrinsics: Intrinsics
    sigma: Floats
    error_px: Floats
    rvec: Floats
    tvec_mm: Floats
    residual_px: tuple[Floats, ...]

    @property
    def rms_px(self) -> float:
        """Root mean square distance over all corners (what OpenCV returns)."""
        return root_mean_square(np.concatenate(self.residual_px))

    @property
    def orientations_deg(self) -> float:
        """Largest angle between the orientations of two views of the board."""
        return spread_deg(np.array([rotation_matrix(rvec)[:, 2] for rvec in self.rvec]))

    @property
    def mean_px(self) -> float:
        """Mean distance over all corners."""
        return float(np.mean(np.linalg.norm(np.concatenate(self.residual_px), axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class LensCalibration:
    """A calibrated camera and its data: the fit to the views with the indices ``kept`` (n,), the others set aside.

    ``first`` is the fit to all views, with corners in the wide window: the calibration without any view set aside.
    ``between_views`` (9,) are standard deviations from leaving out views (jackknife): larger than ``fit.sigma`` where
    errors are correlated within a view, as on a board that is not flat.
    """

    fit: Fit
    views: tuple[View, ...]
    kept: Ints
    aside: tuple[SetAside, ...]
    first: Fit
    between_views: Floats

    @property
    def kept_views(self) -> list[View]:
        """The views that the fit uses."""
        return [self.views[index] for index in self.kept]

    @property
    def aside_views(self) -> list[View]:
        """The views that were set aside, in the order of the pictures."""
        return [view for index, view in enumerate(self.views) if index not in self.kept]

    @property
    def sigma(self) -> Floats:
        """The larger of both standard deviations, in the order of :data:`PARAMETERS`."""
        return np.maximum(self.fit.sigma, self.between_views)


def calibrate_lens(views: Sequence[View], size_px: tuple[int, int], *, progress: Progress = silent) -> LensCalibration:
    """Calibrate one camera from views of the board in pictures of one size.

    Too few views, or views with similar orientations of the board, raise NoResultError. ``progress`` is called after
    every fit of the jackknife.
    """
    require_views(len(views))
    _require_spread(spread_deg(board_normals(views)), len(views))
    with one_thread():
        first = fit_lens(views, size_px, window="wide")
        kept, aside = _without_bad(views, size_px, list(range(len(views))), window="wide")
        kept, more = _without_bad(views, size_px, kept, window="narrow")
        chosen = [views[index] for index in kept]
        fit = fit_lens(chosen, size_px)
        _require_determined(fit)
        return LensCalibration(
            fit=fit,
            views=tuple(views),
            kept=np.array(kept, np.int64),
            aside=(*aside, *more),
            first=first,
            between_views=_jackknife(chosen, size_px, fit, progress=progress),
        )


def fit_lens(views: Sequence[View], size_px: tuple[int, int], *, window: Literal["narrow", "wide"] = "narrow") -> Fit:
    """Fit focal lengths, centre and five distortion coefficients to views of a board.

    Raises NoResultError when the fit fails or its results are not finite.
    """
    return _fit_lens(tuple(views), size_px, window)


@functools.lru_cache(maxsize=2 * _MOST_GROUPS + 2)
def _fit_lens(views: tuple[View, ...], size_px: tuple[int, int], window: str) -> Fit:
    """Fit, with a cache: the jackknife of a pair fits the same views again, for either camera."""
    corners = [view.corners_px if window == "narrow" else view.wide_px for view in views]
    try:
        _, matrix, distortion, rvec, tvec, sigma, _, _ = cv2.calibrateCameraExtended(
            [view.points_mm.astype(np.float32) for view in views],
            [corner.astype(np.float32).reshape(-1, 1, 2) for corner in corners],
            size_px,
            np.eye(3),
            np.zeros(5),
            flags=0,
            criteria=UNTIL_IT_CONVERGES,
        )
    except cv2.error as error:
        raise _no_lens(len(views)) from error
    intrinsics = Intrinsics(size_px, np.asarray(matrix, np.float64), np.asarray(distortion, np.float64).reshape(-1)[:5])
    rvecs, tvecs = (np.array([np.asarray(item).reshape(3) for item in items]) for items in (rvec, tvec))
    residuals = tuple(
        corner - project(view.points_mm, intrinsics, rvec=turn, tvec_mm=move)
        for view, corner, turn, move in zip(views, corners, rvecs, tvecs, strict=True)
    )
    if not all(np.isfinite(residual).all() for residual in residuals):
        raise _no_lens(len(views))
    return Fit(
        intrinsics=intrinsics,
        sigma=np.asarray(sigma, np.float64).reshape(-1)[: len(PARAMETERS)],
        error_px=np.array([root_mean_square(residual) for residual in residuals]),
        rvec=rvecs,
        tvec_mm=tvecs,
        residual_px=residuals,
    )


def root_mean_square(distances: Floats) -> float:
    """Return the root mean square length of distances (n, 2)."""
    return rms(np.linalg.norm(distances, axis=1))


def lens_values(intrinsics: Intrinsics) -> Floats:
    """Return the nine values in the order of :data:`PARAMETERS`."""
    matrix = intrinsics.matrix
    return np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *intrinsics.distortion])


def _without_bad(
    views: Sequence[View], size_px: tuple[int, int], kept: list[int], *, window: Literal["narrow", "wide"]
) -> tuple[list[int], list[SetAside]]:
    aside: list[SetAside] = []
    while len(kept) > FEWEST_VIEWS:
        error = fit_lens([views[index] for index in kept], size_px, window=window).error_px
        worst = worst_view(error)
        if worst is None:
            break
        median = float(np.median(error))
        view = views[kept[worst]]
        shift = root_mean_square(view.wide_px - view.corners_px)
        why = f"its corners are {error[worst]:.2f} px off, the median of the views is {median:.2f} px"
        # If the window accounts for more than half of the error, blur or light is the cause, which the user can change.
        if window == "wide" and shift > 0.5 * error[worst]:
            why += f"; they move by {shift:.2f} px with the window in which they are measured"
        aside.append(SetAside(kept.pop(worst), why))
    return kept, aside


def _jackknife(views: Sequence[View], size_px: tuple[int, int], fit: Fit, *, progress: Progress) -> Floats:
    """Return the jackknife's standard deviations, from fits that leave out one group of views each."""
    if len(views) - math.ceil(len(views) / _MOST_GROUPS) < FEWEST_VIEWS:
        return np.zeros(len(PARAMETERS))

    def without(gone: range) -> Floats:
        rest = [view for place, view in enumerate(views) if place not in gone]
        return lens_values(fit_lens(rest, size_px).intrinsics)

    left_out = without_each(len(views), without, words="lens without some views", progress=progress)
    return jackknife_sigma(left_out, lens_values(fit.intrinsics))


def worst_view(error_px: Floats) -> int | None:
    """Return the index of the largest error (n,) of views or pairs; None if it is no outlier."""
    worst = int(np.argmax(error_px))
    limit_px = max(_WORSE_THAN_MEDIAN * float(np.median(error_px)), _NEVER_BAD_PX)
    return worst if error_px[worst] > limit_px else None


def without_each(count: int, values: Callable[[range], Floats], *, words: str, progress: Progress) -> Floats:
    """Return the values (g, p) without each of g groups of ``count`` views or pairs, for a jackknife."""
    # Every n-th view, not neighbours, between which the board is turned little, so that they are similar.
    groups = min(count, _MOST_GROUPS)
    found = []
    for first in range(groups):
        found.append(values(range(first, count, groups)))
        progress(words, first + 1, groups)
    return np.array(found)


def jackknife_sigma(left_out: Floats, whole: Floats) -> Floats:
    """Return standard deviations (p,) from the values (g, p) without each of g groups and the values (p,) with all."""
    groups = len(left_out)
    return np.asarray(np.sqrt((groups - 1) / groups * np.sum((left_out - whole) ** 2, axis=0)))


def spread_deg(normals: Floats) -> float:
    """Return the largest angle between two of the board's normals (n, 3), degrees."""
    return float(np.degrees(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0)).max()))


def require_views(count: int) -> None:
    """Refuse too few views."""
    if count < FEWEST_VIEWS:
        raise NoResultError(
            "too few views of the board",
            value=f"the board in {counted(count, 'picture')}",
            limit=f"at least {FEWEST_VIEWS}; 10 to 20 are good",
            do="take more pictures, the board tilted to all sides and in every part of the picture",
        )


def _require_determined(fit: Fit) -> None:
    """Refuse a fit that the views do not determine, by its orientations and its sigma of the focal length."""
    _require_spread(fit.orientations_deg, len(fit.rvec))
    share = float(fit.sigma[0] / fit.intrinsics.matrix[0, 0])
    if share > _LARGEST_FOCAL_SIGMA:
        raise NoResultError(
            "the views do not determine the focal length",
            value=f"known to {100.0 * share:.0f} % only",
            limit=f"{100.0 * _LARGEST_FOCAL_SIGMA:.0f} %",
            do="take more pictures, the board larger and tilted by 20° to 45° to all sides",
        )


def _require_spread(spread: float, count: int) -> None:
    if spread < SMALLEST_SPREAD_DEG:
        raise NoResultError(
            "all views are from the same side: focal length and distance cannot be distinguished",
            value=f"{count} views within {spread:.1f}° of one orientation",
            limit=f"orientations that differ by {SMALLEST_SPREAD_DEG:g}° at least, by 40° and more for a good result",
            do="tilt the board to the left, right, top and bottom by 20° to 45° between the pictures",
        )


def _no_lens(count: int) -> NoResultError:
    return NoResultError(
        "no lens fits the views",
        value=f"{count} views",
        do="check columns, rows and square_mm in BOARD.toml, and that the pictures are of one camera",
    )
