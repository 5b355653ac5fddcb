"""Tags on the sticks, in films that are drawn here."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.tracker.flat_films import FlatFilm, Hand, Sprite, tag
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.words.wording import listed
from tracker.angle.orient import orient
from tracker.detect.fiducials import TagsSeen, bits_of, families, find_tags, usual_tags
from tracker.detect.marker_file import read_markers
from tracker.detect.sticks import are_markers, couples_in
from tracker.frames.source import open_source
from tracker.initialise import find_start
from tracker.patches.tag_stick import Tag
from tracker.patches.warps import place, similarity
from tracker.quality.account import account
from tracker.track import track_film

SIDE = 36.0
ALONG = 70.0
FAMILY = "4X4_50"
TAG_1 = Sprite(**tag(FAMILY, 1, side_mm=SIDE, along_mm=95.0))
TAG_5 = Sprite(**tag(FAMILY, 5, side_mm=SIDE, along_mm=40.0))
LARGE_TAGS = [Sprite(**tag("APRILTAG_36h11", number, side_mm=60.0, along_mm=90.0)) for number in (4, 9)]
LARGE = {
    "base": LARGE_TAGS[:1],
    "moving": LARGE_TAGS[1:],
    "angle_deg": lambda t: 70.0 + 60.0 * t,
    "frames": 40,
    "size": (420, 320),
    "blur_px": 1.2,
}
PAIR = {"kind": "tag", "family": FAMILY, "base_id": 0, "moving_id": 1}


def film(family: str = FAMILY, ids: tuple[int, int] = (0, 1), **how) -> FlatFilm:
    """Two tags on two sticks, their x axes along the sticks."""
    base, moving = (Sprite(**tag(family, number, side_mm=SIDE, along_mm=ALONG)) for number in ids)
    return FlatFilm(**{"base": [base], "moving": [moving], "angle_deg": lambda t: 60.0 + 100.0 * t, **how})


def errors_deg(made: FlatFilm, path: Path, hints: dict, **codec) -> tuple[np.ndarray, np.ndarray, object]:
    """Angle less truth, sigma, and the track."""
    result = track_film(open_source(made.write(path, **codec)), markers=read_markers(hints))
    angles = orient(result.tracks, None).angles
    error = np.rad2deg(angles.angle_rad) - made.truth_deg
    return error - 360.0 * np.round(error[np.isfinite(error)][0] / 360.0), np.rad2deg(angles.sigma_rad), result


def tag_on_pixels(side_px: float, turn_deg: float, shift_px: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Picture of a tag, blurred by half a pixel and then integrated over each pixel from 12 × 12 points; its warp."""
    modules, size, fine = np.pad(bits_of(FAMILY, 0), 1, constant_values=True), 48, 12
    middle = 0.5 * (size - 1) + shift_px
    y, x = np.mgrid[: size * fine, : size * fine].astype(float) / fine + (0.5 / fine - 0.5)
    away = ((x - middle[0]) + 1j * (y - middle[1])) * np.exp(-1j * np.deg2rad(turn_deg))
    column, row = (np.floor(part / side_px * 6.0 + 4.0).astype(int).clip(0, 7) for part in (away.real, away.imag))
    sharp = np.where(modules[row, column], 205.0, 25.0)
    seen = cv2.GaussianBlur(sharp, (0, 0), 0.5 * fine).reshape(size, fine, size, fine).mean(axis=(1, 3))
    return np.rint(seen).astype(np.uint8), similarity(*middle, turn_rad=np.deg2rad(turn_deg))


def test_edges_that_lie_nearly_along_the_pixel_rows_do_not_turn_the_tag() -> None:
    tag_20 = Tag(FAMILY, 0, 20.0, 0.7)
    patch, rng, error_deg = tag_20.patch(), np.random.default_rng(1), []
    for turn_deg in (1.0, 1.5, 2.0, 2.5, 3.0) * 6:
        picture, warp = tag_on_pixels(20.0, turn_deg, rng.uniform(-0.5, 0.5, 2))
        fit = patch.align(picture, warp)
        assert fit is not None
        one, two = (place(fit.warp, end) for end in tag_20.ends())
        error_deg.append(np.rad2deg(np.arctan2(two[1] - one[1], two[0] - one[0])) - turn_deg)
    # Less than noise of three grey levels makes of it; linear interpolation between whole pixels makes 0.09.
    assert np.sqrt(np.mean(np.square(error_deg))) < 0.04


