"""The verdict on a calibration in plain words: good, usable, or do again, with reasons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from calibration.cameras.lens import LensCalibration
from calibration.views.detect import View
from torsight.core.units import Flags

CELLS: Final = (8, 6)
"""Numbers of cells across and down for the coverage of the picture."""

Word = Literal["good", "usable", "do again"]
_ORDER: Final[tuple[Word, ...]] = ("good", "usable", "do again")


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict in plain words; ``reasons`` is empty for a good calibration."""

    word: Word
    reasons: tuple[str, ...] = ()


GOOD: Final = Verdict("good")


@dataclass(frozen=True, slots=True)
class _Criterion:
    """One value with its limits for good and for usable; ``text`` and ``limit`` are formats of value and limit."""

    name: str
    value: float
    good: float
    usable: float
    text: str
    limit: str
    do: str

    def word(self) -> Word:
        sign = 1.0 if self.good > self.usable else -1.0
        if sign * self.value >= sign * self.good:
            return "good"
        return "usable" if sign * self.value >= sign * self.usable else "do again"

    def reason(self) -> str:
        side = "at least" if self.good > self.usable else "at most"
        seen, limit = self.text.format(self.value), self.limit.format(self.good)
        return f"{self.name} {seen}, good is {side} {limit}; {self.do}"


def cells_covered(views: Sequence[View], size_px: tuple[int, int]) -> Flags:
    """Return the mask (rows, columns) of the picture's cells that contain a corner of the board in any view."""
    seen = np.zeros(CELLS[::-1], bool)
    for view in views:
        place = np.floor((view.corners_px + 0.5) / np.array(size_px) * np.array(CELLS)).astype(int)
        column, row = np.clip(place, 0, np.array(CELLS) - 1).T
        seen[row, column] = True
    return seen


def judge_lens(lens: LensCalibration, size_px: tuple[int, int]) -> Verdict:
    """Return the verdict on one camera."""
    focal = lens.fit.intrinsics.matrix[0, 0]
    covered = cells_covered(lens.kept_views, size_px)
    # OpenCV's tutorial on calibration requires ten pictures, MATLAB's manual accepts a mean error below one pixel.
    # Intrinsics are determined best by boards tilted by 45° (Zhang 2000, section 5.1): 20° to either side are required.
    # The limits of the focal length and the coverage are a choice.
    return _verdict(
        [
            _Criterion(
                "views:", len(lens.kept), 10, 6, text="{:.0f}", limit="{:.0f}", do="take more pictures"
            ),
            _Criterion(
                "mean error", lens.fit.mean_px, 0.5, 1.0, text="is {:.2f} px", limit="{:.2g} px",
                do="mount the board flat, hold it still, light it evenly, focus",
            ),
            _Criterion(
                "focal length", 100.0 * float(lens.sigma[:2].max()) / focal, 0.5, 2.0,
                text="is uncertain by {:.2g} %", limit="{:.2g} %",
                do="tilt the board more, to all sides, and come nearer",
            ),
            _Criterion(
                "board's orientations", lens.fit.orientations_deg, 40.0, 15.0,
                text="differ by {:.0f}°", limit="{:.0f}°",
                do="tilt the board to the left, right, top and bottom by 20° to 45°",
            ),
            _Criterion(
                "coverage", 100.0 * float(covered.mean()), 75.0, 35.0,
                text="is {:.0f} % of the picture", limit="{:.0f} %",
                do=f"bring the board also {_empty_sides(covered)}",
            ),
        ]
    )  # fmt: skip


def _empty_sides(covered: Flags) -> str:
    """Return in words the edges of the picture along which most cells contain no corner."""
    edges = {
        "to the left": covered[:, 0],
        "to the right": covered[:, -1],
        "to the top": covered[0],
        "to the bottom": covered[-1],
    }
    empty = [name for name, cells in edges.items() if cells.mean() < 0.5]
    return ", ".join(empty) or "into the empty parts that the picture of the coverage shows"


def judge_pair(*, pairs: int, epipolar_px: float, baseline_share: float) -> Verdict:
    """Return the verdict on a stereo pair's geometry; ``baseline_share`` is sigma over baseline."""
    return _verdict(
        [
            _Criterion("pairs:", pairs, 8, 4, text="{:.0f}", limit="{:.0f}", do="take more pairs"),
            _Criterion(
                "epipolar error", epipolar_px, 0.5, 1.0, text="is {:.2f} px", limit="{:.2g} px",
                do="give both sides in one order, release both cameras at once, hold the board still, move no camera",
            ),
            _Criterion(
                "baseline", 100.0 * baseline_share, 0.5, 2.0,
                text="is uncertain by {:.2g} %", limit="{:.2g} %",
                do="show the board to both cameras from nearer and more tilted",
            ),
        ]
    )  # fmt: skip


def worst_of(verdicts: Sequence[tuple[str, Verdict]]) -> Verdict:
    """Return the worst verdict of several parts, with each reason prefixed by its part's name."""
    word = _ORDER[max(_ORDER.index(verdict.word) for _, verdict in verdicts)]
    return Verdict(
        word, tuple(f"{name}: {reason}" if name else reason for name, verdict in verdicts for reason in verdict.reasons)
    )


def _verdict(criteria: Sequence[_Criterion]) -> Verdict:
    words = [criterion.word() for criterion in criteria]
    return Verdict(
        _ORDER[max(_ORDER.index(word) for word in words)],
        tuple(criterion.reason() for criterion, word in zip(criteria, words, strict=True) if word != "good"),
    )
