"""The angle from two films, against positions by projection: exact ones, and noise of known size.

What a frame's angle can be known to (Cramér and Rao's bound) comes from the rig's own projection, by small steps.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_orient import SIGMA_PX, TILTED, camera_of, check, tracks_of

from tests.tracker.films import Rig, write_pictures
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.files.storage import read_json
from torsight.core.optics.camera import Camera, read_camera
from torsight.core.optics.geometry import pixel_from_ray, ray_from_pixel
from torsight.core.tracks import MarkerTracks
from tracker.angle.orient import orient
from tracker.angle.plane import Orientation
from tracker.angle.stereo import orient_pair

RIGHT = replace(TILTED, tilt_deg=(10.0, 14.0))


def pair_of(left: Rig, right: Rig, folder: Path) -> Camera:
    (folder / "pair.toml").write_text(left.pair_toml(right))
    return read_camera(folder / "pair.toml")


def bound_rad(rigs: list[Rig], seen: np.ndarray | None = None) -> np.ndarray:
    """Return the least standard deviation (n,) of the stick's angle from markers ``seen`` (rigs, n, 2)."""
    step, information = 0.01, np.zeros(len(rigs[0].truth_deg))
    for number, rig in enumerate(rigs):
        ends = [rig.marker_px(rig.truth_deg + sign * step)[:, 2:] for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / np.deg2rad(2.0 * step)
        known = 1.0 if seen is None else seen[number]
        information += np.sum(known * np.sum(slope**2, axis=-1), axis=1) / SIGMA_PX**2
    return 1.0 / np.sqrt(information)


def errors_rad(found: Orientation, rig: Rig) -> np.ndarray:
    return np.asarray(found.angles.angle_rad - np.deg2rad(rig.truth_deg))


def hide(tracks: MarkerTracks, marker: int, frames: slice) -> MarkerTracks:
    position, valid = tracks.position_px.copy(), tracks.valid.copy()
    position[frames, marker], valid[frames, marker] = np.nan, False
    return replace(tracks, position_px=position, valid=valid)


@pytest.mark.parametrize("tilts", [((0.0, 0.0), (0.0, 12.0)), ((28.0, 0.0), (28.0, -12.0)), ((-40.0, 5.0), (0.0, 0.0))])
def test_projections_without_noise_give_the_exact_angle(tmp_path: Path, tilts) -> None:
    left, right = (replace(TILTED, angle_deg=lambda t: 60.0 - 170.0 * t, tilt_deg=tilt) for tilt in tilts)
    exact = [replace(t, position_px=rig.marker_px(rig.truth_deg)) for t, rig in
             ((tracks_of(left), left), (tracks_of(right), right))]  # fmt: skip
    found = orient_pair(*exact, pair_of(left, right, tmp_path))
    assert np.ptp(left.truth_deg) > 1000.0
    assert found.angles.valid.all()
    assert np.abs(errors_rad(found, left)).max() < 1e-8


@pytest.mark.parametrize("tilts", [((0.0, 0.0), (0.0, 12.0)), ((28.0, 0.0), (28.0, -12.0)), ((-40.0, 5.0), (0.0, 0.0))])
def test_noise_gives_the_least_error_that_it_can(tmp_path: Path, tilts) -> None:
    """One pair looks along the axis with a camera, one from aside with both, one with a camera each way."""
    left, right = (replace(TILTED, tilt_deg=tilt) for tilt in tilts)
    both = [tracks_of(left, seed=1), tracks_of(right, seed=2)]
    found = orient_pair(*both, pair_of(left, right, tmp_path))
    error, bound = errors_rad(found, left), bound_rad([left, right])
    # χ² of 400 frames, within four standard deviations.
    assert np.std(error / bound) == pytest.approx(1.0, abs=4.0 * np.sqrt(0.5 / 400.0))
    # The base's own direction is averaged over the film, at 0.02 px of noise on 85 px and 400 frames.
    assert abs(error.mean()) < 4.0 * SIGMA_PX / 85.0 * np.sqrt(2.0 / 400.0)
    # What all frames share is known as well as they know it together, give or take errors that hang together.
    assert (found.angles.sigma_rad > 0.85 * bound).all()
    assert 0.4 < np.sqrt(np.mean((error / found.angles.sigma_rad) ** 2)) < 1.1
    alone = [orient(tracks, camera_of(rig, tmp_path)) for tracks, rig in zip(both, (left, right), strict=True)]
    single = [np.sqrt(np.mean(errors_rad(one, rig) ** 2)) for one, rig in zip(alone, (left, right), strict=True)]
    assert np.sqrt(np.mean(error**2)) < 0.5 * min(single)


@pytest.mark.parametrize("range_deg", [400.0, 60.0, 4.0])
def test_two_films(tmp_path: Path, range_deg: float) -> None:
    left = replace(TILTED, angle_deg=lambda t: 60.0 + 0.5 * range_deg * (np.cos(t) - 1.0))
    right = replace(left, tilt_deg=(10.0, 14.0))
    camera = pair_of(left, right, tmp_path)
    found = orient_pair(tracks_of(left, seed=1), tracks_of(right, seed=2), camera)
    error, sigma = errors_rad(found, left), found.angles.sigma_rad
    if range_deg > 100.0:
        assert found.report["axis"]["tilt_deg"] == pytest.approx(14.7, abs=0.2)
    if range_deg < 30.0:
        check(left, found.angles)
    else:
        assert 0.3 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4
    assert found.position_mm is not None
    # Distances in space are those of the rig: noise of 0.02 px is 0.02 mm here, averaged over 400 frames.
    length = np.linalg.norm(found.position_mm[:, 1] - found.position_mm[:, 0], axis=1)
    assert length.mean() == pytest.approx(85.0, abs=0.02)
    scale = found.report["scale"]
    assert scale["complaints"] == []
    for name, known in (("base", 85.0), ("moving", 70.0)):
        assert scale["sticks"][name]["length_mm"] == pytest.approx(known, abs=0.03)
        assert 0.5 < scale["sticks"][name]["misfit"] < 2.0
    if range_deg > 30.0:
        height = found.position_mm[:, 2:, 2].mean() - found.position_mm[:, :2, 2].mean()
        assert height == pytest.approx(6.0, abs=0.1)


def test_a_wrong_scale_is_told(tmp_path: Path) -> None:
    tracks = tracks_of(TILTED, seed=1), tracks_of(RIGHT, seed=2)
    found = orient_pair(*tracks, pair_of(TILTED, RIGHT, tmp_path), known_mm={"base": 85.0, "moving": 72.0})
    assert any("disagree on the scale" in text for text in found.report["scale"]["complaints"])


def test_frames_that_one_film_lacks_have_the_angle_of_the_other(tmp_path: Path) -> None:
    right = replace(RIGHT, drop=(5, 6, 100, 250))
    found = orient_pair(tracks_of(TILTED, seed=1), tracks_of(right, seed=2), pair_of(TILTED, right, tmp_path))
    assert found.angles.valid.all()
    one = errors_rad(found, TILTED)[list(right.drop)]
    assert np.abs(one / bound_rad([TILTED])[list(right.drop)]).max() < 5.0


def test_a_marker_that_one_camera_sees_still_counts(tmp_path: Path) -> None:
    """In three stretches: one camera lost the outer marker; each lost another one; a single position is left."""
    lost = [(0, 3, slice(60, 100)), (0, 3, slice(150, 190)), (1, 2, slice(150, 190)), (0, 2, slice(240, 280)),
            (0, 3, slice(240, 280)), (1, 3, slice(240, 280))]  # fmt: skip
    tracks, seen = [tracks_of(TILTED, seed=3), tracks_of(RIGHT, seed=4)], np.ones((2, 400, 2))
    for film, marker, frames in lost:
        tracks[film] = hide(tracks[film], marker, frames)
        seen[film, frames, marker - 2] = 0.0
    found = orient_pair(*tracks, pair_of(TILTED, RIGHT, tmp_path))
    error, bound = errors_rad(found, TILTED), bound_rad([TILTED, RIGHT], seen)
    assert found.angles.valid.all()
    assert found.report["from_one_marker"] == 40
    for frames in (slice(60, 100), slice(150, 190), slice(240, 280)):
        assert np.sqrt(np.mean((error / bound)[frames] ** 2)) < 1.0 + 4.0 * np.sqrt(0.5 / 40.0)
        # The noise is learned from the sticks' lengths, to a few per cent.
        assert (found.angles.sigma_rad > 0.85 * bound)[frames].all()
    # A marker at 50 px from the axis tells far less than two at 50 and 120 px in two pictures.
    assert np.median(found.angles.sigma_rad[240:280]) > 3.0 * np.median(found.angles.sigma_rad[:60])


def test_a_position_that_was_misread_is_left_out(tmp_path: Path) -> None:
    tracks = [tracks_of(TILTED, seed=5), tracks_of(RIGHT, seed=6)]
    position = tracks[1].position_px.copy()
    position[200:206, 3] += [1.0, 0.5]
    tracks[1] = replace(tracks[1], position_px=position)
    found = orient_pair(*tracks, pair_of(TILTED, RIGHT, tmp_path))
    assert found.angles.valid.all()
    assert np.abs(errors_rad(found, TILTED) / found.angles.sigma_rad)[200:206].max() < 4.0


@pytest.mark.parametrize("film", [0, 1])
@pytest.mark.parametrize("motion", ["bump", "shake"])
def test_a_camera_that_moved_is_taken_out(tmp_path: Path, film: int, motion: str) -> None:
    camera = pair_of(TILTED, RIGHT, tmp_path)
    assert camera.right is not None
    tracks = [tracks_of(TILTED, seed=7), tracks_of(RIGHT, seed=8)]
    lens = (camera.intrinsics, camera.right.intrinsics)[film]
    late = np.arange(400)[:, None] > 160
    step = late * [9.0, -6.0] if motion == "bump" else np.random.default_rng(5).normal(0.0, 1.0, (400, 2))
    rays, _ = ray_from_pixel(tracks[film].position_px, lens)
    moved = pixel_from_ray(rays + (step / lens.matrix[0, 0])[:, None], lens)
    tracks[film] = replace(tracks[film], position_px=moved)
    found = orient_pair(*tracks, camera)
    error = errors_rad(found, TILTED)
    assert found.angles.valid.all()
    # Two cameras lose less by it than one has with nothing moved: its bound is from the stick's length alone.
    assert np.sqrt(np.mean(error**2)) < np.sqrt(2.0) * SIGMA_PX / 70.0
    assert np.sqrt(np.mean((error / found.angles.sigma_rad) ** 2)) < 1.4


def test_a_base_marker_that_comes_loose_turns_the_base(tmp_path: Path) -> None:
    """The outer marker of the base is 2 mm further on its circle from frame 200 on."""
    tracks = []
    for number, rig in enumerate((TILTED, RIGHT)):
        turned = replace(rig, base_deg=rig.base_deg + np.rad2deg(2.0 / 140.0))
        now = tracks_of(rig, seed=11 + number)
        moved = (turned.marker_px(rig.truth_deg) - rig.marker_px(rig.truth_deg))[:, 1]
        position = now.position_px.copy()
        position[200:, 1] += moved[200:]
        tracks.append(replace(now, position_px=position))
    found = orient_pair(*tracks, pair_of(TILTED, RIGHT, tmp_path))
    radii, turn = TILTED.base_px, 2.0 / 140.0
    base = np.arctan2(radii[1] * np.sin(turn), radii[1] * np.cos(turn) - radii[0])
    error = errors_rad(found, TILTED)
    assert np.abs(np.median(error[:190])) < 3e-4
    assert np.median(error[210:]) == pytest.approx(-base, abs=3e-4)


@pytest.mark.parametrize("order", [[2, 3, 0, 1], [1, 0, 2, 3]])
def test_markers_with_other_names_in_one_film_are_refused(tmp_path: Path, order: list[int]) -> None:
    right = tracks_of(RIGHT)
    right = replace(right, position_px=right.position_px[:, order])
    with pytest.raises(NoResultError, match="not the same point in both films"):
        orient_pair(tracks_of(TILTED), right, pair_of(TILTED, RIGHT, tmp_path))


def test_two_films_that_never_show_a_marker_at_once(tmp_path: Path) -> None:
    blind = hide(tracks_of(TILTED), 2, slice(None))
    with pytest.raises(NoResultError, match="moving inner"):
        orient_pair(blind, tracks_of(RIGHT), pair_of(TILTED, RIGHT, tmp_path))


def test_the_command_takes_two_films_and_tells_of_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from torsight.cli.track import track_to_folder

    left = Rig(lambda t: 100.0 - 140.0 * t, frames=24, tilt_deg=(6.0, -9.0), distance=500.0)
    right = replace(left, tilt_deg=(4.0, 12.0), seed=9)
    films = [write_pictures(rig, tmp_path / name) for name, rig in (("left", left), ("right", right))]
    (films[1] / "picture_00012.png").write_bytes(b"no picture")
    pair_of(left, right, tmp_path)
    angles = track_to_folder(films[0], right=films[1], camera=tmp_path / "pair.toml", fps=30.0, out=tmp_path / "out")
    error = np.rad2deg(angles.angle_rad) - left.truth_deg
    # The left film has the frame that the right one lacks.
    assert angles.valid.all()
    assert np.abs(error).max() < 0.1
    told = read_json(tmp_path / "out" / "track.json")
    assert f"warning: {films[1]}: The file is damaged" in capsys.readouterr().err
    assert any(text.startswith("Right film: The file is damaged") for text in told["advice"])
    assert any(event["kind"] == "damage" and event["text"].startswith("right film: ") for event in told["events"])
    with pytest.raises(ConfigError, match="second camera"):
        track_to_folder(films[0], right=films[1], fps=30.0, out=tmp_path / "out")