def test_ten_px_per_frame_with_half_the_frame_exposed(tmp_path: Path) -> None:
    # 10 px per frame at the tag's middle: 8.2 degrees, of which the tag smears over 5 px.
    step_deg = np.rad2deg(10.0 / ALONG)
    made = film(angle_deg=lambda t: 60.0 + 30.0 * step_deg * t, exposure=0.5, frames=31)
    error, sigma, result = errors_deg(made, tmp_path / "film.mp4", PAIR, codec="libx264")
    assert np.isfinite(error).all()
    # Each end of the tag is off by less than a tenth of a pixel.
    assert np.abs(error).max() < np.rad2deg(np.sqrt(2.0) * 0.1 / SIDE) * np.sqrt(2.0)
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4
    assert result.report["markers"]["kind"] == "tag"


def test_sigma_of_a_smeared_tag_does_not_hang_on_frames_in_which_the_base_is_hidden(tmp_path: Path) -> None:
    # Its smear is no noise: where the base's tag is covered, the noise is that of the frames before.
    step_deg = np.rad2deg(10.0 / ALONG)
    made = film(angle_deg=lambda t: 60.0 + 30.0 * step_deg * t, exposure=0.5, frames=52)
    error, sigma, result = errors_deg(made, tmp_path / "film.mp4", PAIR, codec="libx264")
    assert not result.tracks.valid[:, :2].all()
    known = np.isfinite(error)
    assert known.sum() > 45
    assert 0.7 < np.sqrt(np.mean((error[known] / sigma[known]) ** 2)) < 1.5


def test_two_turns_past_the_base_do_not_drift_and_sigma_is_honest(tmp_path: Path) -> None:
    # The moving tag lies over the base's once a turn: the base is not seen there, and the angle is known.
    made = film(angle_deg=lambda t: 60.0 + 300.0 * t, frames=75, noise=3.0)
    error, sigma, result = errors_deg(made, tmp_path / "film.mkv", PAIR)
    assert np.isfinite(error).all()
    assert not result.tracks.valid[:, :2].all()
    assert np.ptp(made.truth_deg) > 600.0
    assert abs(error[-20:].mean() - error[:20].mean()) < 3.0 * np.median(sigma)
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4
    # In the middles of both edges, with sigmas that are as honest.
    truth = np.array([[made.on_stick(1, a, ALONG + e * SIDE / 2) for e in (-1, 1)] for a in made.truth_deg])
    scaled = orient(result.tracks, None).with_errors(result.tracks)
    off = scaled.position_px[:, 2:] - truth
    variance = np.einsum("nmii->nmi", scaled.covariance_px2[:, 2:])
    assert 0.7 < np.sqrt(np.mean(off**2 / variance)) < 1.4


@pytest.mark.parametrize("family", ["APRILTAG_36h11", "APRILTAG_16h5", "6X6_250"])
def test_other_families_seen_from_aside(family: str, tmp_path: Path) -> None:
    made = film(family, angle_deg=lambda t: 180.0 + 120.0 * np.cos(4.0 * t), tilt_deg=25.0, frames=40)
    error, _, _ = errors_deg(made, tmp_path / "film.mkv", PAIR | {"family": family})
    assert np.isfinite(error).all()
    assert np.sqrt(np.mean(error**2)) < 0.1


def test_a_tag_behind_a_hand_is_found_again_where_it_comes_out(tmp_path: Path) -> None:
    made = film(angle_deg=lambda t: 70.0 + 200.0 * t, frames=40, hands=[Hand(10, 25, "moving", radius_mm=45.0)])
    error, _, result = errors_deg(made, tmp_path / "film.mkv", PAIR)
    hidden = ~result.tracks.valid[:, 2:].any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(hidden), np.arange(10, 25))
    assert np.nanmax(np.abs(error)) < 0.2
    # A tag is no dot, and was found again: what is said of it is of tags.
    (about,) = [
        text for text in account(result, orient(result.tracks, None), doubts=[])["advice"] if "have no angle" in text
    ]
    assert "a tag was not seen: something lay over it" in about


def test_a_hand_over_a_corner_does_not_turn_the_tag(tmp_path: Path) -> None:
    corner = (-ALONG - SIDE / 2, SIDE / 2)
    made = film(hands=[Hand(8, 25, corner, radius_mm=9.0, level=200.0)], frames=32)
    error, _, result = errors_deg(made, tmp_path / "film.mkv", PAIR)
    assert result.tracks.valid.all()
    # Taken for a part of the tag the hand would turn it by a degree.
    assert np.abs(error).max() < 0.2


