"""A rolling shutter is found from the markers' paths and taken out; where there is none nothing changes.

Every marker is projected at the instant at which its own row is read, found by iteration.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_orient import SIGMA_PX, TILTED, camera_of, check, tracks_of

from tests.tracker.films import Rig
from torsight.core.optics.camera import read_camera
from torsight.core.tracks import MarkerTracks
from tracker.angle.orient import orient
from tracker.angle.stereo import orient_pair

ROW_S = 15e-3 / 640
"""15 ms for the picture's width, of the 16.7 ms from one frame to the next."""


def swinging(time_s: np.ndarray) -> np.ndarray:
    return 60.0 + 100.0 * (np.cos(2.0 * time_s) - 1.0) + 12.0 * np.sin(5.0 * time_s)


SWINGS = replace(TILTED, angle_deg=swinging)
STRAIGHT = replace(SWINGS, tilt_deg=(0.0, 0.0), k1=0.0)


def rolled(rig: Rig, row_s: float, *, along: int, backwards: bool = False, seed: int = 0) -> MarkerTracks:
    """Return tracks of a picture that is read from the left (along 0) or the top (1), or from the other side."""
    last = rig.size[along] - 1
    position = rig.marker_px(rig.truth_deg)
    for _ in range(6):
        row = last - position[:, 2:, along] if backwards else position[:, 2:, along]
        angle = rig.angle_deg(rig.times[:, None] + row * row_s)
        for marker in (0, 1):
            position[:, 2 + marker] = rig.marker_px(angle[:, marker])[:, 2 + marker]
    noise = np.random.default_rng(seed).normal(0.0, SIGMA_PX, position.shape)
    return replace(tracks_of(rig), position_px=position + noise)


@pytest.mark.parametrize("along", [0, 1])
def test_one_that_the_paths_do_not_tell_is_in_the_sigma(along: int) -> None:
    """A marker on the axis is seen at one place whenever it is read: nothing shows which rows are late."""
    rig = replace(STRAIGHT, moving_px=(0.0, 120.0), angle_deg=lambda t: 60.0 + 130.0 * t + 6.0 * np.sin(3.0 * t))
    row_s = 0.5 * ROW_S
    found = orient(rolled(rig, row_s, along=along), None)
    assert not found.report["rolling_shutter"]["known"]
    # Late by the time to the axis' row at any angle, which is a matter of clocks.
    seen_s = rig.times + row_s * float(np.mean(rig.marker_px(rig.truth_deg)[:, 2, along]))
    error = np.rad2deg(found.angles.angle_rad) - rig.angle_deg(seen_s)
    assert np.sqrt(np.mean(error**2)) > 0.1
    assert np.sqrt(np.mean((error / np.rad2deg(found.angles.sigma_rad)) ** 2)) < 1.4


@pytest.mark.parametrize("camera", ["none", "lens", "pose"])
@pytest.mark.parametrize(("along", "onwards"), [(0, "right"), (0, "left"), (1, "down")])
def test_it_is_found_and_taken_out(tmp_path: Path, camera: str, along: int, onwards: str) -> None:
    tracks = rolled(SWINGS, ROW_S, along=along, backwards=onwards == "left")
    found = orient(tracks, None if camera == "none" else camera_of(SWINGS, tmp_path, pose=camera == "pose"))
    told = found.report["rolling_shutter"]
    assert told["rows_follow"] == onwards
    low, high = told["row_time_ci95_us"]
    # Three standard deviations, and they are small.
    assert abs(told["row_time_us"] - 1e6 * ROW_S) < 1.5 * (0.5 * (high - low))
    assert high - low < 0.2e6 * ROW_S
    error = np.rad2deg(found.angles.angle_rad) - SWINGS.truth_deg
    ratio = error / np.rad2deg(found.angles.sigma_rad)
    # The read-out's own error is alike in all frames and may be small: the sigma holds it then, too.
    assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.4
    assert np.sqrt(np.mean(error**2)) < 2.25 * np.rad2deg(np.sqrt(2.0) * SIGMA_PX / 70.0)


def test_left_in_it_would_be_the_largest_error() -> None:
    tracks = rolled(STRAIGHT, ROW_S, along=0)
    stick = tracks.position_px[:, 3] - tracks.position_px[:, 2]
    base = np.mean(tracks.position_px[:, 1] - tracks.position_px[:, 0], axis=0)
    plain = np.rad2deg(np.arctan2(-stick[:, 1], stick[:, 0]) - np.arctan2(-base[1], base[0]))
    error = (plain - STRAIGHT.truth_deg + 180.0) % 360.0 - 180.0
    # Half a picture's read-out at 200 degrees per second.
    assert np.abs(error).max() > 1.0


