"""What is good, usable, or to be done again."""

import numpy as np
import pytest
from made_up_views import SIZE_PX, exact_view, poses

from calibration.quality.calibration_verdict import GOOD, Verdict, cells_covered, judge_pair, worst_of


def test_cells_are_counted_where_corners_are():
    view = exact_view(poses(1, 0)[0], 0)
    corners = np.array([[0.0, 0.0], [399.0, 299.0], [399.4, 299.4], [60.0, 130.0]])
    object.__setattr__(view, "corners_px", corners)
    covered = cells_covered([view], SIZE_PX)
    assert covered.shape == (6, 8)
    assert {tuple(place) for place in np.argwhere(covered)} == {(0, 0), (5, 7), (2, 1)}


@pytest.mark.parametrize(
    ("pairs", "epipolar_px", "share", "word", "reasons"),
    [
        (10, 0.2, 0.002, "good", []),
        (6, 0.2, 0.002, "usable", ["pairs: 6, good is at least 8; take more pairs"]),
        (
            10,
            1.4,
            0.01,
            "do again",
            ["epipolar error is 1.40 px, good is at most 0.5 px", "baseline is uncertain by 1 %"],
        ),
    ],
)
def test_pair_is_judged_by_its_worst_number(pairs, epipolar_px, share, word, reasons):
    verdict = judge_pair(pairs=pairs, epipolar_px=epipolar_px, baseline_share=share)
    assert verdict.word == word
    assert len(verdict.reasons) == len(reasons)
    for said, expected in zip(verdict.reasons, reasons, strict=True):
        assert said.startswith(expected)


def test_whole_is_as_bad_as_its_worst_part():
    whole = worst_of([("left", GOOD), ("right", Verdict("usable", ("views: 7",)))])
    assert whole == Verdict("usable", ("right: views: 7",))
