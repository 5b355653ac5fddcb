"""A point without a dot: the texture around it in the first frame, and the search for it in another frame."""

from __future__ import annotations

import math
import operator
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.units import Floats
from tracker.follow.camera_state import TURN_RAD
from tracker.follow.redetect import Region
from tracker.innovation import SIGMAS
from tracker.patches.align import Look, Patch, cut_out
from tracker.patches.warps import Point, place, project, similarity, size_of

_SOFT: Final = 1.0
"""Blur, in steps of the patch, before a round spot is distinguished: noise that is not blurred would count as
texture."""
_ROUND: Final = 5.0
"""Smallest ratio of a patch's errors in rotation and position at which it is round. Texture has 0.9 to 2.5, also in the
real films of benchmarks/tracking/table.py, and the dots there 17 to 30, or 7 to 10 in noise of 8 grey levels, wherever
in the patch they lie."""
_COARSE: Final = 2.0
"""Steps of the patches per step of the coarse search."""
_ACROSS: Final = 15.0
"""Most steps in a patch's radius, so that a large one costs no more: its steps are wider than a pixel."""
_KEPT: Final = 8
"""Most candidates that are fitted: without a limit a frame in which a stick is lost costs a seventh more (the rolling
cylinder of benchmarks/tracking/table.py)."""
_LIKELY: Final = 0.35
"""Mean coarse correlation of both points below which a candidate is not fitted: noise alone gives 0.1 over the 100
steps of a patch, a patch that is rotated by half a step of the search 0.5."""


def texture_patch(luma: NDArray[np.uint8], x_px: float, y_px: float, *, window_px: float, freedom: int = 6) -> Patch:
    """Return the patch of texture in a disc around a point of the first frame; for ``freedom`` see :class:`Patch`."""
    step_px = spacing_px(window_px)
    look = texture_look(luma, x_px, y_px, window_px=window_px)
    return Patch(look, half_px=window_px, spacing_px=step_px, round_=True, freedom=freedom)


def spacing_px(window_px: float) -> float:
    """Return the distance between neighbouring points of a patch of texture, px."""
    return max(1.0, window_px / _ACROSS)


def round_spot(luma: NDArray[np.uint8], x_px: float, y_px: float, *, window_px: float) -> Point | None:
    """Return the middle of what looks the same at any rotation, such as a dot, in a disc around a point, or None."""
    look = texture_look(luma, x_px, y_px, window_px=window_px, blur=_SOFT)
    (x, y), doubt = Patch(look, half_px=window_px, spacing_px=spacing_px(window_px), round_=True).most_certain()
    return (x_px + x, y_px + y) if doubt > _ROUND and math.hypot(x, y) < window_px else None


def texture_look(luma: NDArray[np.uint8], x_px: float, y_px: float, *, window_px: float, blur: float = 0.5) -> Look:
    """Return the brightness around a point of a picture, blurred like the pictures with which it is compared.

    ``blur`` is the standard deviation of the blur, in steps of the patch.
    """
    step_px = spacing_px(window_px)
    margin = math.ceil(math.sqrt(2.0) * window_px + 4.0 * step_px)
    left, top = round(x_px) - margin, round(y_px) - margin
    around = cut_out(luma, left + margin, top + margin, margin).astype(np.float32)
    part = cv2.GaussianBlur(around, (0, 0), blur * step_px)

    def brightness(x: Floats, y: Floats) -> Floats:
        at = (np.asarray(x + x_px - left, np.float32), np.asarray(y + y_px - top, np.float32))
        seen = cv2.remap(part, at[0].reshape(-1, 1), at[1].reshape(-1, 1), cv2.INTER_LINEAR)
        return np.asarray(seen, dtype=np.float64).ravel()

    return brightness