def inked_tags(seed: int, wander: float) -> list[Sprite]:
    """Two tags of 60 px whose edges wander; one unit is 0.65 px."""
    rng = np.random.default_rng(seed)
    inked = []
    for number in (0, 1):
        sprite = tag(FAMILY, number, side_mm=60.0, along_mm=90.0)
        rows, columns = sprite["picture"].shape
        y, x = np.mgrid[:rows, :columns].astype(np.float32)
        by_x, by_y = (cv2.GaussianBlur(rng.normal(size=(rows, columns)).astype(np.float32), (0, 0), 5.0) for _ in "xy")
        moved = [axis + wander * by / by.std() for axis, by in ((x, by_x), (y, by_y))]
        sprite["picture"] = cv2.remap(sprite["picture"], *moved, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        inked.append(Sprite(**sprite))
    return inked


def test_a_sheet_over_a_corner_of_the_base_does_not_turn_it(tmp_path: Path) -> None:
    # The moving tag's paper passes over the base's tag, whose visible part the detector takes for a distorted tag.
    made = film(angle_deg=lambda t: 20.0 * t - 58.0, frames=90, seed=2)
    made.moving[0].along_mm = 95.0
    error, sigma, _ = errors_deg(made, tmp_path / "film.mkv", PAIR, codec="ffv1")
    known = np.isfinite(error)
    assert known.mean() > 0.9
    assert np.abs(error[known]).max() < 0.3
    assert np.abs(error[known] / sigma[known]).max() < 4.0


def test_uneven_ink_is_part_of_the_tag(tmp_path: Path) -> None:
    # Its edges wander by 0.4 px: single points differ from the tag as drawn by as much as those under a hand, but in
    # every frame.
    inked = inked_tags(5, 0.6)
    corner = (-90.0 - 30.0, 30.0)
    how = {
        "base": [inked[0]],
        "moving": [inked[1]],
        "angle_deg": lambda t: 80.0 + 20.0 * t,
        "frames": 60,
        "size": (420, 400),
    }
    hand = [Hand(30, 60, corner, radius_mm=16.0, level=200.0)]
    free, covered = (
        errors_deg(film(**how, hands=hands), tmp_path / f"film{len(hands)}.mkv", PAIR)[0] for hands in ([], hand)
    )
    # Each end of the tag is off by less than a fiftieth of a pixel, and a part of the tag tells the same.
    limit = np.rad2deg(np.sqrt(2.0) * 0.02 / 60.0) * np.sqrt(2.0)
    assert np.sqrt(0.5 * np.mean(np.diff(free) ** 2)) < limit
    assert np.abs(np.mean((covered - free)[30:])) < limit / 2.0


@pytest.mark.parametrize(
    ("wander", "at", "radius", "level"), [(0.6, 14.0, 9.0, 180.0), (0.9, 20.0, 8.0, 160.0), (1.2, 18.0, 7.0, 120.0)]
)
def test_what_covers_the_base_at_first_is_no_part_of_it(
    wander: float, at: float, radius: float, level: float, tmp_path: Path
) -> None:
    # Something lies over a few modules for half the film. The part that is seen and the whole tell directions of their
    # own, for the ink is uneven, by up to a pixel: the first one holds.
    base, moving = inked_tags(7, wander)
    made = film(
        base=[base],
        moving=[moving],
        angle_deg=lambda t: 90.0 + 30.0 * np.sin(3.0 * t),
        frames=60,
        size=(420, 400),
        hands=[Hand(0, 30, (-90.0 + at, -at), radius_mm=radius, level=level)],
    )
    error, sigma, result = errors_deg(made, tmp_path / "film.mkv", PAIR)
    assert result.tracks.valid.all()
    # Each end of the tag moves by less than a thirtieth of a pixel.
    assert np.abs(error[35:].mean() - error[:30].mean()) < np.rad2deg(np.sqrt(2.0) * 0.03 / 60.0)
    assert np.sqrt(np.mean(np.square((error - error.mean()) / sigma))) < 1.4


def test_going_on_from_a_noted_state_is_the_same_bit_by_bit(tmp_path: Path) -> None:
    source = open_source(film(frames=20, angle_deg=lambda t: 20.0 + 150.0 * t).write(tmp_path / "film.mkv"))
    start = find_start(source, read_markers(PAIR))
    whole, part = start.follower(), start.follower()
    rows = [whole.step(frame) for frame in source]
    for frame in itertools.islice(source, 9):
        part.step(frame)
    state = json.loads(json.dumps(part.to_state()))
    again = start.follower()
    again.restore(state)
    rest = [again.step(frame) for frame in itertools.islice(source, 9, None)]
    assert [row.tobytes() for row in rest] == [row.tobytes() for row in rows[9:]]


def test_tags_are_found_without_a_marker_file(tmp_path: Path) -> None:
    # The tag of the larger number is on the base.
    made = film("APRILTAG_36h11", (9, 4), noise=3.0)
    result = track_film(open_source(made.write(tmp_path / "film.mkv")))
    told = result.report["markers"]
    assert (told["kind"], told["family"], told["base_id"], told["moving_id"]) == ("tag", "APRILTAG_36h11", 9, 4)
    assert not told["given"]
    named = {"kind": "tag", "family": "APRILTAG_36h11", "base_id": 9, "moving_id": 4}
    same = track_film(open_source(tmp_path / "film.mkv"), markers=read_markers(named))
    np.testing.assert_allclose(result.tracks.position_px, same.tracks.position_px, atol=0.02)


class Focusing(FlatFilm):
    """Out of focus in the first frame, and in focus within ten."""

    def pictures(self) -> Iterator[np.ndarray]:
        for number in range(self.frames):
            now = FlatFilm(self.base, self.moving, self.angle_deg, frames=self.frames, size=self.size)
            now.blur_px = 0.5 + (self.blur_px - 0.5) * max(0.0, 1.0 - 0.1 * number)
            yield next(itertools.islice(now.pictures(), number, None))


@pytest.mark.parametrize("blur_px", [1.8, 2.4])
def test_a_lens_that_finds_its_focus_as_the_film_begins(blur_px: float, tmp_path: Path) -> None:
    base, moving = (Sprite(**tag("APRILTAG_36h11", number, side_mm=46.0, along_mm=ALONG)) for number in (4, 9))
    made = Focusing([base], [moving], lambda t: 60.0 + 100.0 * t, frames=30, blur_px=blur_px)
    named = {"kind": "tag", "family": "APRILTAG_36h11", "base_id": 4, "moving_id": 9}
    result = track_film(open_source(made.write(tmp_path / "film.mkv")), markers=read_markers(named))
    assert orient(result.tracks, None).angles.valid[10:].all()


def test_small_tags_that_are_a_little_out_of_focus_are_found() -> None:
    # Modules of 4.5 px; OpenCV's own size for reading them finds 33 of these 48.
    base, moving = (Sprite(**tag(FAMILY, number, side_mm=27.0, along_mm=ALONG)) for number in (0, 1))
    made = FlatFilm([base], [moving], lambda t: 60.0 + 210.0 * t, frames=24, base_deg=175.0, blur_px=1.3)
    found = [find_tags(picture, FAMILY) for picture in made.pictures()]
    assert sum(len(one) for one in found) >= 46


def test_modules_of_tags_that_look_like_dots_on_two_sticks_are_not_taken_for_them(tmp_path: Path) -> None:
    made = film(**LARGE)
    # Four of them pass for markers.
    assert are_markers(couples_in(np.asarray(next(made.pictures())))[0])
    start = find_start(open_source(made.write(tmp_path / "film.mkv")), None)
    assert start.hints is not None
    assert (start.kind, start.hints.ids) == ("tag", (4, 9))


def test_tags_that_are_seen_in_few_of_the_first_frames_are_found(tmp_path: Path) -> None:
    hands = [Hand(begin, end, (-ALONG, 0.0), radius_mm=20.0, level=200.0) for begin, end in ((0, 2), (9, 32))]
    start = find_start(open_source(film(hands=hands, frames=32).write(tmp_path / "film.mkv")), None)
    assert start.hints is not None
    assert (start.kind, start.hints.ids) == ("tag", (0, 1))


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"angle_deg": lambda t: 60.0 + 0.0 * t}, ["no stick moves", "tags 0 and 1 of 4X4_50", "--markers"]),
        ({"moving": [TAG_1, TAG_5]}, ["more than two tags", "numbers 0, 1 and 5", "base_id"]),
        ({"ids": (3, 3), "frames": 6}, ["two tags have the same number", "4X4_50, number 3", "board --tags"]),
        ({"mirrored": True, "frames": 6}, ["tags are seen mirrored", "numbers 0 and 1", "hflip"]),
        ({"moving": [], "frames": 6}, ["only one tag is seen", "number 0", "a tag on each stick"]),
        # Four modules of these pass for markers.
        ({"mirrored": True, **LARGE}, ["tags are seen mirrored", "APRILTAG_36h11, numbers 4 and 9"]),
    ],
)
def test_tags_found_without_a_marker_file_that_tell_no_angle(how: dict, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(NoResultError) as error:
        track_film(open_source(film(**how).write(tmp_path / "film.mkv")))
    for word in words:
        assert word in str(error.value)


def squares_by_chance(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return a picture of black squares with random modules inside, as letters are."""
    picture = np.full((480, 640), 225.0)
    for number in range(count):
        modules = np.pad(rng.random((4, 4)) < 0.5, 1)
        row, column = np.array([20, 20]) + 56 * np.array(divmod(number, 11))
        picture[row : row + 36, column : column + 36] = np.where(np.kron(modules, np.ones((6, 6))), 225.0, 30.0)
    return picture


def test_squares_that_are_tags_by_chance_are_no_pair() -> None:
    seen = TagsSeen()
    for seed in (1, 2):
        picture = squares_by_chance(np.random.default_rng(7), 80) + np.random.default_rng(seed).normal(0, 2, (480, 640))
        seen.take(np.clip(np.rint(cv2.GaussianBlur(picture, (0, 0), 0.7)), 0, 255).astype(np.uint8))
    # Each of the 80 is one of the thousand codes with a probability of a sixteenth.
    found = usual_tags(np.rint(cv2.GaussianBlur(picture, (0, 0), 0.7)).clip(0, 255).astype(np.uint8))
    assert len(found["4X4_1000"]) > 2
    assert seen.pair == ("", [])
    assert seen.fault() is None


def test_motion_tells_which_stick_moves(tmp_path: Path) -> None:
    source = open_source(film(ids=(1, 0), frames=8).write(tmp_path / "film.mkv"))
    follower = find_start(source, read_markers(PAIR)).follower(motion_tells=True)
    for frame in source:
        follower.step(frame)
    assert follower.moving == 0


@pytest.mark.parametrize(
    ("how", "hints", "words"),
    [
        ({}, {"family": "APRILTAG_36h11"}, ["another family", "4X4_50", "0 and 1"]),
        ({"ids": (3, 7)}, {}, ["tag 0 of the base stick and tag 1", "numbers 3 and 7", "base_id"]),
        ({"ids": (0, 0)}, {}, ["tag 0 of the base stick is seen 2 times", "board --tags"]),
        ({"mirrored": True}, {}, ["mirrored", "hflip"]),
        ({"ids": (0, 5)}, {}, ["tag 1 of the moving stick (4X4_50) was not found", "number 5"]),
        ({"moving": []}, {}, ["tag 1 of the moving stick (4X4_50) was not found; found of this family number 0;"]),
        # Turned over, tag 0 is read as one of this family.
        ({}, {"family": "APRILTAG_16h5"}, ["another family", "4X4_50, numbers 0 and 1"]),
    ],
)
def test_tags_that_are_not_as_told(how: dict, hints: dict, words: list[str], tmp_path: Path) -> None:
    source = open_source(film(frames=2, **how).write(tmp_path / "film.mkv"))
    with pytest.raises(NoResultError) as caught:
        find_start(source, read_markers(PAIR | hints))
    for word in words:
        assert word in str(caught.value)


def test_no_tags_at_all(tmp_path: Path) -> None:
    source = open_source(FlatFilm([], [], lambda t: 0.0 * t, frames=2).write(tmp_path / "film.mkv"))
    with pytest.raises(NoResultError, match=r"not found.*white border"):
        find_start(source, read_markers(PAIR))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"family": "4X4_51"}, "no family of tags.*4X4_51.*APRILTAG_36h11"),
        ({"moving_id": 0}, "both sticks have the tag of one number"),
        ({"moving_id": 50}, "moving_id.*found 50.*0 to 49"),
        ({"base_id": True}, "'base_id' is no number"),
        ({"base_id": None}, "has no key 'base_id'"),
        ({"kind": {"base": "tag", "moving": "dot"}}, "'moving' is not two positions"),
        ({"kind": {"base": "tag", "moved": "dot"}}, "moved"),
        ({"kind": "dot", "base": [[1, 1], [9, 9]], "moving": [[20, 1], [30, 9]]}, "'family' is of tags"),
    ],
)
def test_what_no_tag_has_is_refused(change: dict, words: str) -> None:
    content = {key: value for key, value in (PAIR | change).items() if value is not None}
    with pytest.raises(ConfigError, match=words):
        read_markers(content)


def test_families_are_those_of_opencv_each_once() -> None:
    names = families()
    assert len({getattr(cv2.aruco, f"DICT_{name}") for name in names}) == len(names), listed(list(names))
    assert {"4X4_50", "APRILTAG_16h5", "ARUCO_ORIGINAL"} <= set(names)
