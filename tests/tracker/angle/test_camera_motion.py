"""A camera that was moved: positions by projection, shifted and turned by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_orient import SIGMA_PX, TILTED, camera_of, check, tracks_of

from torsight.core.optics.geometry import pixel_from_ray, ray_from_pixel
from torsight.core.tracks import MarkerTracks
from tracker.angle.camera_motion import unmoved
from tracker.angle.orient import orient
from tracker.angle.reference_direction import steady_direction

STRAIGHT = replace(TILTED, tilt_deg=(0.0, 0.0), k1=0.0)
ASIDE = replace(TILTED, k1=0.0)
FRAMES = STRAIGHT.frames


def motion_px(kind: str) -> np.ndarray:
    """Return the shift of the picture in every frame."""
    part = np.linspace(0.0, 1.0, FRAMES)[:, None]
    late = part > 0.4
    return {
        "bump": late * [9.0, -6.0],
        "large bump": late * [-25.0, 17.0],
        "small bump": late * [2.0, 1.3],
        "sag": part * [1.0, 4.0],
        "shake": 1.5 * np.random.default_rng(5).normal(size=(FRAMES, 2)),
    }[kind]


def moved(tracks: MarkerTracks, shift_px: np.ndarray, roll_rad: np.ndarray | float = 0.0) -> MarkerTracks:
    """Return tracks of a camera that shifts, and rolls about the picture's middle."""
    turn = np.broadcast_to(roll_rad, FRAMES)
    middle = 0.5 * (np.array(tracks.size_px) - 1.0)
    away = tracks.position_px - middle
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    rolled = np.stack([cos * away[..., 0] - sin * away[..., 1], sin * away[..., 0] + cos * away[..., 1]], axis=-1)
    return replace(tracks, position_px=rolled + middle + shift_px[:, None])


@pytest.mark.parametrize("kind", ["bump", "large bump", "small bump", "sag", "shake"])
@pytest.mark.parametrize("rig", [STRAIGHT, ASIDE], ids=["straight", "aside"])
def test_a_moved_picture_is_no_tilt(kind: str, rig) -> None:
    still = tracks_of(rig)
    found = orient(moved(still, motion_px(kind)), None)
    check(rig, found.angles, factor=1.5)
    told, unshaken = found.report["tilt"], orient(still, None).report["tilt"]
    assert told["known"]
    assert told["tilt_deg"] == pytest.approx(unshaken["tilt_deg"], abs=1.0)
    # Nothing here is worse than the noise that was put in, so nothing may be laid at compression's door.
    assert max(found.report["noise"]["error_over_white_noise"].values()) < 1.3


@pytest.mark.parametrize("period_s", [3.0, 7.0])
@pytest.mark.parametrize("rig", [STRAIGHT, ASIDE], ids=["straight", "aside"])
def test_a_camera_that_comes_nearer_and_goes_back_makes_no_tilt(period_s: float, rig) -> None:
    still = tracks_of(rig)
    nearer = 1.0 + 0.01 * np.sin(2.0 * np.pi * still.time_s / period_s)
    middle = 0.5 * (np.array(still.size_px) - 1.0)
    grown = middle + (still.position_px - middle) * nearer[:, None, None]
    found = orient(replace(still, position_px=grown), None)
    check(rig, found.angles, factor=1.5)
    assert found.report["tilt"]["tilt_deg"] == pytest.approx(orient(still, None).report["tilt"]["tilt_deg"], abs=1.5)
    assert max(found.report["noise"]["error_over_white_noise"].values()) < 1.3


def test_a_camera_that_rolls_when_it_is_bumped() -> None:
    late = np.arange(FRAMES) > 150
    found = orient(moved(tracks_of(STRAIGHT), late[:, None] * [6.0, -3.0], late * np.deg2rad(0.8)), None)
    check(STRAIGHT, found.angles, factor=1.5)
    assert found.report["tilt"]["tilt_deg"] < 1.5


def test_a_camera_that_is_pushed_nearer_and_rolled_meanwhile_makes_no_tilt() -> None:
    # The base turns in the picture as it grows: its length follows its direction, and yet it is the camera's.
    still = tracks_of(STRAIGHT)
    part = np.clip(np.linspace(-0.5, 1.5, FRAMES), 0.0, 1.0)
    middle = 0.5 * (np.array(still.size_px) - 1.0)
    grown = middle + (still.position_px - middle) * (1.0 + 0.05 * part)[:, None, None]
    pushed = moved(replace(still, position_px=grown), part[:, None] * [8.0, 0.0], part * np.deg2rad(6.0))
    # Behind a hand it goes with the picture.
    behind = np.arange(FRAMES) % 40 < 6
    pushed.position_px[behind, :2], pushed.valid[behind, :2] = np.nan, False
    found = orient(pushed, None)
    check(STRAIGHT, found.angles, factor=1.5)
    assert found.report["tilt"]["tilt_deg"] < 1.5
    assert found.report["noise"]["error_over_white_noise"]["moving"] < 2.0