class TurnedSearch:
    """Coarse search for the two patches of one stick at any rotation, by normalised correlation.

    ``looks`` are the brightness around both points in the first frame, ``offset_px`` apart, blurred for its steps
    and known within ``window_px``. A ``still`` stick turns only with the camera: one rotation is searched.
    """

    def __init__(self, looks: tuple[Look, Look], *, window_px: float, offset_px: Point, still: bool) -> None:
        self._offset = offset_px
        self._step = step = _COARSE * spacing_px(window_px)
        half = int(window_px / math.sqrt(2.0) / step)
        self._half = half
        # Between two rotations a patch's rim moves by two steps of the search: the largest error is one step.
        turns = math.ceil(math.pi * window_px / step)
        self._turns = [0.0] if still else [math.tau * number / turns for number in range(turns)]
        v, u = (axis.ravel() * step for axis in np.mgrid[-half : half + 1, -half : half + 1])
        side = 2 * half + 1
        self._templates: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []
        for turn in self._turns:
            cos, sin = math.cos(turn), math.sin(turn)
            # The template's own offsets are those of the picture turned back.
            x, y = cos * u + sin * v, cos * v - sin * u
            one, two = (look(x, y).astype(np.float32).reshape(side, side) for look in looks)
            self._templates.append((one, two))
        # Error of the second point's position for a rotation wrong by half a step, or a rolled camera.
        wrong_rad = 3.0 * TURN_RAD if still else math.pi / turns
        self._loose = 2 * math.ceil(math.hypot(*offset_px) * math.sin(wrong_rad) / step) + 1

    def find(self, luma: NDArray[np.uint8], region: Region) -> list[Floats]:
        """Return the warps of the first point that are possible in a region, by decreasing correlation."""
        (height, width), step = luma.shape, self._step
        reach = math.hypot(*self._offset)
        left, right = max(0, int(region.left - reach)), min(width, int(region.right + reach))
        top, bottom = max(0, int(region.top - reach)), min(height, int(region.bottom + reach))
        part = luma[top:bottom, left:right]
        if min(part.shape) < step * (2 * self._half + 3):
            return []
        size = int(part.shape[1] / step), int(part.shape[0] / step)
        small = cv2.resize(part, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        found: list[tuple[float, Floats]] = []
        for turn, pair in zip(self._turns, self._templates, strict=True):
            score = self._joint(small, pair, turn)
            for row, column in _peaks(score, self._half):
                x = left - 0.5 + step * (column + self._half + 0.5)
                y = top - 0.5 + step * (row + self._half + 0.5)
                inside = region.left <= x <= region.right and region.top <= y <= region.bottom
                if inside and score[row, column] > _LIKELY:
                    found.append((-float(score[row, column]), similarity(x, y, turn_rad=turn)))
        return [warp for _, warp in sorted(found, key=operator.itemgetter(0))[:_KEPT]]

    def near(self, luma: NDArray[np.uint8], end: int, warp: Floats, sigma_px: float) -> list[Floats]:
        """Return the warps at which the first (``end`` 0) or second point may be, near ``warp``.

        ``sigma_px`` is the standard deviation of the position by ``warp``.
        """
        more = math.ceil(SIGMAS * sigma_px / (size_of(warp) * self._step))
        reach = self._half + more
        rim = self._step * reach * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
        (x, y), away = (round(value) for value in place(warp)), project(warp, rim) - np.array([place(warp)]).T
        half = math.ceil(float(np.abs(away).max())) + 2
        part = cv2.GaussianBlur(cut_out(luma, x, y, half), (0, 0), 0.5 * self._step)
        step = np.diag([self._step, self._step, 1.0])
        from_part = similarity(half - x, half - y) @ warp @ step @ similarity(-reach, -reach)
        how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        small = cv2.warpPerspective(part, from_part, (2 * reach + 1, 2 * reach + 1), flags=how).astype(np.float32)
        score = _likeness(small, self._templates[0][end])
        return [
            warp @ similarity(self._step * (column - more), self._step * (row - more))
            for row, column in _peaks(score, self._half)
            if score[row, column] > _LIKELY
        ]

    def _joint(
        self, small: NDArray[np.float32], pair: tuple[NDArray[np.float32], NDArray[np.float32]], turn: float
    ) -> NDArray[np.float32]:
        """Return the mean correlation of both points as a map over the position of the first."""
        one, two = (_likeness(small, template) for template in pair)
        two = np.maximum(cv2.dilate(two, np.ones((self._loose, self._loose), np.uint8)), 0.0)
        cos, sin = math.cos(turn), math.sin(turn)
        dx = round((cos * self._offset[0] - sin * self._offset[1]) / self._step)
        dy = round((sin * self._offset[0] + cos * self._offset[1]) / self._step)
        to_first = np.array([[1.0, 0.0, -dx], [0.0, 1.0, -dy]])
        partner = cv2.warpAffine(two, to_first, one.shape[::-1], flags=cv2.INTER_NEAREST)
        return np.asarray(0.5 * (one + partner), dtype=np.float32)


def _likeness(small: NDArray[np.float32], template: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the correlation of a template with a picture at every position, 0 where the picture is uniform."""
    score = cv2.matchTemplate(small, template, cv2.TM_CCOEFF_NORMED)
    return np.asarray(np.nan_to_num(score, posinf=0.0, neginf=0.0), dtype=np.float32)


def _peaks(score: NDArray[np.float32], half: int) -> list[tuple[int, int]]:
    """Return the (row, column) of the two highest maxima, no closer than ``half`` in both directions."""
    left = score.copy()
    found: list[tuple[int, int]] = []
    for _ in range(2):
        row, column = (int(value) for value in np.unravel_index(int(np.argmax(left)), left.shape))
        found.append((row, column))
        left[max(0, row - half) : row + half + 1, max(0, column - half) : column + half + 1] = -1.0
    return found
