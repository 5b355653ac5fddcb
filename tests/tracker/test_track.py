"""Whole films of known angles: accuracy, honesty, and every hardship that a film can bring.

The bound for a dot (Cramér and Rao): σ_x = 1.06 (σ/C) √(w/r); the angle between two sticks of marker distance L has
√2 · √2 σ_x / L where every frame stands alone, and √2 σ_x / L where the base stick, which stands still, is averaged.
"""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.tracker.films import Cover, Rig, write_film
from torsight.core.optics.camera import read_camera
from tracker import track
from tracker.angle.orient import orient
from tracker.detect.marker_file import read_markers
from tracker.detect.moving_part import motion_blur
from tracker.detect.sticks import are_markers, couples_in
from tracker.frames.frame import Frame
from tracker.frames.source import open_source
from tracker.initialise import Start
from tracker.track import track_film


def swing(start_deg: float, range_deg: float, period_s: float):
    return lambda t: start_deg + range_deg * (np.cos(2 * np.pi * t / period_s) - 1.0) / 2.0


# Over one turn in 60 frames: up to 12.6 degrees and 17 px a frame, both sticks cross, and the ends are at rest.
RIG = Rig(swing(60.0, 400.0, 6.0), frames=91, fps=30.0)
SLOW = Rig(swing(160.0, 120.0, 12.0), frames=90, fps=30.0)


@dataclass
class Outcome:
    error_deg: np.ndarray
    sigma_deg: np.ndarray
    valid: np.ndarray
    certain: np.ndarray

    @property
    def rms_deg(self) -> float:
        return float(np.sqrt(np.mean(self.error_deg[self.valid] ** 2)))

    @property
    def ratio(self) -> float:
        return float(np.sqrt(np.mean((self.error_deg / self.sigma_deg)[self.valid] ** 2)))


def bound_deg(rig: Rig) -> float:
    """Angle of one frame with the base averaged, for an edge as wide as a pixel."""
    sigma_px = 1.06 * rig.noise / abs(rig.stick - rig.dot) * np.sqrt(1.0 / rig.radius_px)
    return float(np.rad2deg(np.sqrt(2.0) * sigma_px / (rig.moving_px[1] - rig.moving_px[0])))


def run(rig: Rig, *, given: bool = True, codec: str = "rawvideo", crf: int | None = None) -> Outcome:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        film = write_film(rig, folder / ("film.mp4" if codec == "libx264" else "film.mkv"), codec=codec, crf=crf)
        (folder / "camera.toml").write_text(rig.camera_toml())
        (folder / "markers.toml").write_text(rig.markers_toml())
        hints = read_markers(folder / "markers.toml") if given else None
        result = track_film(open_source(film), markers=hints)
        angles = orient(result.tracks, read_camera(folder / "camera.toml")).angles
    assert len(angles) == len(rig.times)
    np.testing.assert_allclose(angles.time_s, rig.times - rig.times[0], atol=1e-3)
    error = np.rad2deg(angles.angle_rad) - rig.truth_deg
    return Outcome(error, np.rad2deg(angles.sigma_rad), angles.valid, angles.branch_certain)


def nothing_wrong(outcome: Outcome, *, floor_deg: float = 0.02) -> None:
    """Assert that no angle is given as right that is not: within six sigmas and a floor for the renderer."""
    error, sigma = np.abs(outcome.error_deg[outcome.valid]), outcome.sigma_deg[outcome.valid]
    assert (error < 6.0 * sigma + floor_deg).all(), (error - 6.0 * sigma).max()


@functools.cache
def clean() -> Outcome:
    return run(RIG)


def test_every_frame_has_an_angle_near_the_bound_through_crossings() -> None:
    outcome = clean()
    assert outcome.valid.all()
    assert outcome.certain.all()
    # One and a half times the bound, and 0.003 px that the pixels' own pattern leaves.
    assert outcome.rms_deg < 1.5 * bound_deg(RIG) + np.rad2deg(2 * 0.003 / 50.0)
    assert 0.7 < outcome.ratio < 1.4
    nothing_wrong(outcome)


