"""Which of two sticks moves: the one that is seen to turn by more than its readings' noise."""

from __future__ import annotations

import numpy as np

from tracker.appearance.lucas_kanade import READING
from tracker.follow.follower import Follower
from tracker.rows import HIDDEN, SEEN


class Unread:
    """A stick of which the readings are given."""

    drawn = False


def follower() -> Follower:
    return Follower([Unread(), Unread()], moving=None)


def readings(turn_deg: float, *, length_px: float = 20.0, sigma_px: float = 0.01, lost: bool = False) -> np.ndarray:
    """Return the readings of a base of 100 px and a stick that is turned."""
    found = np.zeros(4, READING)
    turn = np.deg2rad(turn_deg)
    found["x"], found["y"] = (
        [0.0, 100.0, 0.0, length_px * np.cos(turn)],
        [0.0, 0.0, 50.0, 50.0 + length_px * np.sin(turn)],
    )
    found["covariance"] = [sigma_px**2, 0.0, sigma_px**2]
    found["state"] = SEEN
    found["state"][3] = HIDDEN if lost else SEEN
    return found


def named_after(*frames: np.ndarray) -> int | None:
    one = follower()
    for frame in frames:
        one.look_for_motion(frame)
    return one.moving


def test_a_turn_counts_against_the_noise_of_its_readings() -> None:
    # One degree is asked for, and three times the error of the difference of two directions of 20 px: 2 · 3 · 4.0.
    assert named_after(readings(0.0), readings(1.5)) == 1
    assert named_after(readings(0.0, sigma_px=0.1), readings(2.5, sigma_px=0.1)) is None
    assert named_after(readings(0.0, sigma_px=0.1), readings(3.0, sigma_px=0.1)) == 1


def test_what_was_found_again_elsewhere_has_not_turned() -> None:
    lost = readings(0.0, lost=True)
    assert named_after(readings(0.0), lost, readings(6.0), readings(6.1)) is None
    assert named_after(readings(0.0), lost, readings(6.0), readings(8.0)) == 1
