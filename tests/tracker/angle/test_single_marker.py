"""The direction from one marker alone, against points put on circles by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.angle.camera_motion import picture_shift
from tracker.angle.row_time import circles
from tracker.angle.single_marker import single_marker_direction

SIGMA = 0.02


def scene(seed: int, *, shift: float = 0.0, arc_rad: float = 4.0):
    """Return truth, base and moving points with covariances: the axis at (12, −7), arms that are not quite in line."""
    rng = np.random.default_rng(seed)
    n = 240
    truth = 0.3 + arc_rad * np.linspace(0.0, 1.0, n)
    moves = shift * rng.normal(size=(n, 2))
    spread = np.tile(SIGMA**2 * np.eye(2), (n, 1, 1))

    def seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return points + moves + SIGMA * rng.normal(size=(n, 2)), spread

    base = tuple(seen(np.tile([60.0 + 70.0 * k, 5.0], (n, 1))) for k in (0, 1))
    inner, outer = np.array([50.0, 2.0]), np.array([130.0, -3.0])
    own = np.arctan2(*(outer - inner)[::-1])
    turn = np.stack([[np.cos(truth - own), -np.sin(truth - own)], [np.sin(truth - own), np.cos(truth - own)]])
    moving = tuple(seen(np.array([12.0, -7.0]) + np.einsum("ijn,j->ni", turn, q)) for q in (inner, outer))
    return truth, base, moving


def unmoved(base, moving):
    """Return the moving stick's points without the shift that the base shows, where it shows one."""
    step, _ = picture_shift(np.stack([p for p, _ in base], axis=1), np.stack([s for _, s in base], axis=1))
    return tuple((points - step, spread) for points, spread in moving)


def hide(moving, marker: int, frames: slice):
    points = [values.copy() for values, _ in moving]
    points[marker][frames] = np.nan
    offset = points[1] - points[0]
    return tuple((p, moving[0][1]) for p in points), np.arctan2(offset[:, 1], offset[:, 0])


@pytest.mark.parametrize("marker", [0, 1])
@pytest.mark.parametrize("shift", [0.0, 1.5])
def test_one_marker_and_the_axis_tell_the_direction(marker: int, shift: float) -> None:
    truth, base, whole = scene(3 + marker, shift=shift)
    covered = slice(90, 150)
    moving, pair_rad = hide(unmoved(base, whole), marker, covered)
    angle_rad, variance_rad2 = single_marker_direction(moving, pair_rad)
    found = np.isfinite(angle_rad)
    assert found[covered].all()
    assert found.sum() == 60
    error = np.angle(np.exp(1j * (angle_rad - truth)))[covered]
    # The seen marker's own error over its arm, with that of the base where the camera shakes.
    bound = SIGMA * np.sqrt(1.5 if shift else 1.0) / (50.0 if marker else 130.0)
    assert np.sqrt(np.mean(error**2)) < 1.5 * bound + 2e-5
    assert 0.3 < np.sqrt(np.mean(error**2 / variance_rad2[covered])) < 1.4


def test_too_little_motion_tells_no_axis() -> None:
    _, _, whole = scene(8, arc_rad=0.01)
    moving, pair_rad = hide(whole, 1, slice(100, 120))
    assert not np.isfinite(single_marker_direction(moving, pair_rad)[0]).any()


def test_nothing_is_said_where_no_marker_is_seen() -> None:
    _, _, whole = scene(5)
    moving, _ = hide(whole, 0, slice(90, 100))
    moving, pair_rad = hide(moving, 1, slice(90, 100))
    assert not np.isfinite(single_marker_direction(moving, pair_rad)[0]).any()


def test_circles_are_those_of_least_squares() -> None:
    rng = np.random.default_rng(3)
    turn = rng.uniform(0.0, 5.0, 60)
    arms = np.exp(1j * turn)[:, None] * [20.0 + 3.0j, 90.0 - 4.0j] + 130.0 + 95.0j
    points = np.stack([arms.real, arms.imag], axis=-1) + rng.normal(0.0, 0.5, (60, 2, 2))
    found, normal = circles(points, turn)
    rows, targets = [], []
    for pair, angle in zip(points, turn, strict=True):
        rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for at, place in enumerate(pair):
            own = np.zeros((2, 4))
            own[:, 2 * at : 2 * at + 2] = rotation
            rows.append(np.hstack([np.eye(2), own]))
            targets.append(place)
    design = np.vstack(rows)
    expected = np.linalg.lstsq(design, np.concatenate(targets), rcond=None)[0]
    assert np.stack([found.real, found.imag], axis=1).ravel() == pytest.approx(expected, rel=1e-7)
    # In real numbers the normal matrix is twice as large: its real parts are those of x with x.
    assert normal.real == pytest.approx((design.T @ design)[::2, ::2])
