"""What is said to have happened in a film, from the rows of its frames."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.core.tracks import StickAngles
from tracker.quality.events import find_events
from tracker.rows import ROW

FRAMES, BUMP = 120, 70
NOISE_PX = 0.1


def bumps(shift_px: list[list[float]]) -> list[dict[str, object]]:
    """Return the bumps that are told of where the two base markers are shifted from a frame on."""
    random = np.random.default_rng(11)
    rows = np.zeros(FRAMES, ROW)
    rows["position_px"] = np.array([[100.0, 100.0], [40.0, 110.0], [120.0, 90.0], [130.0, 30.0]])
    rows["position_px"] += random.normal(0.0, NOISE_PX, rows["position_px"].shape)
    rows["position_px"][BUMP:, :2] += np.array(shift_px)
    frame = np.arange(FRAMES)
    every = np.ones(FRAMES, np.bool_)
    angles = StickAngles(frame, frame / 30.0, np.zeros(FRAMES), np.full(FRAMES, 1e-3), every, every)
    return [event for event in find_events(rows, angles, []) if event["kind"] == "bump"]


@pytest.mark.parametrize("size_px", [4.0, 12.0])
def test_a_camera_that_is_moved_takes_both_base_markers_along(size_px: float) -> None:
    (bump,) = bumps([[0.6 * size_px, -0.8 * size_px]] * 2)
    # The mean of ten frames on each side: the noise hides the instant by a frame at most.
    assert abs(int(str(bump["frame"])) - BUMP) <= 1
    told = float(str(bump["text"]).split()[4])
    # Four standard deviations of the difference of two means of ten frames, and the rounding of the text.
    assert told == pytest.approx(size_px, abs=4.0 * NOISE_PX * np.sqrt(2.0 / 10.0) + 0.05)


@pytest.mark.parametrize("shift_px", [[[0.0, 0.0], [0.0, 0.0]], [[15.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [-9.0, 9.0]]])
def test_where_a_base_marker_stands_still_the_camera_does(shift_px: list[list[float]]) -> None:
    assert bumps(shift_px) == []
