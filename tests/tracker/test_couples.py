"""Couples of dots in two pictures of one film."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tracker.films import Rig, write_film
from tracker import track
from tracker.appearance.dot_fit import Dot
from tracker.couples import Couple
from tracker.detect.sticks import stick_of
from tracker.frames.source import open_source
from tracker.initialise import Start, find_start
from tracker.track import track_film

AT = {"base inner": (60, 0), "base outer": (150, 0), "moving inner": (0, 50), "moving outer": (0, 140), "hub": (0, 0)}
RIG = Rig(lambda t: 60.0 + 50.0 * np.maximum(t - 1.0, 0.0), frames=75)


@pytest.fixture(scope="module")
def dots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Dot]:
    """Return dots at ``AT``, of the appearance of one in a film."""
    film = write_film(RIG, tmp_path_factory.mktemp("film") / "film.mkv", codec="rawvideo")
    choice = find_start(open_source(film), None).choice
    assert choice is not None
    return {name: replace(choice.taken.base.inner, x_px=float(x), y_px=float(y)) for name, (x, y) in AT.items()}


def couple(dots: dict[str, Dot], *names: str) -> Couple:
    one, two, three, four = (dots[name] for name in names)
    return Couple(stick_of(one, two), stick_of(three, four), 0.9)


def test_a_couple_takes_the_order_of_the_same_sticks_in_another_picture(dots: dict[str, Dot]) -> None:
    seen = couple(dots, "base inner", "base outer", "moving inner", "moving outer")
    for names in (
        ("base outer", "base inner", "moving inner", "moving outer"),
        ("moving outer", "moving inner", "base inner", "base outer"),
    ):
        same = couple(dots, *names).placed_as(seen)
        assert same is not None
        assert [stick.places_px for stick in (same.base, same.moving)] == [
            stick.places_px for stick in (seen.base, seen.moving)
        ]


def test_bases_that_share_a_dot_belong_to_one_film_and_others_do_not(dots: dict[str, Dot]) -> None:
    seen = couple(dots, "hub", "base inner", "moving inner", "moving outer")
    same = couple(dots, "base inner", "base outer", "moving inner", "moving outer").placed_as(seen)
    assert same is not None
    assert same.base.places_px == [[60.0, 0.0], [150.0, 0.0]]
    assert couple(dots, "base inner", "base outer", "hub", "moving outer").placed_as(seen) is None


def test_the_rest_before_a_start_is_tracked_from_an_earlier_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = write_film(RIG, tmp_path / "film.mkv", codec="rawvideo")
    whole, first = track_film(open_source(film)), find_start(open_source(film), None)

    def later(*_: object, **__: object) -> Start:
        return replace(first, frame=20, earlier=replace(first, moving=1))

    monkeypatch.setattr(track, "find_start", later)
    joined = track_film(open_source(film))
    assert joined.report["markers"]["first_frame"] == 0
    np.testing.assert_allclose(joined.tracks.position_px, whole.tracks.position_px, atol=0.05)
