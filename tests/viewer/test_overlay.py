"""What is drawn on the film: by plane geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torsight.viewer.overlay import overlay

CENTRE = np.array([200.0, 150.0])


def rig(base_rad: float, angle_rad: float) -> np.ndarray:
    """Positions of the four markers of two sticks that point away from one centre (y down)."""
    rows = [
        CENTRE + radius * np.array([np.cos(turn), -np.sin(turn)])
        for turn in (base_rad, base_rad + angle_rad)
        for radius in (30.0, 80.0)
    ]
    return np.array(rows)


@given(st.floats(-3.1, 3.1), st.floats(-20.0, 20.0))
def test_the_arc_runs_from_the_base_stick_to_the_moving_stick(base_rad: float, angle_rad: float) -> None:
    drawn = overlay(rig(base_rad, angle_rad), angle_rad, scale=1.0)
    # Where the sticks are nearly parallel their crossing is not defined; the arc then is about their middle.
    if abs(np.sin(angle_rad)) < 0.06:
        return
    start, end = drawn.arc_px[0] - CENTRE, drawn.arc_px[-1] - CENTRE
    for point, direction in ((start, base_rad), (end, base_rad + angle_rad)):
        along = np.array([np.cos(direction), -np.sin(direction)])
        assert point @ along == pytest.approx(np.hypot(*point), rel=1e-6)
    turned = np.unwrap(np.arctan2(-(drawn.arc_px - CENTRE)[:, 1], (drawn.arc_px - CENTRE)[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(np.sign(angle_rad) * (abs(angle_rad) % (2 * np.pi)), abs=1e-6)


def test_the_label_carries_the_angle_with_its_turns() -> None:
    drawn = overlay(rig(0.3, np.deg2rad(-412.34)), np.deg2rad(-412.34), scale=1.0)
    assert drawn.label == "−412.3°"


def test_a_missing_marker_takes_its_stick_and_the_arc_with_it() -> None:
    position = rig(0.3, 1.0)
    position[3] = np.nan
    drawn = overlay(position, np.nan, scale=1.0)
    assert drawn.names == ("base_inner", "base_outer", "moving_inner")
    assert drawn.sticks == ("base",)
    assert len(drawn.arc_px) == 0


def test_a_narrower_picture_scales_everything() -> None:
    large = overlay(rig(0.3, 1.0), 1.0, scale=1.0)
    small = overlay(rig(0.3, 1.0), 1.0, scale=0.25)
    np.testing.assert_allclose(small.points_px, large.points_px * 0.25)
    np.testing.assert_allclose(small.arc_px, large.arc_px * 0.25)