@pytest.mark.parametrize("rig", [STRAIGHT, SWINGS], ids=["straight", "tilted"])
def test_a_film_without_it_is_left_as_it_is(rig: Rig) -> None:
    for seed in range(12):
        found = orient(tracks_of(rig, seed=seed), None)
        told = found.report["rolling_shutter"]
        assert not told["known"]
        assert told["share_taken_out"] == 0.0
        check(rig, found.angles, factor=1.3)


def test_a_codec_that_carries_a_marker_on_is_no_rolling_shutter() -> None:
    rig = replace(STRAIGHT, angle_deg=lambda t: 110.0 + 100.0 * np.sin(1.5 * t))
    for seed in range(3):
        tracks = tracks_of(rig, seed=seed)
        # A hundredth of a pixel per pixel of motion, as x264 makes it at CRF 20: the inner marker lags alone.
        step = 0.01 * np.gradient(tracks.position_px[:, 2], axis=0)
        position = tracks.position_px.copy()
        position[:, 2] -= step
        found = orient(replace(tracks, position_px=position), None)
        error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
        assert np.sqrt(np.mean(np.square(error / np.rad2deg(found.angles.sigma_rad)))) < 1.4


@pytest.mark.parametrize(
    ("start_deg", "reach_deg", "tau_s", "fps"), [(20.0, 80.0, 1.3, 30.0), (50.0, 100.0, 1.0, 60.0)]
)
def test_a_lag_that_goes_with_the_speed_is_no_rolling_shutter(
    start_deg: float, reach_deg: float, tau_s: float, fps: float
) -> None:
    """A camera that averages over frames what changes little keeps back what is slow; what is faster it follows."""

    def angle_deg(t: np.ndarray) -> np.ndarray:
        # Heating and cooling, fast at first.
        left = np.exp(-(t % (3.3 * tau_s)) / tau_s)
        return start_deg + reach_deg * np.where(t // (3.3 * tau_s) % 2 == 0, 1.0 - left, left)

    rig = replace(STRAIGHT, frames=300, fps=fps, angle_deg=angle_deg)
    for seed in range(2):
        tracks = tracks_of(rig, seed=seed)
        step = np.gradient(rig.marker_px(rig.truth_deg)[:, 2:], axis=0)
        position = tracks.position_px.copy()
        position[:, 2:] -= 0.5 * step / (0.3 + np.sum(step**2, axis=-1, keepdims=True))
        found = orient(replace(tracks, position_px=position), None)
        assert not found.report["rolling_shutter"]["known"]
        error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
        assert np.sqrt(np.mean(np.square(error / np.rad2deg(found.angles.sigma_rad)))) < 1.4
        # What lags of 0.5 px make of a stick of 70 px where they are not alike.
        assert np.sqrt(np.mean(error**2)) < np.rad2deg(0.5 / 70.0)


@pytest.mark.parametrize("shift_px", [0.1, 0.2])
def test_smear_that_shifts_a_marker_along_its_way_is_no_rolling_shutter(shift_px: float) -> None:
    def angle_deg(t: np.ndarray) -> np.ndarray:
        # Heating and cooling: fast one way at one end, and the other way at the other.
        left = np.exp(-(t % 1.5) / 0.35)
        return 173.0 + 140.0 * np.where(t % 3.0 < 1.5, 1.0 - left, left)

    rig = replace(STRAIGHT, angle_deg=angle_deg, moving_px=(70.0, 100.0))
    for seed in range(3):
        tracks = tracks_of(rig, seed=seed)
        turn_deg = np.gradient(rig.truth_deg, rig.times)
        shift = np.square(turn_deg / np.abs(turn_deg).max())
        stick = tracks.position_px[:, 3] - tracks.position_px[:, 2]
        across = np.stack([stick[:, 1], -stick[:, 0]], axis=1) / 30.0
        position = tracks.position_px.copy()
        position[:, 3] += shift_px * across * shift[:, None]
        found = orient(replace(tracks, position_px=position), None)
        assert not found.report["rolling_shutter"]["known"]
        error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
        # What the shift itself makes, and noise.
        limit = np.rad2deg(np.hypot(shift_px / 30.0 * np.sqrt(np.mean(shift**2)), 1.5 * np.sqrt(2.0) * SIGMA_PX / 30.0))
        assert np.sqrt(np.mean(error**2)) < limit


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(
    "wave", [(70.0, 0.0, 1.0), (0.0, 4.0, 3.0), (0.0, 25.0, 0.4)], ids=["one way", "small", "slow"]
)
def test_motion_that_tells_it_less_well(along: int, wave: tuple[float, float, float]) -> None:
    speed, size, often = wave
    rig = replace(STRAIGHT, angle_deg=lambda t: 80.0 + speed * t + size * np.sin(often * t))
    found = orient(rolled(rig, 0.7 * ROW_S, along=along), None)
    error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
    # What is left is in the sigma, but for a delay that all rows have in common: the film's clock has that.
    basis = np.stack([np.ones_like(error), np.gradient(rig.truth_deg, rig.times)], axis=1)
    left = error - basis @ np.linalg.lstsq(basis, error, rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) < 1.2 * np.rad2deg(np.sqrt(2.0) * SIGMA_PX / 70.0) * 1.5
    ratio = error / np.rad2deg(found.angles.sigma_rad)
    assert np.sqrt(np.mean(ratio**2)) < 1.4
    told = found.report["rolling_shutter"]
    if told["known"]:
        low, high = told["row_time_ci95_us"]
        assert abs(told["row_time_us"] - 0.7e6 * ROW_S) < 0.75 * (high - low)


def test_frames_with_one_marker_and_none_are_corrected_too() -> None:
    tracks = rolled(STRAIGHT, ROW_S, along=0)
    position, valid = tracks.position_px.copy(), tracks.valid.copy()
    position[100:104, 3] = position[200:203, 2:] = np.nan
    valid[100:104, 3] = valid[200:203, 2:] = False
    angles = orient(replace(tracks, position_px=position, valid=valid), None).angles
    error = np.rad2deg(angles.angle_rad) - STRAIGHT.truth_deg
    assert np.flatnonzero(~angles.valid).tolist() == [200, 201, 202]
    ratio = error / np.rad2deg(angles.sigma_rad)
    assert np.abs(ratio[100:104]).max() < 4.0
    assert np.abs(ratio[[199, 203]]).max() < 4.0


def test_frames_that_share_a_timestamp_do_no_harm() -> None:
    tracks = rolled(STRAIGHT, ROW_S, along=0)
    time_s = tracks.time_s.copy()
    time_s[[50, 120, 121]] = time_s[[49, 119, 119]]
    angles = orient(replace(tracks, time_s=time_s), None).angles
    error = np.rad2deg(angles.angle_rad) - STRAIGHT.truth_deg
    right = np.setdiff1d(np.arange(len(error)), [49, 50, 51, 118, 119, 120, 121, 122])
    assert np.sqrt(np.mean((error / np.rad2deg(angles.sigma_rad))[right] ** 2)) < 1.4


@pytest.mark.parametrize("row_s", [(ROW_S, ROW_S), (ROW_S, 0.6 * ROW_S), (0.0, ROW_S)])
def test_each_film_of_a_pair_has_its_own(tmp_path: Path, row_s: tuple[float, float]) -> None:
    rigs = [replace(SWINGS, tilt_deg=tilt) for tilt in ((4.0, -8.0), (10.0, 14.0))]
    (tmp_path / "pair.toml").write_text(rigs[0].pair_toml(rigs[1]))
    films = [rolled(rig, rows, along=1, seed=seed) for seed, (rig, rows) in enumerate(zip(rigs, row_s, strict=True))]
    found = orient_pair(*films, read_camera(tmp_path / "pair.toml"))
    for name, rows in zip(("rolling_shutter", "rolling_shutter_right"), row_s, strict=True):
        told = found.report[name]
        assert told["known"] == (rows > 0.0)
        if rows:
            low, high = told["row_time_ci95_us"]
            assert abs(told["row_time_us"] - 1e6 * rows) < 1.5 * (0.5 * (high - low))
    error = np.rad2deg(found.angles.angle_rad - np.deg2rad(SWINGS.truth_deg))
    ratio = error / np.rad2deg(found.angles.sigma_rad)
    assert np.sqrt(np.mean(ratio**2)) < 1.3
    # Two cameras are better than one: its bound is the one of test_it_is_found_and_taken_out.
    assert np.sqrt(np.mean(error**2)) < 1.5 * np.rad2deg(np.sqrt(2.0) * SIGMA_PX / 70.0)


def test_a_stick_that_turns_far_between_two_frames_shows_the_same_row_time() -> None:
    """Up to 11 degrees per frame: the line through both markers has the direction of neither reading."""
    rig = replace(
        TILTED, frames=150, fps=30.0, moving_px=(125.0, 185.0), tilt_deg=(9.0, -8.0), k1=0.0,
        angle_deg=lambda t: 85.0 * (1.0 - np.cos(3.9 * t)),
    )  # fmt: skip
    found = orient(rolled(rig, ROW_S, along=1), None)
    told = found.report["rolling_shutter"]
    assert told["row_time_us"] == pytest.approx(1e6 * ROW_S, rel=0.01)
    error = np.rad2deg(found.angles.angle_rad) - rig.truth_deg
    assert np.sqrt(np.mean(np.square(error / np.rad2deg(found.angles.sigma_rad)))) < 1.4
