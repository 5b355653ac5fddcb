"""The angle from positions: with a lens and a pose, with a lens alone, and with neither.

Positions are made by projection, not from pictures: what is tested is the geometry and the sigma.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tracker.films import Rig
from torsight.core.optics.camera import Camera, read_camera
from torsight.core.tracks import MarkerTracks
from tracker.angle.orient import orient

SIGMA_PX = 0.02
TILTED = Rig(
    lambda t: 60.0 + 200.0 * (np.cos(t) - 1.0),
    frames=400,
    fps=60.0,
    size=(640, 480),
    base_px=(55.0, 140.0),
    moving_px=(50.0, 120.0),
    tilt_deg=(13.0, -7.0),
    distance=1200.0,
    k1=-0.15,
)


def tracks_of(rig: Rig, *, seed: int = 0, angle_deg: np.ndarray | None = None) -> MarkerTracks:
    """Exact projections and noise of known size."""
    angles = rig.truth_deg if angle_deg is None else angle_deg
    position = rig.marker_px(angles)
    position += np.random.default_rng(seed).normal(0.0, SIGMA_PX, position.shape)
    n = len(angles)
    return MarkerTracks(
        frame=np.arange(n),
        time_s=rig.times,
        position_px=position,
        covariance_px2=np.broadcast_to(SIGMA_PX**2 * np.eye(2), (n, 4, 2, 2)).copy(),
        valid=np.ones((n, 4), bool),
        size_px=rig.size,
    )


def camera_of(rig: Rig, folder: Path, *, pose: bool = True) -> Camera:
    (folder / "camera.toml").write_text(rig.camera_toml())
    camera = read_camera(folder / "camera.toml")
    return camera if pose else replace(camera, pose=None)


def check(rig: Rig, angles, *, factor: float = 1.0) -> None:
    error = np.rad2deg(angles.angle_rad) - rig.truth_deg
    sigma = np.rad2deg(angles.sigma_rad)
    bound = np.rad2deg(np.sqrt(2.0) * SIGMA_PX / (rig.moving_px[1] - rig.moving_px[0]))
    assert angles.valid.all()
    assert np.sqrt(np.mean(error**2)) < 1.5 * factor * bound
    assert 0.7 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.4


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (13.0, -7.0), (-25.0, 18.0)])
def test_a_known_camera(tmp_path: Path, tilt: tuple[float, float]) -> None:
    rig = replace(TILTED, tilt_deg=tilt)
    # Foreshortening by cos 31° makes the same pixels a larger angle.
    check(rig, orient(tracks_of(rig), camera_of(rig, tmp_path)).angles, factor=1.25)


def test_a_lens_without_a_pose_finds_the_axis(tmp_path: Path) -> None:
    found = orient(tracks_of(TILTED), camera_of(TILTED, tmp_path, pose=False))
    check(TILTED, found.angles, factor=1.3)
    assert found.report["tilt"]["tilt_deg"] == pytest.approx(14.7, abs=1.0)


def test_without_a_camera_the_ellipses_tell_the_tilt() -> None:
    found = orient(tracks_of(TILTED), None)
    check(TILTED, found.angles, factor=1.5)
    assert found.report["tilt"]["known"]
    assert found.report["tilt"]["tilt_deg"] == pytest.approx(14.7, abs=1.5)


def test_without_a_camera_and_with_little_motion_the_sigma_says_so() -> None:
    rig = replace(TILTED, angle_deg=lambda t: 100.0 + 3.0 * np.sin(t))
    found = orient(tracks_of(rig), None)
    error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
    sigma = np.rad2deg(found.angles.sigma_rad)
    assert not found.report["tilt"]["known"]
    assert found.report["tilt"]["error_it_can_make_deg"] > 0.3
    # The tilt shifts all angles alike, by up to ψ²/4 · 2 = 1.9°, and two sigmas hold that.
    assert np.abs(error).max() > 0.1
    assert (np.abs(error) < 3.0 * sigma).all()


@pytest.mark.parametrize("range_deg", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("angle_deg", [-100.0, 30.0, 70.0, 110.0])
def test_a_tilt_that_is_not_known_is_not_taken_out(angle_deg: float, range_deg: float) -> None:
    rig = replace(TILTED, tilt_deg=(0.0, 0.0), k1=0.0, angle_deg=lambda t: angle_deg + 0.5 * range_deg * np.sin(t))
    tracks = tracks_of(rig)
    found = orient(tracks, None)
    assert not found.report["tilt"]["known"]
    assert found.report["tilt"]["tilt_deg"] is None
    base, moving = (tracks.position_px[:, i + 1] - tracks.position_px[:, i] for i in (0, 2))
    still = np.mean(base, axis=0)
    plain = np.arctan2(-moving[:, 1], moving[:, 0]) - np.arctan2(-still[1], still[0])
    away = np.angle(np.exp(1j * (found.angles.angle_rad - plain)))
    # The base's direction is averaged over the film: both averages of it differ by less than one frame's noise.
    assert np.abs(away).max() < SIGMA_PX / 85.0
    # A tilt of 20 degrees, which nothing speaks against, makes up to 1.8.
    assert (np.rad2deg(found.angles.sigma_rad) > 0.9).all()


def test_a_tilt_is_taken_out_as_far_as_the_motion_tells_it() -> None:
    shares = []
    for range_deg in (2.0, 12.0, 60.0):
        rig = replace(TILTED, angle_deg=lambda t, wide=range_deg: 100.0 + 0.5 * wide * np.sin(t))
        found = orient(tracks_of(rig), None)
        told = found.report["tilt"]
        shares.append(told["share_taken_out"])
        assert told["known"] == (told["share_taken_out"] > 0.0)
        error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
        assert (np.abs(error) < 3.0 * np.rad2deg(found.angles.sigma_rad)).all()
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def hanging(angle_deg: np.ndarray, size_px: float, rng: np.random.Generator) -> np.ndarray:
    """Errors of the four markers that follow the stick's direction, as compression and a stick's edges make them."""
    turn = np.deg2rad(angle_deg)
    apart = np.abs(np.angle(np.exp(1j * (turn[:, None] - turn[None, :]))))
    factor = np.linalg.cholesky(np.exp(-apart / 0.4) + 1e-6 * np.eye(len(turn)))
    return size_px * np.einsum("ij,jmk->imk", factor, rng.normal(size=(len(turn), 4, 2)))


@pytest.mark.parametrize("tilt_deg", [0.0, 2.0, 5.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("range_deg", [400.0, 110.0])
def test_tilt_from_the_paths_is_as_sure_as_it_may_be(tilt_deg: float, range_deg: float) -> None:
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng([seed, round(tilt_deg), round(range_deg)])
        start, side = rng.uniform(-180.0, 180.0), rng.uniform(0.0, 2.0 * np.pi)
        rig = Rig(
            lambda t, start=start: start + 0.5 * range_deg * (np.cos(2.0 * t) - 1.0),
            frames=120,
            fps=40.0,
            size=(640, 480),
            base_deg=float(rng.uniform(0.0, 360.0)),
            base_px=(55.0, 140.0),
            moving_px=(50.0, 125.0),
            tilt_deg=(tilt_deg * np.cos(side), tilt_deg * np.sin(side)),
            distance=float(rng.choice([700.0, 1500.0])),
            k1=float(rng.choice([0.0, -0.1])),
            centre=(319.5 + float(rng.uniform(-30.0, 30.0)), 239.5 + float(rng.uniform(-30.0, 30.0))),
        )
        tracks = tracks_of(rig, seed=seed)
        found = orient(
            replace(tracks, position_px=tracks.position_px + hanging(rig.truth_deg, 0.02 * (seed % 2), rng)), None
        )
        error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
        error -= 360.0 * np.round(np.median(error) / 360.0)
        ratios.append(float(np.sqrt(np.mean((error / np.rad2deg(found.angles.sigma_rad)) ** 2))))
        if range_deg > 360.0:
            assert found.report["tilt"]["known"]
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.4
    assert max(ratios) < 2.0


def test_no_tilt_is_taken_out_where_there_is_none() -> None:
    rig = replace(TILTED, tilt_deg=(0.0, 0.0), k1=0.0)
    tracks = tracks_of(rig)
    found = orient(tracks, None)
    plain = np.unwrap([np.arctan2(-(p[3] - p[2])[1], (p[3] - p[2])[0]) for p in tracks.position_px])
    change = np.rad2deg(found.angles.angle_rad - plain)
    assert np.abs(change - np.median(change)).max() < 0.02
    assert found.report["tilt"]["tilt_deg"] < 1.5


def test_pixels_that_are_not_square() -> None:
    rig = replace(TILTED, tilt_deg=(0.0, 0.0), k1=0.0)
    tracks = tracks_of(rig)
    squeezed = replace(tracks, position_px=tracks.position_px * [0.5, 1.0], size_px=(320, 480))
    check(rig, orient(squeezed, None, pixel_aspect=2.0).angles, factor=2.0)


@pytest.mark.parametrize("seed", range(4))
def test_markers_that_lag_behind_are_no_tilt(seed: int) -> None:
    """A camera that averages noise over frames keeps back what moves, by about as much at any speed."""
    rng, n = np.random.default_rng(seed), 300
    # Heated and cooled: fast at first, slower and slower, so that each end is reached one way round only.
    stroke, heats = np.exp(-(np.arange(n) % 100) / 30.0), np.arange(n) // 100 % 2 == 0
    turn = 90.0 * seed + 100.0 * np.where(heats, 1.0 - stroke, stroke)
    rig = replace(TILTED, frames=n, angle_deg=lambda _: turn, tilt_deg=(0.0, 0.0), k1=0.0)
    tracks = tracks_of(rig, seed=seed)
    way = np.where(heats, 1.0, -1.0)[:, None] * rng.uniform(0.5, 1.0, (n, 2))
    heading = np.deg2rad(rig.base_deg + rig.truth_deg)
    back = 0.2 * way[..., None] * np.stack([np.sin(heading), np.cos(heading)], axis=1)[:, None]
    position = tracks.position_px.copy()
    position[:, 2:] += back
    found = orient(replace(tracks, position_px=position), None)
    error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
    error -= 360.0 * np.round(np.median(error) / 360.0)
    assert np.sqrt(np.mean((error / np.rad2deg(found.angles.sigma_rad)) ** 2)) < 1.4


@pytest.mark.parametrize(("inner_px", "least"), [(50.0, 0.7), (0.3, 0.6)])
def test_an_axis_with_play_turns_no_stick(inner_px: float, least: float) -> None:
    """What moves both markers alike is no error of the angle, also where one of them lies on the axis.

    Such a one does not tell which rows are late, and the sigma holds that, too.
    """
    rig = replace(TILTED, moving_px=(inner_px, inner_px + 70.0), tilt_deg=(0.0, 0.0), k1=0.0)
    tracks = tracks_of(rig)
    position = tracks.position_px.copy()
    position[:, 2:] += np.random.default_rng(3).normal(0.0, 0.2, (len(tracks), 1, 2))
    angles = orient(replace(tracks, position_px=position), None).angles
    error = np.rad2deg(angles.angle_rad) - rig.truth_deg
    assert least < np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad)) ** 2)) < 1.4


@pytest.mark.parametrize("seed", range(4))
def test_errors_along_the_motion_are_no_tilt(seed: int) -> None:
    """A codec's errors are larger along the motion than across it: over a short arc a map could exchange both."""
    rig = replace(TILTED, angle_deg=lambda t: 60.0 - 40.0 * seed + 2.0 * t, tilt_deg=(0.0, 0.0), k1=0.0)
    exact = rig.marker_px(rig.truth_deg)
    noise = np.random.default_rng(seed).normal(0.0, SIGMA_PX, exact.shape)
    turn = np.deg2rad(rig.truth_deg)
    outwards = np.stack([np.cos(turn), -np.sin(turn)], axis=1)[:, None]
    across = np.sum(noise[:, 2:] * outwards, axis=-1, keepdims=True)
    noise[:, 2:] -= 0.7 * across * outwards
    angles = orient(replace(tracks_of(rig), position_px=exact + noise), None).angles
    error, bound = np.rad2deg(angles.angle_rad) - rig.truth_deg, np.rad2deg(np.sqrt(2.0) * SIGMA_PX / 70.0)
    assert np.sqrt(np.mean(error**2)) < 1.5 * bound
    # What such an arc does not tell of a tilt is in the sigma.
    assert np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad)) ** 2)) < 1.0
