"""Points without a dot, in films of textured sticks that are drawn here; sticks of two kinds."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.tracker.flat_films import FlatFilm, Hand, Sprite, tag, texture_picture
from torsight.core.errors import NoResultError
from tracker.angle.orient import orient
from tracker.detect.marker_file import read_markers
from tracker.frames.source import open_source
from tracker.initialise import find_start
from tracker.quality.account import account
from tracker.quality.track_warnings import doubts
from tracker.track import TrackResult, track_film

INNER, OUTER = 35.0, 100.0


def textured(seed: int) -> Sprite:
    return Sprite(texture_picture(np.random.default_rng(seed), 90, 400), along_mm=65.0, width_mm=130.0)


def film(**how) -> FlatFilm:
    return FlatFilm(**{"base": [textured(1)], "moving": [textured(2)], "angle_deg": lambda t: 60.0 + 100.0 * t, **how})


def points(made: FlatFilm, stick: int) -> list[list[float]]:
    first_deg = float(made.truth_deg[0])
    return [made.on_stick(stick, first_deg, along).tolist() for along in (INNER, OUTER)]


def tracked(made: FlatFilm, path: Path, hints: dict | None = None, **codec) -> tuple[np.ndarray, TrackResult]:
    """Angle less truth, and the track."""
    given = {"kind": "texture", "base": points(made, 0), "moving": points(made, 1)} | (hints or {})
    result = track_film(open_source(made.write(path, **codec)), markers=read_markers(given))
    angles = orient(result.tracks, None).angles
    error = np.rad2deg(angles.angle_rad) - made.truth_deg
    return error - 360.0 * np.round(error[np.isfinite(error)][0] / 360.0), result


@pytest.mark.parametrize("step_deg", [np.rad2deg(15.0 / OUTER), 20.0], ids=["15 px", "20 degrees"])
def test_fast_turns_past_the_base(step_deg: float, tmp_path: Path) -> None:
    made = film(angle_deg=lambda t: 60.0 + 30.0 * step_deg * t, frames=50)
    error, result = tracked(made, tmp_path / "film.mp4", codec="libx264")
    assert np.isfinite(error).all()
    assert not doubts(result)
    # Each point is off by less than a fifth of a pixel.
    assert np.abs(error).max() < np.rad2deg(np.sqrt(2.0) * 0.2 / (OUTER - INNER))


def test_motion_blur_of_a_motion_that_begins_is_part_of_the_picture(tmp_path: Path) -> None:
    # From rest to 10 degrees per frame, 17 px at the outer point, of which it is blurred over half.
    made = film(angle_deg=lambda t: 60.0 + 150.0 * np.maximum(t - 0.3, 0.0) ** 2, exposure=0.5, frames=40)
    error, _ = tracked(made, tmp_path / "film.mkv")
    # Against the blurred picture the sharp template is off by 0.2 degrees.
    assert abs(np.mean(error[26:]) - np.mean(error[:9])) < 0.1
    assert np.std(error[26:]) < 0.1


def test_a_stick_that_is_narrower_than_its_patches_is_not_drawn_by_the_ground_beside_it(tmp_path: Path) -> None:
    # 21 mm wide, 1 px to the mm; the ground is as rough as the sticks.
    base, moving = (
        Sprite(texture_picture(np.random.default_rng(seed), 64, 400), along_mm=65.0, width_mm=130.0) for seed in (1, 2)
    )
    error, _ = tracked(film(base=[base], moving=[moving], grain=40.0), tmp_path / "film.mkv")
    assert np.isfinite(error).all()
    # Each point is off by less than a fifth of a pixel.
    assert np.nanmax(np.abs(error)) < np.rad2deg(np.sqrt(2.0) * 0.2 / (OUTER - INNER))


def test_the_same_film_in_a_large_picture_has_the_same_angles(tmp_path: Path) -> None:
    # Between two frames the outer point moves by up to 31 px, of the larger film by 92, and turns round three times.
    made = film(angle_deg=lambda t: 60.0 + 75.0 * np.sin(7.0 * t), frames=40)
    (small, _), (large, _) = (
        tracked(replace(made, enlarged=times), tmp_path / f"{times}.mp4", codec="libx264") for times in (1, 3)
    )
    assert np.isfinite([small, large]).all()
    assert np.std(large) < 1.3 * np.std(small)


def test_seen_from_aside(tmp_path: Path) -> None:
    made = film(angle_deg=lambda t: 100.0 + 60.0 * (1.0 - np.cos(3.0 * t)), tilt_deg=30.0, frames=50)
    error, result = tracked(made, tmp_path / "film.mkv")
    assert result.tracks.valid.mean() > 0.98
    # A turn of the shape alone would be off by 0.2 degrees.
    assert np.sqrt(np.nanmean(error**2)) < 0.06


@pytest.mark.parametrize("step_deg", [1.0, 9.0])
def test_a_lost_stick_is_found_again_by_its_turned_patch(step_deg: float, tmp_path: Path) -> None:
    hand = Hand(12, 26, "moving", radius_mm=50.0)
    made = film(angle_deg=lambda t: 80.0 + 30.0 * step_deg * t, frames=45, hands=[hand], size=(320, 280))
    error, result = tracked(made, tmp_path / "film.mkv")
    seen = result.tracks.valid[:, 2:].all(axis=1)
    assert not seen[12:26].any()
    assert seen[:12].all()
    # Looked for around its axis in one frame of three where the axis is known, and in the whole picture seldom.
    assert seen[30:].all()
    assert np.nanmax(np.abs(error)) < 0.3


@pytest.mark.parametrize(("step_deg", "tilt_deg", "distance_mm"), [(32.0, 20.0, 350.0), (40.0, 25.0, 300.0)])
def test_a_point_that_was_lost_is_found_beside_the_other_one_in_perspective(
    step_deg: float, tilt_deg: float, distance_mm: float, tmp_path: Path
) -> None:
    # Six frames too fast for any flow; then 4 degrees from frame to frame, on a stick seen from near and from aside.
    made = film(
        angle_deg=lambda t: 70.0 + 120.0 * t + (step_deg - 4.0) * np.minimum(30.0 * t, 6.0),
        tilt_deg=tilt_deg,
        distance_mm=distance_mm,
        frames=40,
    )
    _, result = tracked(made, tmp_path / "film.mkv")
    assert result.tracks.valid[10:, 2:].all()
    true = np.array([[made.on_stick(1, angle, along) for along in (INNER, OUTER)] for angle in made.truth_deg])
    assert np.abs(result.tracks.position_px[10:, 2:] - true[10:]).max() < 0.4


def protractor() -> Sprite:
    """Return a square with marks every ten degrees at two radii, of which each looks like all others."""
    picture = np.full((760, 760), 210.0, np.float32)
    for turn in np.deg2rad(np.arange(0.0, 360.0, 10.0)):
        for near, far in ((120.0, 150.0), (320.0, 355.0)):
            way = 16.0 * np.array([np.cos(turn), np.sin(turn)])
            ends = [tuple(np.rint(16.0 * 379.5 + radius * way).astype(int).tolist()) for radius in (near, far)]
            cv2.line(picture, *ends, 40.0, 8, cv2.LINE_AA, 4)
    return Sprite(picture, along_mm=0.0, width_mm=190.0)


@pytest.mark.parametrize(("step_deg", "radius_mm"), [(3.3, 14.0), (3.3, 10.0), (4.0, 14.0)])
def test_a_pattern_that_is_repeated_is_not_taken_for_its_neighbour(
    step_deg: float, radius_mm: float, tmp_path: Path
) -> None:
    base = Sprite(texture_picture(np.random.default_rng(1), 90, 180), along_mm=165.0, width_mm=60.0)
    # A blot in the way of the outer mark, which reaches its middle in frame 16, and the next mark is free behind it.
    at = 84.4 * np.exp(1j * np.deg2rad(180.0 + 60.0 + 16.0 * step_deg))
    made = FlatFilm(
        [base],
        [protractor()],
        lambda t: 60.0 + 30.0 * step_deg * t,
        hands=[Hand(10, 34, (at.real, at.imag), radius_mm=radius_mm)],
        size=(420, 300),
        frames=36,
    )
    places = [made.on_stick(0, 60.0, along).tolist() for along in (150.0, 180.0)]
    marks = [made.on_stick(1, 60.0, along).tolist() for along in (33.75, 84.4)]
    error, result = tracked(made, tmp_path / "film.mkv", {"base": places, "moving": marks})
    # The next mark is ten degrees away.
    assert np.nanmax(np.abs(error)) < 0.3
    assert np.isfinite(error[:12]).all()
    assert np.isfinite(error[24:]).all()
    assert result.tracks.valid[:, :3].all()
    (told,) = [text for text in doubts(result) if "repeated" in text]
    assert re.search("turned by [1-6]0 degrees", told)


def test_a_patch_that_slides_onto_blank_paper_is_not_valid(tmp_path: Path) -> None:
    # The stick's outer half is painted over, from one frame to the next, by paper that turns with it.
    made = film(frames=24, hands=[Hand(12, 24, "moving", radius_mm=70.0, level=180.0)])
    _, result = tracked(made, tmp_path / "film.mkv")
    assert result.tracks.valid[:12].all()
    assert not result.tracks.valid[12:, 2:].any()


@pytest.mark.parametrize(
    ("paint", "words"),
    [
        (lambda picture: picture.fill(150.0), "no texture around it"),
        (lambda picture: picture.__setitem__(slice(0, 120), 60.0), "lies on an edge"),
    ],
    ids=["blank", "edge"],
)
def test_a_point_that_nothing_tells_is_refused(paint, words: str, tmp_path: Path) -> None:
    luma = np.full((240, 320), 180.0)
    paint(luma)
    luma += np.random.default_rng(5).normal(0.0, 1.0, luma.shape)
    cv2.imwrite(str(tmp_path / "a.png"), np.clip(luma, 0, 255).astype(np.uint8))
    hints = {"kind": "texture", "base": [[60, 120], [110, 120]], "moving": [[200, 120], [260, 120]]}
    with pytest.raises(NoResultError, match=words) as caught:
        find_start(open_source(tmp_path / "a.png"), read_markers(hints))
    assert "base, inner marker" in str(caught.value)


def dotted() -> Sprite:
    """Return a light stick with two dots of 5 mm radius."""
    picture = np.full((80, 480), 200.0, np.float32)
    for along in (INNER, OUTER):
        cv2.circle(picture, (round(4 * (along - 5.0)), 40), 20, 40.0, -1, cv2.LINE_AA)
    return Sprite(picture, along_mm=65.0, width_mm=120.0)


@pytest.mark.parametrize(
    ("kind", "sprites"),
    [
        ({"base": "tag", "moving": "dot"}, (Sprite(**tag("4X4_50", 0, side_mm=36.0, along_mm=70.0)), dotted())),
        ({"base": "dot", "moving": "tag"}, (dotted(), Sprite(**tag("4X4_50", 1, side_mm=36.0, along_mm=70.0)))),
        ({"base": "texture", "moving": "dot"}, (textured(1), dotted())),
    ],
    ids=["tag and dots", "dots and tag", "texture and dots"],
)
def test_sticks_of_two_kinds(kind: dict, sprites: tuple[Sprite, Sprite], tmp_path: Path) -> None:
    made = film(base=[sprites[0]], moving=[sprites[1]], angle_deg=lambda t: 60.0 + 240.0 * t, frames=45)
    tags = {"family": "4X4_50", "base_id": 0, "moving_id": 1} if "tag" in kind.values() else {}
    error, result = tracked(made, tmp_path / "film.mkv", {"kind": kind, **tags})
    assert np.isfinite(error).mean() > 0.95
    # The dots are drawn to whole steps of an eighth of a millimetre.
    assert np.sqrt(np.nanmean(error**2)) < np.rad2deg(0.25 / (OUTER - INNER))
    assert result.report["markers"]["kind"] == kind


class Fading(FlatFilm):
    """The light falls to three tenths."""

    def pictures(self) -> Iterator[np.ndarray]:
        for number, picture in enumerate(super().pictures()):
            yield np.rint(picture * (1.0 - 0.7 * number / self.frames)).astype(np.uint8)


class Nearer(FlatFilm):
    """The camera comes nearer: the picture grows to 1.6 times its size."""

    def pictures(self) -> Iterator[np.ndarray]:
        for number, picture in enumerate(super().pictures()):
            middle = ((self.size[0] - 1) / 2.0, (self.size[1] - 1) / 2.0)
            by = cv2.getRotationMatrix2D(middle, 0.0, 1.0 + 0.6 * number / self.frames)
            yield cv2.warpAffine(picture, by, self.size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


@pytest.mark.parametrize("kind", [Fading, Nearer])
def test_texture_that_changes_slowly_is_followed(kind: type[FlatFilm], tmp_path: Path) -> None:
    made = kind([textured(1)], [textured(2)], lambda t: 60.0 + 50.0 * t, size=(480, 400))
    error, _ = tracked(made, tmp_path / "film.mkv")
    assert np.isfinite(error).all()
    assert np.sqrt(np.mean((error - error.mean()) ** 2)) < np.rad2deg(np.sqrt(2.0) * 0.1 / (OUTER - INNER))


def test_a_stick_that_lies_over_the_base_displaces_nothing(tmp_path: Path) -> None:
    # Wide sticks of the same texture: 17 degrees apart the moving one reaches the base's outer patch.
    made = film(angle_deg=lambda t: 75.0 - 65.0 * np.sin(2.0 * t) ** 2, frames=50)
    error, result = tracked(made, tmp_path / "film.mp4", codec="libx264")
    reached = np.abs(made.truth_deg) < 25.0
    assert reached.any()
    assert not result.tracks.valid[reached, 0].any()
    assert np.isfinite(error).all()
    assert np.abs(error - np.median(error)).max() < np.rad2deg(np.sqrt(2.0) * 0.2 / (OUTER - INNER))


def spotted() -> Sprite:
    """Return a blank stick, wider than its patches, with a round spot at each of its points."""
    picture = np.full((400, 800), 170.0, np.float32)
    for along in (INNER, OUTER):
        cv2.circle(picture, (round(800.0 * along / 130.0), 200), 26, 60.0, -1, cv2.LINE_AA)
    return Sprite(picture, along_mm=65.0, width_mm=130.0)


@pytest.mark.parametrize("beside_px", [(0.0, 0.0), (4.0, 5.0), (-6.0, 4.0)])
def test_a_point_beside_a_round_spot_is_taken_at_its_middle(beside_px: tuple[float, float], tmp_path: Path) -> None:
    made = film(moving=[spotted()], angle_deg=lambda t: 90.0 * np.cos(3.0 * t), frames=50)
    places = (np.array(points(made, 1)) + beside_px).tolist()
    error, result = tracked(made, tmp_path / "film.mp4", {"moving": places}, codec="libx264")
    assert np.isfinite(error).all()
    assert not doubts(result)
    # Each point is off by less than a fifth of a pixel.
    assert np.abs(error - np.median(error)).max() < np.rad2deg(np.sqrt(2.0) * 0.2 / (OUTER - INNER))


def test_two_points_on_one_round_spot_are_refused(tmp_path: Path) -> None:
    made = film(moving=[spotted()], angle_deg=lambda t: 90.0 + 0.0 * t, frames=5)
    inner = points(made, 1)[0]
    with pytest.raises(NoResultError, match="shows the same round spot as the stick's inner marker"):
        tracked(made, tmp_path / "film.mkv", {"moving": [inner, [inner[0] + 3.0, inner[1] + 2.0]]})


def test_points_on_the_wall_behind_the_stick_may_lie_on_both_sides_of_it(tmp_path: Path) -> None:
    wall = Sprite(texture_picture(np.random.default_rng(1), 400, 560), along_mm=0.0, width_mm=316.0)
    made = film(base=[wall], angle_deg=lambda t: 60.0 + 250.0 * t, frames=50)
    around = [made.on_stick(0, 60.0, along).tolist() for along in (-120.0, 130.0)]
    error, _ = tracked(made, tmp_path / "film.mp4", {"base": around}, codec="libx264")
    assert np.isfinite(error).all()
    # Each point is off by less than a fifth of a pixel.
    assert np.abs(error - np.median(error)).max() < np.rad2deg(np.sqrt(2.0) * 0.2 / (OUTER - INNER))


def test_a_point_on_the_other_stick_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoResultError, match="base, inner marker: lies on the other stick"):
        tracked(film(angle_deg=lambda t: 20.0 + 60.0 * t, frames=3), tmp_path / "film.mkv")


class Blank(FlatFilm):
    """From frame 20 on the moving stick shows nothing but one grey level, with the same rim."""

    level = 150.0

    def _sharp(self, ground: np.ndarray, angle_deg: float, number: int) -> np.ndarray:
        textured = self.moving
        if number >= 20:
            self.moving = [
                Sprite(np.full_like(one.picture, self.level), one.along_mm, one.width_mm) for one in textured
            ]
        fine = super()._sharp(ground, angle_deg, number)
        self.moving = textured
        return fine


class Glaring(Blank):
    """The grey level is that of a lamp."""

    level = 240.0


@pytest.mark.parametrize(
    ("film_of", "cause", "words"),
    [(Blank, "texture", "the texture around a marker was lost"), (Glaring, "glare", "light glares on the markers")],
)
def test_texture_that_is_lost_gives_no_angle_and_is_named_as_the_cause(
    film_of: type[FlatFilm], cause: str, words: str, tmp_path: Path
) -> None:
    made = film_of([textured(1)], [textured(2)], lambda t: 60.0 + 60.0 * t, frames=50)
    path = made.write(tmp_path / "film.mp4", codec="libx264")
    source = open_source(path)
    given = {"kind": "texture", "base": points(made, 0), "moving": points(made, 1)}
    result = track_film(source, markers=read_markers(given))
    orientation = orient(result.tracks, None)
    assert orientation.angles.valid.tolist() == [True] * 20 + [False] * 30
    told = account(result, orientation, doubts=doubts(result), pictures=source.pictures)
    assert next(iter(told["frames"]["causes"])) == cause
    assert any(words in text for text in told["advice"])


class Rolling(FlatFilm):
    """The moving stick's axis goes along by 2 mm per frame."""

    def _sharp(self, ground: np.ndarray, angle_deg: float, number: int) -> np.ndarray:
        still = self.moving
        turn = np.deg2rad(self.base_deg + angle_deg)
        away = 2.0 * number * np.array([np.cos(turn), -np.sin(turn)])
        self.moving = [replace(one, along_mm=one.along_mm + float(away[0]), across_mm=float(away[1])) for one in still]
        fine = super()._sharp(ground, angle_deg, number)
        self.moving = still
        return fine


