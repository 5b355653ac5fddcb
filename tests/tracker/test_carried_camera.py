"""Films by hand: a camera that is carried or comes nearer, a film with a cut, sticks that start abruptly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.tracker.films import Rig, write_film
from torsight.core.tracks import StickAngles
from tracker.angle.orient import orient
from tracker.angle.views import views_of
from tracker.detect.marker_file import read_markers
from tracker.frames.source import open_source
from tracker.initialise import find_start
from tracker.quality.account import account
from tracker.quality.track_warnings import doubts, doubts_of_turns
from tracker.rows import SEEN
from tracker.track import TrackResult, track_film

RIG = Rig(lambda t: 160.0 + 35.0 * (np.cos(3.0 * t) - 1.0), frames=60)
FAST = Rig(lambda t: 180.0 + 60.0 * (1.0 - np.cos(7.0 * np.maximum(t - 0.2, 0.0))), frames=50, exposure=0.8)


@dataclass
class Seen:
    """A rig as seen by a camera whose picture is turned, a complex number, and shifted, frame by frame."""

    rig: Rig
    turn: Callable[[int], complex]
    shift: Callable[[int], complex] = lambda _: 0j

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rig, name)

    def pictures(self) -> Iterator[np.ndarray]:
        middle = complex(*self.rig.middle)
        for number, picture in enumerate(self.rig.pictures()):
            turn, off = self.turn(number), self.shift(number) + middle - self.turn(number) * middle
            by = np.array([[turn.real, -turn.imag, off.real], [turn.imag, turn.real, off.imag]])
            yield cv2.warpAffine(picture, by, self.size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def eased(number: int, first: int, last: int) -> float:
    share = min(max((number - first) / (last - first), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


def tracked(film: Any, folder: Path, *, given: bool = True) -> tuple[TrackResult, StickAngles, dict[str, Any]]:
    path = write_film(film, folder / "film.mkv")
    (folder / "markers.toml").write_text(film.markers_toml())
    source = open_source(path)
    result = track_film(source, markers=read_markers(folder / "markers.toml") if given else None)
    orientation = orient(result.tracks, None)
    told = account(result, orientation, doubts=doubts(result), pictures=source.pictures)
    return result, orientation.angles, told


def errors_deg(angles: StickAngles, truth_deg: np.ndarray) -> np.ndarray:
    off = np.rad2deg(angles.angle_rad) - truth_deg
    return off - 360.0 * np.round(np.nanmedian(off) / 360.0)


@pytest.mark.parametrize("given", [True, False])
def test_a_camera_that_is_carried_elsewhere(*, given: bool, tmp_path: Path) -> None:
    def turn(number: int) -> complex:
        return np.exp((0.6j - 0.12) * eased(number, 20, 40))

    film = Seen(RIG, turn, lambda number: (16.0 - 12.0j) * eased(number, 20, 40))
    result, angles, _ = tracked(film, tmp_path, given=given)
    assert angles.valid.all()
    error = errors_deg(angles, RIG.truth_deg)
    assert np.sqrt(np.mean(error**2)) < 0.4
    assert np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad)) ** 2)) < 1.3
    assert [view.carried for view in views_of(result.tracks)] == [False, True, False]


def test_a_camera_that_comes_nearer(tmp_path: Path) -> None:
    film = Seen(RIG, lambda number: 1.0 + 0.25 * eased(number, 15, 45))
    result, angles, told = tracked(film, tmp_path)
    assert angles.valid.mean() > 0.95
    assert np.sqrt(np.mean(errors_deg(angles, RIG.truth_deg)[angles.valid] ** 2)) < 0.15
    # The tilt is that of one view, and no marker is doubted.
    assert len(views_of(result.tracks)) == 1
    assert not any("body" in text or "base is not" in text for text in told["advice"])


@pytest.mark.parametrize("moved", [False, True], ids=["cut", "put elsewhere"])
def test_a_picture_that_jumps_is_told_as_that(*, moved: bool, tmp_path: Path) -> None:
    fast = replace(RIG, angle_deg=lambda t: 160.0 - 20.0 * t - 70.0 * (t >= 1.0))
    film = Seen(RIG, lambda n: np.exp(0.6j * (n >= 30)), lambda n: (40 - 50j) * (n >= 30)) if moved else fast
    _, angles, told = tracked(film, tmp_path)
    assert not angles.valid[30]
    assert next(iter(told["frames"]["causes"])) == "jump"
    assert sum("jumps at 1.00 s" in text for text in told["advice"]) == 1
    if not moved:
        # The motion before and after the cut does not tell how far the stick turned in it.
        (words,) = doubts_of_turns(angles)
        assert "not certain from 1.03 s on" in words
    assert not any("Exchange base and moving" in text for text in told["advice"])


@pytest.mark.parametrize("size", [0.8, 0.9, 1.1, 1.2])
def test_a_camera_that_is_put_at_another_distance_at_once(size: float, tmp_path: Path) -> None:
    film = Seen(RIG, lambda n: size * np.exp(-0.4j) if n >= 30 else 1.0 + 0j, lambda n: (15 + 10j) * (n >= 30))
    _, angles, _ = tracked(film, tmp_path)
    # Two frames show no angle at most: the jump may coincide with a picture that is not read otherwise.
    assert angles.valid.sum() >= len(angles) - 2
    assert angles.branch_certain.all()
    error = errors_deg(angles, RIG.truth_deg)[angles.valid]
    assert np.sqrt(np.mean(error**2)) < 0.15
    assert np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad[angles.valid])) ** 2)) < 1.3


def test_a_track_that_is_resumed_has_the_windows_of_another_distance(tmp_path: Path) -> None:
    film = Seen(RIG, lambda n: 1.2 * np.exp(-0.4j) if n >= 30 else 1.0 + 0j)
    source = open_source(write_film(film, tmp_path / "film.mkv"))
    (tmp_path / "markers.toml").write_text(film.markers_toml())
    start = find_start(source, read_markers(tmp_path / "markers.toml"))
    whole, again = start.follower(), start.follower()
    for frame in source:
        row = whole.step(frame).copy()
        if frame.index == 40:
            again.restore(whole.to_state())
        elif frame.index > 40:
            assert again.step(frame).tobytes() == row.tobytes()
    assert (row["state"] == SEEN).all()


@pytest.mark.parametrize("given", [True, False])
def test_sticks_in_one_line_are_not_found_the_wrong_way_round(*, given: bool, tmp_path: Path) -> None:
    # Both lines cross nowhere at first; the outer marker is smeared over 40 px where the stick is fast.
    _, angles, _ = tracked(FAST, tmp_path, given=given)
    assert angles.valid.mean() > 0.7
    sure = angles.valid & angles.branch_certain
    assert np.abs(errors_deg(angles, FAST.truth_deg)[sure]).max() < 5.0


def test_dots_of_two_sticks_in_one_line_are_paired_by_how_they_move(tmp_path: Path) -> None:
    # The outer marker is lost as the stick jumps: it is no dot at rest, and the inner ones are no stick.
    def jumping(t: np.ndarray) -> np.ndarray:
        return 180.0 + 35.0 * np.clip((np.mod(t, 0.45) - 0.37) / 0.08, 0.0, 1.0) + 35.0 * np.floor(t / 0.45)

    rig = Rig(jumping, frames=60, exposure=0.5)
    _, angles, _ = tracked(rig, tmp_path, given=False)
    assert angles.valid.mean() > 0.5
    off = errors_deg(angles, rig.truth_deg)[angles.valid]
    assert np.abs(off - 360.0 * np.round(off / 360.0)).max() < 1.0


def test_given_dots_that_the_background_swallows_are_told_as_unlike(tmp_path: Path) -> None:
    # The outer dots reach beyond the sticks' ends, where the ground is as dark as they are.
    film = replace(RIG, overhang_px=0.0, ground=45.0, texture=2.0)
    _, angles, told = tracked(film, tmp_path)
    assert angles.valid.mean() < 0.5
    assert next(iter(told["frames"]["causes"])) == "unlike"
    assert set(told["markers"]["not_on_one_stick"]) <= {"base", "moving"}


def test_a_stick_that_swings_is_no_flicker(tmp_path: Path) -> None:
    rig = replace(RIG, angle_deg=lambda t: 170.0 + 60.0 * (np.cos(12.0 * t) - 1.0), exposure=0.6)
    assert not any("flickers" in text for text in tracked(rig, tmp_path)[2]["advice"])
