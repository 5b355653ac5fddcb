"""What automatic detection considers in a picture, and why it refuses it."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.detect.candidates import look


def board(*dots: tuple[float, float, float, float], ground: float = 180.0) -> np.ndarray:
    """Return a plain picture with discs (x, y, radius, brightness), each pixel the mean of 16 samples."""
    y, x = np.mgrid[:240, :320].astype(float)
    picture = np.full((240, 320), ground)
    fine = (np.arange(4) + 0.5) / 4 - 0.5
    for dot_x, dot_y, radius, brightness in dots:
        share = np.mean([np.hypot(x + i - dot_x, y + j - dot_y) < radius for i in fine for j in fine], axis=0)
        picture += share * (brightness - picture)
    noise = np.random.default_rng(3).normal(0.0, 1.0, picture.shape)
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


FOUR = ((100.3, 60.2, 5.0, 40.0), (60.1, 60.7, 5.0, 40.0), (160.6, 100.4, 5.0, 40.0), (160.2, 150.9, 5.0, 40.0))


def test_four_dots_on_two_sticks_are_taken() -> None:
    seen = look(board(*FOUR))
    assert seen.reason == ""
    assert [one.taken for one in seen.candidates] == [True] * 4
    assert [one.reason for one in seen.candidates] == [""] * 4
    assert [one.number for one in seen.candidates] == [1, 2, 3, 4]
    assert seen.sticks_px is not None
    places = np.array(sorted((x, y) for x, y, *_ in FOUR))
    # Cramér-Rao: 1.06 · 1 / 140 · √(1 / 5) = 0.0034 px; ten times that, and the sixteenth of a pixel of the drawing.
    np.testing.assert_allclose(np.sort(seen.sticks_px.reshape(4, 2), axis=0), np.sort(places, axis=0), atol=0.06)


def test_markers_of_two_sizes_on_each_stick_are_taken() -> None:
    seen = look(board(*((x, y, 9.0 if number % 2 else 5.0, grey) for number, (x, y, _, grey) in enumerate(FOUR))))
    assert [one.taken for one in seen.candidates] == [True] * 4


@pytest.mark.parametrize(
    ("dots", "reason"),
    [
        ((), "0 of at least 4 dots"),
        (FOUR[:3], "3 of at least 4 dots"),
        (
            (FOUR[0], (60.1, 60.7, 16.0, 40.0), (160.6, 100.4, 5.0, 250.0), (160.2, 150.9, 16.0, 250.0)),
            "0 of at least 2",
        ),
        ((*FOUR[:2], (160.6, 100.4, 5.0, 140.0), (160.2, 150.9, 5.0, 140.0)), "like the sticks of one rig"),
    ],
)
def test_why_nothing_is_found(dots: tuple[tuple[float, float, float, float], ...], reason: str) -> None:
    seen = look(board(*dots))
    assert seen.sticks_px is None
    assert reason in seen.reason
    assert not any(one.taken for one in seen.candidates)
    assert all(one.reason for one in seen.candidates)


def why(picture: np.ndarray, x: float, y: float) -> str:
    """Return why the candidate at a place was refused."""
    near = [one for one in look(picture).candidates if np.hypot(one.x_px - x, one.y_px - y) < one.radius_px]
    assert near
    return near[0].reason


def test_a_dot_without_a_likeness_names_the_value_and_the_limit() -> None:
    assert "radius by a factor of 3.2; 3 allowed" in why(board(FOUR[0], (60.1, 60.7, 16.0, 40.0)), 100.0, 60.0)
    assert "contrast by a factor of 3.5; 3 allowed" in why(board(FOUR[0], (60.1, 60.7, 5.0, 140.0)), 100.0, 60.0)
    assert "one of the two is dark and the other light" in why(board(FOUR[0], (60.1, 60.7, 5.0, 250.0)), 100.0, 60.0)
    assert "13 px apart; 18 px needed" in why(board((100.0, 60.0, 5.0, 40.0), (113.0, 60.0, 5.0, 40.0)), 100.0, 60.0)


def test_something_between_two_dots_is_named() -> None:
    picture = board(*FOUR[:2])
    picture[40:80, 74:86] = 60
    assert "of the line between them is as bright as a stick; 80 % needed" in why(picture, 100.0, 60.0)


def test_what_is_not_round_is_named() -> None:
    plus = board(*FOUR[:2])
    plus[150:162, 204:208] = 40
    plus[154:158, 200:212] = 40
    assert "% of the window; 75 % needed" in why(plus, 205.5, 155.5)
    corner = board(*FOUR[:2])
    corner[150:162, 200:206] = 40
    corner[156:162, 200:212] = 40
    assert "nothing round" in why(corner, 203.0, 158.0)


def test_a_dot_that_is_left_over_is_listed_after_those_taken() -> None:
    seen = look(board(*FOUR, (280.0, 200.0, 5.0, 40.0)))
    assert [one.taken for one in seen.candidates[:5]] == [True] * 4 + [False]
    assert seen.candidates[4].reason