@pytest.mark.parametrize("kind", [FlatFilm, Rolling])
def test_an_axis_that_moves_is_told(kind: type[FlatFilm], tmp_path: Path) -> None:
    made = kind([textured(1)], [textured(2)], lambda t: 60.0 + 400.0 * t, frames=40, size=(480, 320))
    _, result = tracked(made, tmp_path / "film.mkv")
    assert result.tracks.valid[:, 2:].all(axis=1).mean() > 0.5
    assert any("a fixed axis" in text for text in doubts(result)) == (kind is Rolling)


ALIGN = """
import sys
import numpy as np
from tracker.patches.align import Patch
from tracker.patches.warps import similarity

y, x = np.mgrid[:60, :60]
luma = np.rint(127 + 100 * np.sin(x / 3) * np.cos(y / 4)).astype(np.uint8)
patch = Patch(lambda u, v: np.sin((u + 30) / 3) * np.cos((v + 30) / 4), half_px=10.0)
fit = patch.align(luma, similarity(30.4, 29.7))
np.testing.assert_allclose(fit.warp[:2, 2], 30.0, atol=0.01)
print([name for name in sys.modules if name.startswith("scipy.linalg")])
"""


def test_a_patch_is_followed_without_the_whole_of_scipy_linalg() -> None:
    # Numba's own inverse of a matrix imports it: a tenth of a second of CPU before a film of tags or texture begins.
    done = subprocess.run([sys.executable, "-c", ALIGN], capture_output=True, text=True, check=True)
    assert done.stdout.strip() in ("[]", "['scipy.linalg.cython_blas']")
