"""Films in which one thing goes wrong: what is said of it is that thing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.tracker.films import Cover, Rig, write_film
from torsight.core.tracks import MarkerTracks, StickAngles
from tracker.angle.orient import orient
from tracker.frames.source import open_source
from tracker.quality.account import account, gap_states
from tracker.quality.gap_pictures import Seen
from tracker.quality.gaps import find_causes, lone_marker_advice
from tracker.quality.track_warnings import doubts
from tracker.rows import CODE, ROW
from tracker.track import TrackResult, track_film

RIG = Rig(lambda t: 60.0 + 40.0 * (np.cos(5.0 * t) - 1.0), frames=36)


def suddenly(rate_deg_s: float) -> Rig:
    """Return a rig that turns by 1 degree per frame, and from half a second on at this rate."""
    return replace(RIG, angle_deg=lambda t: 60.0 - np.where(t < 0.5, 30.0 * t, 15.0 + rate_deg_s * (t - 0.5)))


def below(time_s: np.ndarray) -> np.ndarray:
    """Turn until the base, which lies above, hides the moving stick; stay there, and come back."""
    return 60.0 - np.interp(time_s, [0.0, 0.6, 1.1, 1.7], [0.0, 60.0, 60.0, 0.0])


@dataclass
class Changed:
    """A rig whose pictures are changed, by their number."""

    rig: Rig
    change: Callable[[int, np.ndarray], np.ndarray]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rig, name)

    def pictures(self) -> Iterator[np.ndarray]:
        return (self.change(number, picture) for number, picture in enumerate(self.rig.pictures()))


class Woven(Changed):
    """Two instants in the rows of every picture, and no word of it in the film."""

    def pictures(self) -> Iterator[np.ndarray]:
        fields = list(replace(self.rig, frames=2 * self.rig.frames, fps=2.0 * self.rig.fps).pictures())
        for one, two in zip(fields[::2], fields[1::2], strict=True):
            whole = one.copy()
            whole[1::2] = two[1::2]
            yield whole


def blurred(number: int, picture: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(picture, (0, 0), 4.0) if 12 <= number < 30 else picture


def absent(number: int, picture: np.ndarray) -> np.ndarray:
    return picture if number >= 20 else np.random.default_rng(number).normal(95.0, 8.0, picture.shape).astype(np.uint8)


def reached_for(number: int, picture: np.ndarray) -> np.ndarray:
    """Let a hand come from the right within a frame, rest over the moving stick, and go."""
    if 12 <= number < 27:
        x, y = RIG.marker_px(RIG.truth_deg)[19, 2:].mean(axis=0).round().astype(int).tolist()
        cv2.line(picture, (x, y), (x + 400, y + 60), 165, 60)
    return picture


def glaring(number: int, picture: np.ndarray) -> np.ndarray:
    """Let a lamp be seen in the ground where the outer marker turns back."""
    x, y = RIG.marker_px(RIG.truth_deg)[14, 3]
    rows, columns = np.mgrid[: picture.shape[0], : picture.shape[1]]
    light = 400.0 / (1.0 + np.exp((np.hypot(columns - x, rows - y) - 9.0) / 3.0))
    return np.clip(picture + light * (number >= 9), 0.0, 255.0).astype(np.uint8)


@pytest.mark.parametrize(
    ("cause", "rig", "words"),
    [
        ("speed", replace(suddenly(1200.0), seed=3), "too fast there for the search"),
        ("shutter", replace(suddenly(500.0), exposure=1.0), "shorter shutter time"),
        ("focus", Changed(RIG, blurred), "lock the focus"),
        ("late", Changed(RIG, absent), "found from frame 30 on"),
        ("light", replace(RIG, dark_s=(0.4, 1.0)), "steady lamp"),
        ("flicker", replace(RIG, flicker=0.7, frames=60), "every 4 frames or so"),
        ("glare", Changed(RIG, glaring), "are saturated"),
        ("hand", replace(RIG, covers=[Cover(0.4, 1.0, "moving")]), "keep hands"),
        ("hand", Changed(RIG, reached_for), "keep hands"),
        ("jump", replace(RIG, angle_deg=lambda t: 60.0 - 150.0 * t - 100.0 * (t >= 0.6)), "cut nothing out"),
        ("sticks", replace(RIG, angle_deg=below, base_on_top=True, frames=50), "on the camera's side"),
        ("interlaced", Woven(suddenly(250.0), lambda _, picture: picture), "interlaced without saying so"),
    ],
)
def test_the_cause_is_named(cause: str, rig: Any, words: str, tmp_path: Path) -> None:
    source = open_source(write_film(rig, tmp_path / "film.mkv"))
    result = track_film(source)
    orientation = orient(result.tracks, None)
    told = account(result, orientation, doubts=doubts(result), pictures=source.pictures)
    assert next(iter(told["frames"]["causes"])) == cause
    (about,) = [text for text in told["advice"] if "frames have no angle" in text]
    assert words in about


def test_light_that_flickers_and_leaves_every_angle_has_advice(tmp_path: Path) -> None:
    for flicker, told in ((0.5, True), (0.1, False)):
        source = open_source(write_film(replace(RIG, flicker=flicker, frames=60), tmp_path / "film.mkv"))
        result = track_film(source)
        content = account(result, orient(result.tracks, None), doubts=doubts(result), pictures=source.pictures)
        assert content["frames"]["without_angle"] == 0
        assert any("dim frames err" in text for text in content["advice"]) == told


@pytest.mark.parametrize("level", [95, 250])
def test_a_marker_lost_under_glare_says_so_where_the_other_one_tells_the_angle(level: int) -> None:
    n = 40
    position = np.broadcast_to([[80.0, 60.0], [40.0, 60.0], [120.0, 60.0], [150.0, 60.0]], (n, 4, 2)).copy()
    rows, known = np.zeros(n, ROW), np.ones(n, bool)
    rows["state"][15:25, 3] = CODE["hidden"]
    seen = rows["state"] == CODE["seen"]
    position[~seen] = np.nan
    covariance = np.broadcast_to(0.02**2 * np.eye(2), (n, 4, 2, 2))
    tracks = MarkerTracks(np.arange(n), np.arange(n) / 30.0, position, covariance, seen, (200, 120))
    result = TrackResult(tracks, rows, [], {"markers": {"radius_px": 5.0}})
    angles = StickAngles(np.arange(n), np.arange(n) / 30.0, np.zeros(n), np.zeros(n), known, known)

    def pictures(frames: Iterable[int]) -> dict[int, np.ndarray]:
        shown = {number: np.full((120, 200), 95, np.uint8) for number in frames}
        for number, picture in shown.items():
            if number >= 15:
                cv2.circle(picture, (150, 60), 12, level, -1)
        return shown

    (words,) = lone_marker_advice(result, angles, pictures=pictures)
    assert ("light glares on the markers" in words) == (level == 250)
    assert ("blurred by motion" in words) == (level == 95)


@pytest.mark.parametrize(("lost", "cause"), [(30, "unlike"), (10, "hand")])
def test_points_on_print_are_named_where_they_are_lost_from_most_frames(lost: int, cause: str) -> None:
    rows, zero = np.zeros(40, ROW), np.zeros(40)
    rows["state"][:lost, 2:] = CODE["hidden"]
    seen = rows["state"] == CODE["seen"]
    place = MarkerTracks(np.arange(40), zero, np.zeros((40, 4, 2)), np.zeros((40, 4, 2, 2)), seen, (9, 9))
    unlike = {"moving": "9 % of the line between them is as bright as a stick; 80 % needed"}
    markers = {"radius_px": 5.0, "stick_length_px": 30.0, "not_on_one_stick": unlike, "shutter_share_of_frame": None}
    angles = StickAngles(np.arange(40), np.arange(40) / 30.0, zero, zero, seen.all(axis=1), np.ones(40, bool))
    found = find_causes(TrackResult(place, rows, [], {"markers": markers}), angles, ["hidden"] * lost)
    assert found.count == {cause: lost}
    assert 'kind = "texture"' in found.advice("unlike")


@pytest.mark.parametrize(("marker", "name"), [(2, "inner"), (3, "outer")])
def test_an_angle_that_rests_on_one_marker_has_advice(marker: int, name: str) -> None:
    rows, zero = np.zeros(40, ROW), np.zeros(40)
    place = MarkerTracks(
        np.arange(40), zero, np.zeros((40, 4, 2)), np.zeros((40, 4, 2, 2)), np.ones((40, 4), bool), (9, 9)
    )
    rows["state"][5:15, marker] = CODE["hidden"]
    # With both gone there is no angle, of which other advice tells.
    rows["state"][15:20, 2:] = CODE["hidden"]
    known = (rows["state"][:, 2:] == CODE["seen"]).any(axis=1)
    angles = StickAngles(np.arange(40), np.arange(40) / 30.0, zero, zero, known, np.ones(40, bool))
    (told,) = lone_marker_advice(TrackResult(place, rows), angles)
    assert f"{name} marker is not seen in 10 of 40 frames" in told
    rows["state"][:, 2:] = CODE["seen"]
    assert lone_marker_advice(TrackResult(place, rows), angles) == []


@pytest.mark.parametrize(
    ("step_deg", "step_px", "cause"),
    [(0.0, 0.0, None), (4.0, 60.0, None), (8.0, 60.0, "speed"), (8.0, 12.0, None), (13.0, 12.0, "speed")],
)
def test_a_stick_that_was_followed_faster_elsewhere_is_not_too_fast(
    step_deg: float, step_px: float, cause: str | None
) -> None:
    seen = Seen(combed=1.0, sharpness=1.0, step_deg=step_deg, step_px=step_px, smear_px=0.0)
    assert seen.cause(usual_deg=6.3, radius_px=6.0, length_px=100.0) == cause


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        (("seen", "seen", "shadowed", "hidden"), "shadowed"),
        (("shadowed", "seen", "hidden", "hidden"), "hidden"),
        (("hidden", "lost", "seen", "seen"), "hidden"),
        (("seen", "seen", "seen", "seen"), "impossible"),
    ],
)
def test_of_two_states_of_one_stick_that_which_names_the_cover_counts(states: tuple[str, ...], expected: str) -> None:
    rows, unknown = np.zeros(1, ROW), np.full(1, np.nan)
    rows["state"] = [CODE[state] for state in states]
    no = np.zeros(1, np.bool_)
    angles = StickAngles(np.arange(1), np.zeros(1), unknown, unknown, no, no)
    assert gap_states(rows, angles) == [expected]
