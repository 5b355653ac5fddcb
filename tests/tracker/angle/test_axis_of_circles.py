"""Which of a stick's markers is the inner one, and how sure that is."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.core.tracks import MarkerTracks
from tracker.angle.axis_of_circles import turned_round

AXIS = np.array([200.0, 150.0])


def tracks(arms: tuple[float, float, float, float], *, base_rad: float, turn_rad: np.ndarray) -> MarkerTracks:
    """Return markers at distances from the axis, order of the record, with noise of a tenth of a pixel."""
    angles = np.stack([np.full_like(turn_rad, base_rad)] * 2 + [turn_rad] * 2, axis=1)
    away = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * np.array(arms)[:, None]
    n = len(turn_rad)
    noise = np.random.default_rng(3).normal(0.0, 0.1, (n, 4, 2))
    return MarkerTracks(
        np.arange(n), np.arange(n) / 30.0, AXIS + away + noise, np.tile(0.01 * np.eye(2), (n, 4, 1, 1)),
        np.ones((n, 4), np.bool_), (400, 300),
    )  # fmt: skip


@pytest.mark.parametrize("arms", [(40.0, 90.0, 30.0, 80.0), (90.0, 40.0, 30.0, 80.0), (40.0, 90.0, 80.0, 30.0)])
def test_a_motion_of_ten_degrees_tells(arms: tuple[float, float, float, float]) -> None:
    # In line with each other, where the picture alone tells nothing.
    found = turned_round(tracks(arms, base_rad=0.3, turn_rad=np.linspace(0.3, 0.47, 40)), radius_px=5.0)
    np.testing.assert_allclose(found, [arms[0] > arms[1], arms[2] > arms[3]], atol=1e-3)


def test_sticks_that_cross_tell_without_motion() -> None:
    found = turned_round(tracks((40.0, 90.0, 80.0, 30.0), base_rad=0.0, turn_rad=np.full(40, 1.2)), radius_px=5.0)
    np.testing.assert_allclose(found, [0.0, 1.0], atol=1e-3)


def test_sticks_in_line_that_hardly_move_leave_it_open() -> None:
    turn_rad = np.pi + 1e-4 * np.sin(np.arange(40.0))
    found = turned_round(tracks((40.0, 90.0, 30.0, 80.0), base_rad=0.0, turn_rad=turn_rad), radius_px=5.0)
    assert (np.abs(found - 0.5) < 0.45).all()