@pytest.mark.parametrize("kind", ["bump", "sag"])
@pytest.mark.parametrize("pose", [True, False])
def test_a_calibrated_camera_is_turned(tmp_path: Path, kind: str, *, pose: bool) -> None:
    camera = camera_of(TILTED, tmp_path, pose=pose)
    still = tracks_of(TILTED)
    rays, _ = ray_from_pixel(still.position_px, camera.intrinsics)
    step = motion_px(kind) / camera.intrinsics.matrix[0, 0]
    found = orient(replace(still, position_px=pixel_from_ray(rays + step[:, None], camera.intrinsics)), camera)
    check(TILTED, found.angles, factor=1.3)
    assert found.report["tilt"]["tilt_deg"] == pytest.approx(14.7, abs=1.0)


def test_pixels_that_are_not_square_are_moved_back_too() -> None:
    tracks = moved(tracks_of(STRAIGHT), motion_px("bump"))
    squeezed = replace(tracks, position_px=tracks.position_px * [0.5, 1.0], size_px=(320, 480))
    check(STRAIGHT, orient(squeezed, None, pixel_aspect=2.0).angles, factor=2.0)


def test_the_noise_of_a_base_at_rest_is_not_added() -> None:
    tracks = tracks_of(STRAIGHT)
    assert unmoved(tracks).tracks is tracks
    assert unmoved(tracks).paths is tracks


def test_one_marker_astray_is_no_motion_of_the_camera() -> None:
    tracks = tracks_of(STRAIGHT)
    position = tracks.position_px.copy()
    position[100:250, 0] += [0.6, -0.4]
    assert unmoved(replace(tracks, position_px=position)).tracks.position_px is position


def test_the_base_at_rest_is_averaged_between_bumps() -> None:
    shift = motion_px("bump")
    still = tracks_of(STRAIGHT)
    step = moved(still, shift).position_px[:, 2] - unmoved(moved(still, shift)).tracks.position_px[:, 2]
    off = step - shift
    off -= np.median(off, axis=0)
    # One frame's middle is known to SIGMA_PX / √2.
    assert np.sqrt(np.mean(off**2)) < 0.5 * SIGMA_PX / np.sqrt(2.0)


def test_noise_that_a_codec_freezes_until_the_next_key_frame_is_no_bump() -> None:
    sigma_rad = 1e-3
    # Two draws of noise, three standard deviations apart, each frozen for as long as the base rests.
    direction = np.repeat([0.0, 3.0 * sigma_rad], 60)
    direction[50:70] = np.nan
    steady, variance = steady_direction(direction, np.full(120, sigma_rad**2))
    assert np.isfinite(steady).all()
    assert (variance >= sigma_rad**2).all()


def test_a_bump_behind_a_hand_leaves_one_marker_alone_unsure() -> None:
    tracks = moved(tracks_of(STRAIGHT), motion_px("bump"))
    covered = slice(120, 200)
    position = tracks.position_px.copy()
    position[covered, :3] = np.nan
    found = unmoved(replace(tracks, position_px=position)).tracks
    # Somewhere between both places, 11 px apart: not known to better than that.
    assert (np.sqrt(found.covariance_px2[covered, 3, 0, 0]) > 5.0).all()
    assert np.array_equal(found.covariance_px2[:120], tracks.covariance_px2[:120])
    angles = orient(replace(tracks, position_px=position), None).angles
    assert not angles.valid[covered].any()


def test_a_hand_held_camera_makes_no_tilt_of_what_it_does_while_the_base_is_hidden() -> None:
    rig = replace(STRAIGHT, angle_deg=lambda t: 45.0 + 60.0 * np.sin(2.0 * np.pi * t / 3.0))
    # The moving stick turns back over the base: a quarter of the frames do not show it.
    hidden = np.abs(rig.truth_deg) < 14.0
    ratios: list[np.ndarray] = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        shake = np.zeros((FRAMES, 3))
        for frame in range(1, FRAMES):
            shake[frame] = 0.85 * shake[frame - 1] + np.sqrt(1.0 - 0.85**2) * rng.normal(size=3)
        tracks = moved(tracks_of(rig), 2.0 * shake[:, :2], 3e-3 * shake[:, 2])
        position, valid = tracks.position_px.copy(), tracks.valid.copy()
        position[hidden, :2], valid[hidden, :2] = np.nan, False
        found = orient(replace(tracks, position_px=position, valid=valid), None)
        assert found.angles.valid.all()
        assert found.report["tilt"]["known"]
        assert found.report["tilt"]["tilt_deg"] < 2.0
        assert not found.report["rolling_shutter"]["known"]
        ratios.append((np.rad2deg(found.angles.angle_rad) - rig.truth_deg) / np.rad2deg(found.angles.sigma_rad))
    assert np.sqrt(np.mean(np.square(ratios)[:, ~hidden])) < 1.2
    # One error and hardly more in each of the gaps, and three gaps in a film.
    assert np.sqrt(np.mean(np.square(ratios)[:, hidden])) < 1.4
