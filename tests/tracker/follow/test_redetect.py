"""A picture that jumps, a stick that was covered: found again, or not taken for what it is not."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.detect.dots import dot_near
from tracker.detect.sticks import Stick
from tracker.follow.followed_dots import DotState
from tracker.follow.follower import Follower
from tracker.follow.marker import markers_on
from tracker.follow.motion_model import jump_px
from tracker.follow.redetect import Prediction, Region
from tracker.follow.state import STICK
from tracker.frames.frame import Frame
from tracker.rows import CODE

RADIUS_PX = 6.0
AXIS = 210.0 + 190.0j
BASE = (AXIS + 80.0, AXIS + 160.0)
SIGMA_PX = 1.06 * 2.0 / 140.0 * np.sqrt(1.0 / RADIUS_PX)
"""Cramér and Rao for an edge one pixel wide, a step of 140 and noise of 2 grey levels."""


def picture(dots: list[complex], *, seed: int, radius_px: float | list[float] = RADIUS_PX) -> np.ndarray:
    """Draw dark dots by counting sub-pixels, on sticks as wide as the picture: light ground everywhere."""
    fine = (np.arange(8) + 0.5) / 8.0 - 0.5
    y = (np.arange(400)[:, None] + fine).ravel()
    out = np.full((400, 440), 190.0)
    for dot, radius in zip(dots, np.broadcast_to(radius_px, len(dots)), strict=True):
        x0, y0 = int(dot.real) - 10, int(dot.imag) - 10
        dx, dy = (np.arange(x0, x0 + 21)[:, None] + fine).ravel() - dot.real, y[8 * y0 : 8 * (y0 + 21)] - dot.imag
        inside = dx[None, :] ** 2 + dy[:, None] ** 2 < radius**2
        out[y0 : y0 + 21, x0 : x0 + 21] -= 140.0 * inside.reshape(21, 8, 21, 8).mean(axis=(1, 3))
    return np.clip(np.rint(out + np.random.default_rng(seed).normal(0.0, 2.0, out.shape)), 0, 255).astype(np.uint8)


def moving(degrees: float) -> list[complex]:
    """Return the dots of the moving stick."""
    turn = np.exp(1j * np.deg2rad(degrees))
    return [AXIS + 70.0 * turn, AXIS + 140.0 * turn]


def follower_of(
    scene: list[complex], *, moving: int | None = 1, radius_px: float | list[float] = RADIUS_PX
) -> Follower:
    """Return what follows the dots of a first picture: the base's two, then the moving stick's."""
    first = picture(scene, seed=0, radius_px=radius_px)
    dots = [dot_near(first, dot.real, dot.imag, reach_px=3.0) for dot in scene]
    sticks = [Stick(dots[k], dots[k + 1], 0.0) for k in (0, 2)]
    return Follower([DotState(markers_on(first, *sticks))], moving=moving)


def followed(scenes: list[list[complex]], *, radius_px: float | list[float] = RADIUS_PX) -> list[np.ndarray]:
    """Return the rows of pictures with dots."""
    follower = follower_of(scenes[0], radius_px=radius_px)
    return [
        follower.step(Frame(number, number / 30.0, picture(scene, seed=number, radius_px=radius_px))).copy()
        for number, scene in enumerate(scenes)
    ]


def check(row: np.ndarray, dots: list[complex]) -> None:
    assert (row["state"] == CODE["seen"]).all()
    # Five standard deviations, of which sub-pixels of 1/8 px and the template make 1.5 times the bound.
    assert row["position_px"] == pytest.approx(np.array([[d.real, d.imag] for d in dots]), abs=8.0 * SIGMA_PX)


def test_a_stick_whose_markers_differ_in_size_is_found_after_a_jump() -> None:
    scenes = [[*BASE, *moving(100.0 if number < 6 else 140.0)] for number in range(12)]
    check(followed(scenes, radius_px=[9.0, 3.0, 9.0, 3.0])[-1], scenes[-1])


def test_two_that_follow_the_same_dots_do_not_disturb_each_other() -> None:
    scene = [*BASE, *moving(100.0)]
    first = picture(scene, seed=0)
    dots = [dot_near(first, dot.real, dot.imag, reach_px=3.0) for dot in scene]
    markers = [marker for k in (0, 2) for marker in markers_on(first, Stick(dots[k], dots[k + 1], 0.0))]

    def run(radii_px: list[float]) -> np.ndarray:
        follower = Follower([DotState(markers)], moving=1)
        for number, radius_px in enumerate(radii_px):
            luma = picture(scene, seed=number, radius_px=radius_px)
            row = follower.step(Frame(number, number / 30.0, luma)).copy()
        return row

    usual = [RADIUS_PX] * 4
    before = run(usual)
    run(np.linspace(RADIUS_PX, 1.25 * RADIUS_PX, 40).tolist())
    assert run(usual) == before


def turning(count: int, *, first: float = 100.0, step: float = 2.0) -> list[list[complex]]:
    return [[*BASE, *moving(first + step * k)] for k in range(count)]


def test_a_usual_turn_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracker.follow.followed_dots.redetect", lambda *_: pytest.fail("nothing was lost"))
    scenes = turning(12, step=1.0)
    for row, scene in zip(followed(scenes), scenes, strict=True):
        check(row, scene)


def test_a_marker_on_the_axis_does_not_say_where_the_other_one_is() -> None:
    # The outer one is covered while the stick turns on, and comes back beyond what one frame's motion allows.
    def scene(degrees: float, *, covered: bool = False) -> list[complex]:
        return [*BASE, AXIS, *([] if covered else [moving(degrees)[1]])]

    scenes = [scene(60.0 + 4.0 * k) for k in range(15)]
    scenes += [scene(0.0, covered=True)] * 4 + [scene(190.0 + k) for k in range(3)]
    check(followed(scenes)[-1], scenes[-1])


def test_a_stick_whose_outer_marker_is_lost_as_it_starts_is_found_again() -> None:
    # In line with the base, so that nothing tells the axis yet; the outer one is smeared away at first.
    def scene(degrees: float, *, smeared: bool = False) -> list[complex]:
        return [*BASE, *moving(degrees)[: 1 if smeared else 2]]

    scenes = [scene(180.0)] * 5 + [scene(180.0 - 3.0 * k, smeared=True) for k in range(1, 13)]
    scenes += [scene(143.0 - k) for k in range(4)]
    check(followed(scenes)[-1], scenes[-1])


def test_a_stick_that_starts_does_not_leave_a_marker_on_the_dot_of_the_base_that_it_lays_bare() -> None:
    # The moving stick is 24 px wide, and above. Seen from aside, so that lengths alone do not tell the dots apart.
    def scene(degrees: float) -> list[complex]:
        turn = np.exp(1j * np.deg2rad(degrees))
        bare = [AXIS + place for place in (80.0, 132.0) if abs((place / turn).imag) > 12.0]
        return [*bare, *(AXIS + complex(away.real, 0.88 * away.imag) for away in np.subtract(moving(degrees), AXIS))]

    turns = [*np.arange(100.0, 1.0, -3.0), *[1.0] * 8, *np.arange(5.5, 30.0, 4.5)]
    for row, turn in zip(followed([scene(turn) for turn in turns]), turns, strict=True):
        outer = scene(turn)[-1]
        if row["state"][3] == CODE["seen"]:
            assert row["position_px"][3] == pytest.approx([outer.real, outer.imag], abs=8.0 * SIGMA_PX)
    assert (row["state"][2:] == CODE["seen"]).all()


def test_a_stick_that_was_away_before_its_axis_showed_is_not_found_the_wrong_way_round() -> None:
    # In line with the base, so that nothing tells the axis.
    scenes = [[*BASE, *moving(180.0)]] * 5 + [[*BASE]] * 6 + [[*BASE, *moving(140.0 - k)] for k in range(4)]
    check(followed(scenes)[-1], scenes[-1])


def exposed(turn: np.ndarray, *, share: float) -> list[np.ndarray]:
    """Draw the stick at some directions (degrees, one per frame), with the shutter open for a share of a frame."""
    times = np.arange(len(turn)) + share * (np.arange(8)[:, None] - 3.5) / 8.0
    at = np.interp(times.T, np.arange(len(turn)), turn)
    drawn = [[picture([*BASE, *moving(one)], seed=8 * n + k) for k, one in enumerate(row)] for n, row in enumerate(at)]
    return [np.mean(frame, axis=0).round().astype(np.uint8) for frame in drawn]


def test_a_stick_that_starts_fast_is_found_by_its_smear() -> None:
    # A fast turn tells the shutter, slow ones tell nothing; then the stick rests, and starts at 20 px per frame.
    speed = [0.0] * 3 + [4.0] * 20 + [1.0] * 50 + [0.0] * 20 + [8.0] * 8
    turn = 40.0 + np.cumsum(speed)
    follower = follower_of([*BASE, *moving(40.0)])
    for number, luma in enumerate(exposed(turn, share=0.9)):
        row = follower.step(Frame(number, number / 30.0, luma))
        if number > len(turn) - 7:
            assert (row["state"] == CODE["seen"]).all()
    assert follower.report()["shutter_share_of_frame"] == pytest.approx(0.9, abs=0.15)


def test_a_stick_that_starts_fast_is_found_by_its_smear_before_it_is_known_to_move() -> None:
    turn = 40.0 + np.cumsum([0.0] * 10 + [9.0] * 12)
    follower = follower_of([*BASE, *moving(40.0)], moving=None)
    rows = [
        follower.step(Frame(number, number / 30.0, luma)).copy() for number, luma in enumerate(exposed(turn, share=0.5))
    ]
    assert follower.moving == 1
    assert sum((row["state"] != CODE["seen"]).any() for row in rows) <= 2


@pytest.mark.parametrize("jump", [6.0 - 5.0j, -11.0 + 9.0j, -60.0 - 45.0j])
def test_a_picture_that_jumps(jump: complex) -> None:
    # The last one is beyond what is searched in the first frame: 3 × 15 px.
    scenes = turning(10)
    scenes[7:] = [[dot + jump for dot in scene] for scene in scenes[7:]]
    check(followed(scenes)[-1], scenes[-1])


def rolled(scene: list[complex], degrees: float, shift: complex = 0j) -> list[complex]:
    """Return dots as a camera sees them that is rolled, about the middle of the picture, and pushed."""
    return [220.0 + 200.0j + shift + (dot - 220.0 - 200.0j) * np.exp(1j * np.deg2rad(degrees)) for dot in scene]


@pytest.mark.parametrize("degrees", [-6.0, 8.0])
def test_a_camera_that_is_pushed_and_rolled(degrees: float) -> None:
    scenes = turning(24)
    scenes[12:] = [rolled(scene, degrees, 9.0 - 7.0j) for scene in scenes[12:]]
    rows = followed(scenes)
    for row, scene in zip(rows[14:], scenes[14:], strict=True):
        check(row, scene)


def test_a_camera_that_goes_on_rolling() -> None:
    scenes = [rolled(scene, 0.4 * number) for number, scene in enumerate(turning(30, step=3.0))]
    for row, scene in zip(followed(scenes), scenes, strict=True):
        check(row, scene)


def test_a_base_that_turns_alone_is_no_base() -> None:
    # No picture was rolled: the moving stick stays on its circle.
    scenes = turning(20)
    middle = 0.5 * (BASE[0] + BASE[1])
    for scene in scenes[12:]:
        scene[:2] = [middle + (dot - middle) * np.exp(0.15j) for dot in scene[:2]]
    assert all((row["state"][:2] != CODE["seen"]).all() for row in followed(scenes)[13:])


def test_a_stick_that_was_away_is_found_on_its_circle() -> None:
    scenes = turning(30, step=3.0)
    whole = [list(scene) for scene in scenes]
    for scene in scenes[15:25]:
        del scene[2:]
    rows = followed(scenes)
    assert all((row["state"][2:] != CODE["seen"]).all() for row in rows[15:25])
    check(rows[-1], whole[-1])


def test_dots_off_the_circle_are_not_the_stick() -> None:
    scenes = turning(30, step=3.0)
    for scene in scenes[15:]:
        scene[2:] = [dot + 95.0 + 60.0j for dot in scene[2:]]
    assert all((row["state"][2:] != CODE["seen"]).all() for row in followed(scenes)[15:])


def test_the_search_widens_up_to_the_whole_picture() -> None:
    own = np.zeros(1, STICK)[0]
    for scale in (1, 4):  # whatever the size of the picture
        ends, size = ((100.0 * scale, 80.0 * scale), (160.0 * scale, 80.0 * scale)), (640 * scale, 480 * scale)
        predictions = [Prediction(ends, jump_px(60.0 * scale, lost), own, np.zeros(2)) for lost in (1, 2, 6)]
        regions = [expected.region(1, size) for expected in predictions]
        # Three standard deviations around the marker, of a fifth of their distance.
        half = 3 * 12 * scale
        assert regions[0] == Region(160 * scale - half, 80 * scale - half, 160 * scale + half, 80 * scale + half)
        assert regions[1].right == int(np.ceil((160.0 + 3.0 * 12.0 * 2.0**2.5) * scale))
        assert regions[2] == Region(0, 0, *size)


def test_one_of_many_alike_is_not_guessed() -> None:
    scenes = turning(20, step=3.0)
    for scene in scenes[15:]:
        scene[2:] = [*moving(200.0), *moving(300.0)]
    assert all((row["state"][2:] != CODE["seen"]).all() for row in followed(scenes)[15:])


@pytest.mark.parametrize("left", [0, 1])
def test_a_marker_that_slides_off_its_circle_while_its_partner_is_hidden(left: int) -> None:
    scenes = turning(32, step=3.0)
    for number, scene in enumerate(scenes[15:]):
        dot = scene[2 + left]
        # Two pixels a frame away from the axis, as by an object that is drawn over it: no step is a large one.
        scene[2:] = [dot + 2.0 * number * (dot - AXIS) / abs(dot - AXIS)]
    states = np.array([row["state"][2 + left] for row in followed(scenes)])
    arm = abs(scenes[0][2 + left] - AXIS)
    # Circles may be off by a tenth of the arm and 5 px; a frame more for the step over it.
    assert (states[:15] == CODE["seen"]).all()
    assert (states[15 + int((0.1 * arm + 5.0) / 2.0) + 2 :] != CODE["seen"]).all()
    assert (states[15:18] == CODE["seen"]).all()


def test_a_base_marker_that_slides_along_its_stick() -> None:
    # So slowly that no step is a large one.
    scenes, step_px = turning(160), 0.1
    for number, scene in enumerate(scenes):
        scene[1] = scene[1] + step_px * number
    states = np.array([row["state"] for row in followed(scenes)])
    # Three standard deviations of the moving stick's length, of 70 px: a tenth, and 5 px.
    allowed = int((0.1 * 70.0 + 5.0) / 70.0 * abs(BASE[1] - BASE[0]) / step_px)
    assert (states[:90, :2] == CODE["seen"]).all(axis=1).sum() > 80
    # In one frame the moving stick has to be searched for, and does not show the scale.
    assert (states[allowed + 2 :, :2] == CODE["seen"]).all(axis=1).sum() <= 1


def test_a_lens_that_focuses_anew() -> None:
    scenes = turning(40)
    middle = 220.0 + 200.0j
    # By 4 % over a second.
    scenes = [[middle + (1.0 + 0.001 * k) * (dot - middle) for dot in scene] for k, scene in enumerate(scenes)]
    check(followed(scenes)[-1], scenes[-1])


@pytest.mark.parametrize("away", [-60.0 + 90.0j, -25.0 + 8.0j])
def test_a_base_that_goes_elsewhere_alone_is_no_base(away: complex) -> None:
    scenes = turning(30)
    for scene in scenes[20:]:
        scene[:2] = [dot + away for dot in BASE]
    assert all((row["state"][:2] != CODE["seen"]).all() for row in followed(scenes)[20:])


def test_a_base_marker_that_slides_while_its_partner_is_hidden() -> None:
    scenes = turning(60)
    for number, scene in enumerate(scenes[20:]):
        scene[:2] = [BASE[0] + 1.0j * number]
    states = np.array([row["state"][0] for row in followed(scenes)])
    # χ² of 16.25 with the circles' deviations, ((0.1 · arm + 5) / 3) px, and 0.7 degrees over 120 px: 14.4 px.
    assert (states[:33] == CODE["seen"]).all()
    assert (states[36:] != CODE["seen"]).all()


def test_the_stick_that_turns_is_the_moving_one_while_the_other_is_half_hidden() -> None:
    scenes = turning(12)
    follower = follower_of(scenes[0], moving=None)
    for number, scene in enumerate(scenes):
        row = follower.step(Frame(number, number / 30.0, picture(scene[1:] if number else scene, seed=number)))
        # One degree, and thrice what a bumped camera may be rolled by, three times 0.7 degrees.
        assert follower.moving == (1 if 2.0 * number > 7.3 else None)
    assert row["state"].tolist() == [CODE["hidden"], *[CODE["seen"]] * 3]