def test_markers_found_without_help_give_the_same_angles() -> None:
    outcome = run(RIG, given=False)
    assert outcome.valid.all()
    np.testing.assert_allclose(outcome.error_deg, clean().error_deg, atol=4.0 * bound_deg(RIG))


@pytest.mark.parametrize("stick", [0, 1])
def test_inner_and_outer_are_named_by_the_motion(stick: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = write_film(SLOW, tmp_path / "film.mkv", codec="rawvideo")
    right = track_film(open_source(film)).tracks.position_px
    seen = track.find_start

    def turned(*given: object) -> Start:
        start = seen(*given)
        two = start.markers[2 * stick : 2 * stick + 2]
        start.markers[2 * stick : 2 * stick + 2] = two[::-1]
        return start

    monkeypatch.setattr(track, "find_start", lambda source, markers, **_: turned(source, markers))
    np.testing.assert_allclose(track_film(open_source(film)).tracks.position_px, right, atol=0.01)


class Cut(Rig):
    """Before the rig two frames show another one."""

    def pictures(self) -> Iterator[np.ndarray]:
        other = Rig.pictures(replace(self, base_deg=20.0, centre=(175.0, 135.0)))
        for number, picture in enumerate(super().pictures()):
            yield next(other) if number < 2 else picture


class Titled(Rig):
    """A rig before which a title is shown for 25 frames: four round letters on two light lines."""

    def pictures(self) -> Iterator[np.ndarray]:
        card = np.full(self.size[::-1], 40, np.uint8)
        for (x, y), (u, v) in (((60, 60), (170, 62)), ((90, 150), (200, 190))):
            cv2.line(card, (x - 20, y), (u + 20, v), 190, 22, cv2.LINE_AA)
            for place in ((x, y), (u, v)):
                cv2.circle(card, place, 6, 30, -1, cv2.LINE_AA)
        for number, picture in enumerate(super().pictures()):
            yield card if number < 25 else picture


def test_a_title_before_the_film_is_not_taken_for_the_rig() -> None:
    assert are_markers(couples_in(next(Titled(swing(60.0, 80.0, 6.0), frames=1).pictures()))[0])
    outcome = run(Titled(swing(60.0, 80.0, 6.0), frames=120), given=False)
    assert not outcome.valid[:25].any()
    # The next picture in which the markers are looked for is number 30.
    assert outcome.valid[30:].mean() > 0.9
    nothing_wrong(outcome)


def test_markers_of_the_first_picture_that_are_not_seen_again_are_not_taken() -> None:
    outcome = run(Cut(swing(60.0, 80.0, 6.0), frames=60), given=False)
    assert outcome.valid.mean() > 0.9
    nothing_wrong(outcome)


@pytest.mark.parametrize(
    ("base_px", "moving_px"), [((70.0, 110.0), (24.0, 62.0)), ((60.0, 104.0), (30.0, 98.0))], ids=["inner", "outer"]
)
def test_sticks_of_which_one_covers_a_dot_of_the_other_at_first_are_found_later(
    base_px: tuple[float, float], moving_px: tuple[float, float]
) -> None:
    # The hub and the dots that are left make up two pairs, of which neither stands.
    rig = Rig(swing(8.0, -100.0, 3.0), frames=60, base_px=base_px, moving_px=moving_px, hub_px=8.0)
    outcome = run(rig, given=False)
    assert outcome.valid.mean() > 0.8
    assert outcome.rms_deg < 3.0 * bound_deg(rig)


@pytest.mark.parametrize(("rate_deg_s", "rest_s"), [(1000.0, 0.0), (900.0, 0.4)], ids=["at first", "after a rest"])
def test_sticks_too_fast_for_dots_that_are_followed_alone_are_found(rate_deg_s: float, rest_s: float) -> None:
    # 33 degrees, or 44 px of the outer dot, from one frame to the next.
    rig = Rig(lambda t: 120.0 + rate_deg_s * np.maximum(t - rest_s, 0.0), frames=50)
    outcome = run(rig, given=False)
    assert outcome.valid.mean() > 0.9
    nothing_wrong(outcome)


@pytest.mark.parametrize(("step_px", "path_px", "words"), [(0, 12, None), (12, 1, ""), (12, 12, "motion blur: edges")])
def test_motion_blur_shows_without_markers(step_px: int, path_px: int, words: str | None) -> None:
    def picture(number: int) -> np.ndarray:
        scene = np.full((120, 200), 90, np.uint8)
        scene[80:110, 20:180] = 200
        bar = np.full((60, 200), 90, np.uint8)
        bar[20:50, 10 + step_px * number : 60 + step_px * number] = 200
        scene[:60] = cv2.blur(bar, (path_px, 1))
        return cv2.GaussianBlur(scene, (0, 0), 0.7)

    found = motion_blur([Frame(number, number / 30.0, picture(number)) for number in range(8)], 0, 7)
    assert found is None if words is None else found is not None and found[: len(words) or 1] == words


def test_a_stick_that_only_jumps_is_the_one_that_moves() -> None:
    # Each jump smears one frame, after which the stick may lie anywhere; only the circles about the point where both
    # sticks' lines cross tell its inner dot from the outer one, and that it is the same stick.
    def jumping(t: np.ndarray) -> np.ndarray:
        jumps = ((0.50, 12.0), (1.03, -60.0), (1.57, 45.0))
        return 70.0 + sum(turn * np.clip((t - at) / 0.03 + 0.5, 0.0, 1.0) for at, turn in jumps)

    rig = Rig(jumping, exposure=0.5, samples=5)
    outcome = run(rig, given=False)
    assert outcome.valid.mean() > 0.9
    assert np.abs(outcome.error_deg[outcome.valid]).max() < 8.0 * bound_deg(rig)


def test_a_base_dot_that_a_wide_stick_half_covers_is_not_taken() -> None:
    # So faint that the dot fits as well as it usually does while the stick's edge slowly moves over it.
    rig = Rig(
        swing(40.0, 80.0, 8.0),
        frames=130,
        size=(420, 420),
        base_px=(58.0, 150.0),
        moving_px=(52.0, 138.0),
        radius_px=8.0,
        half_width_px=26.0,
        stick=36.0,
        dot=9.0,
        ground=18.0,
        texture=2.0,
        noise=3.0,
    )
    outcome = run(rig, codec="libx264", crf=18)
    assert outcome.valid.all()
    # Noise of 3 on a step of 27 leaves little for compression to add.
    assert outcome.rms_deg < 2.0 * bound_deg(rig)
    assert outcome.ratio < 1.4


def test_looking_for_markers_is_told_before_the_tracking(tmp_path: Path) -> None:
    told: list[tuple[str, float, float | None]] = []
    film = write_film(replace(RIG, frames=20), tmp_path / "film.mkv", codec="ffv1", crf=None)
    track_film(open_source(film), progress=lambda *words: told.append(words))
    steps = list(dict.fromkeys(step for step, _, _ in told))
    assert steps == ["looking for the markers", "tracking"]
    for step in steps:
        done = [(reached, of) for name, reached, of in told if name == step]
        assert done == sorted(done)
        assert done[-1][0] == done[-1][1]


@pytest.mark.parametrize(
    "change",
    [
        {"flicker": 0.3},
        {"shake_px": 1.5},
        {"jitter": 0.5, "drop": (5, 6, 20, 33, 47, 60, 61)},
        {"bump": (1.4, 11.0, -7.0)},
        {"stick": 60.0, "dot": 200.0, "ground": 110.0},
        {"tilt_deg": (14.0, -9.0), "k1": -0.1, "distance": 700.0},
        {"moving_px": (30.0, 80.0)},
        {"noise": 5.0, "uneven": 0.6},
    ],
    ids=",".join,
)
def test_what_leaves_all_markers_in_sight_costs_few_frames(change: dict) -> None:
    rig = replace(RIG, **change)
    outcome = run(rig)
    nothing_wrong(outcome)
    assert outcome.certain.all()
    # Unless it is known which stick is above, the few frames in which dots lie on dots are not answered.
    assert outcome.valid.mean() > 0.93
    assert 0.6 < outcome.ratio < 1.5


@pytest.mark.parametrize("shake_px", [0.0, 1.5])
def test_dots_at_equal_distances_on_both_sticks_are_told_apart_through_a_slow_crossing(shake_px: float) -> None:
    # Every dot of the moving stick passes over one of the base's: nothing else tells which stick is above.
    rig = Rig(lambda t: 40.0 - 30.0 * t, frames=80, moving_px=Rig(SLOW.angle_deg).base_px, shake_px=shake_px)
    outcome = run(rig)
    nothing_wrong(outcome)
    assert outcome.certain.all()
    assert outcome.valid.sum() >= (80 if shake_px == 0.0 else 76)


@pytest.mark.parametrize(
    "cover",
    [
        Cover(1.0, 2.5, "moving"),
        Cover(1.0, 2.5, "moving_outer"),
        Cover(1.0, 2.5, "moving_inner", kind="wire", size_px=2.0),
        Cover(1.0, 2.5, "base"),
        Cover(1.0, 2.5, "base_inner", kind="wire", size_px=2.0),
    ],
    ids=lambda cover: f"{cover.kind} over {cover.target}",
)
def test_what_is_covered_is_not_guessed_and_comes_back(cover: Cover) -> None:
    outcome = run(replace(SLOW, covers=[cover]))
    nothing_wrong(outcome)
    assert outcome.certain.all()
    before, after = np.arange(0, 29), np.arange(78, 90)
    assert outcome.valid[before].all()
    assert outcome.valid[after].all()
    if cover.target == "base":
        # The base stands still: what was seen on both sides holds between.
        assert outcome.valid.all()


def test_the_light_goes_off_for_a_second() -> None:
    outcome = run(replace(SLOW, dark_s=(1.0, 2.0)))
    nothing_wrong(outcome)
    assert not outcome.valid[31:59].any()
    assert outcome.valid[:30].all()
    assert outcome.valid[62:].all()
    assert outcome.certain.all()


def test_base_above_moving_hides_markers_but_nothing_goes_wrong() -> None:
    outcome = run(replace(RIG, base_on_top=True))
    nothing_wrong(outcome)
    assert outcome.certain.all()
    assert outcome.valid.mean() > 0.6


def test_fast_markers_are_smeared_and_still_followed() -> None:
    outcome = run(replace(RIG, exposure=0.5))
    assert outcome.valid.mean() > 0.8
    assert outcome.certain.all()
    nothing_wrong(outcome, floor_deg=0.3)


@pytest.mark.parametrize("cover", [[], [Cover(0.8, 1.2, "moving_outer")]], ids=["free", "covered"])
def test_smeared_dots_in_little_light_are_read(cover: list[Cover]) -> None:
    """A step of 27 grey levels under a noise of 5.5: a fifth of it, before a smear of up to 15 px takes its share."""
    dark = replace(RIG, stick=36.0, dot=9.0, ground=18.0, texture=1.5, noise=5.5, exposure=0.9, covers=cover)
    outcome = run(dark)
    hidden = np.flatnonzero(~outcome.valid)
    assert len(hidden) <= (2 if not cover else 14)
    assert outcome.ratio < 1.5
    nothing_wrong(outcome, floor_deg=0.1)


@pytest.mark.parametrize("crf", [18, 28])
def test_compression_is_seen_in_the_sigma(crf: int) -> None:
    outcome = run(replace(SLOW, frames=150), codec="libx264", crf=crf)
    assert outcome.valid.mean() > 0.98
    assert 0.5 < outcome.ratio < 1.6
    assert np.nanmedian(outcome.sigma_deg) > 1.2 * bound_deg(SLOW)
    nothing_wrong(outcome)


def test_motion_after_a_rest_is_judged_by_motion() -> None:
    # H.264 repeats what stands still, noise and all: the rest looks better than any moving frame can be.
    rest_s = 4.0
    rig = Rig(lambda t: 40.0 + 60.0 * (1.0 - np.cos(2.0 * np.pi * np.maximum(t - rest_s, 0.0) / 4.0)), frames=200)
    outcome = run(rig, codec="libx264", crf=20)
    assert outcome.valid.all()
    moves = rig.times > rest_s
    ratio = (outcome.error_deg / outcome.sigma_deg)[moves]
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.5
    assert np.mean(np.abs(ratio) < 1.96) > 0.85
