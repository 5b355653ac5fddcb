"""Errors at rest and in motion: a codec repeats a still picture, so that rest does not show how wrong positions are.

Positions are made by projection, with the errors that compression makes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.tracker.films import Rig
from torsight.core.optics.camera import read_camera
from torsight.core.tracks import MarkerTracks
from tracker.angle.length_noise import in_motion
from tracker.angle.orient import orient
from tracker.angle.stereo import orient_pair

WHITE_PX = 0.005
"""What the fits say of themselves."""
REST_S = 12.0
RIG = Rig(
    lambda t: 40.0 + 90.0 * (1.0 - np.cos(2.0 * np.pi * np.maximum(t - REST_S, 0.0) / 8.0)),
    frames=600,
    size=(640, 480),
    base_px=(55.0, 140.0),
    moving_px=(50.0, 120.0),
)
RESTS = RIG.times < REST_S


def compressed(rig: Rig, *, times_white: float, seed: int = 0) -> MarkerTracks:
    """Errors anew in every frame of motion, kept while a stick stands still, and a little left of what is new there."""
    rng = np.random.default_rng(seed)
    position = rig.marker_px(rig.truth_deg)
    n = len(position)
    error = times_white * WHITE_PX * rng.normal(size=position.shape)
    error[:, :2] = WHITE_PX * rng.normal(size=(1, 2, 2))
    error[RESTS, 2:] = WHITE_PX * rng.normal(size=(1, 2, 2))
    error += 0.2 * WHITE_PX * rng.normal(size=position.shape)
    return MarkerTracks(
        frame=np.arange(n),
        time_s=rig.times,
        position_px=position + error,
        covariance_px2=np.broadcast_to(WHITE_PX**2 * np.eye(2), (n, 4, 2, 2)).copy(),
        valid=np.ones((n, 4), bool),
        size_px=rig.size,
    )


@pytest.mark.parametrize("times_white", [1.0, 4.0, 10.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_rest_with_frozen_noise_says_nothing_of_motion(times_white: float, seed: int) -> None:
    found = orient(compressed(RIG, times_white=times_white, seed=seed), None)
    angles = found.angles
    assert angles.valid.all()
    error = np.rad2deg(angles.angle_rad) - RIG.truth_deg
    ratio = np.abs(error) / np.rad2deg(angles.sigma_rad)
    assert 0.6 < np.sqrt(np.mean(ratio[~RESTS] ** 2)) < 1.3
    assert ratio.max() < 5.0
    # What is not known of rest keeps its error from being understated, but motion's is not blamed on it.
    assert np.sqrt(np.mean(ratio[RESTS] ** 2)) < 1.6
    if times_white > 3.0:
        assert found.error_scale[~RESTS, 1].mean() == pytest.approx(times_white, rel=0.2)
        assert np.median(angles.sigma_rad[RESTS]) < 0.7 * np.median(angles.sigma_rad[~RESTS])


def test_a_few_fits_that_know_little_take_nothing_from_the_others_errors() -> None:
    # A fast stick now and then: its smeared markers are read better than their fits dare to say.
    tracks = compressed(RIG, times_white=4.0)
    smeared = np.arange(len(RESTS)) % 10 == 0
    tracks.covariance_px2[smeared, 2:] *= 50.0**2
    found = orient(tracks, None)
    free = ~RESTS & ~smeared
    assert found.error_scale[free, 1].mean() == pytest.approx(4.0, rel=0.2)
    error = np.rad2deg(found.angles.angle_rad) - RIG.truth_deg
    assert 0.6 < np.sqrt(np.mean((error / np.rad2deg(found.angles.sigma_rad))[free] ** 2)) < 1.3


def test_a_wrong_place_is_refused_at_rest_as_in_motion() -> None:
    tracks = compressed(RIG, times_white=4.0)
    wrong = [100, 101, 420, 500]
    stick = tracks.position_px[:, 3] - tracks.position_px[:, 2]
    tracks.position_px[wrong, 3] += 0.03 * stick[wrong]
    angles = orient(tracks, None).angles
    assert np.flatnonzero(~angles.valid).tolist() == wrong


def test_in_two_films_frozen_noise_refuses_no_marker(tmp_path: Path) -> None:
    left = replace(RIG, tilt_deg=(13.0, -7.0), distance=1200.0)
    right = replace(left, tilt_deg=(10.0, 14.0))
    (tmp_path / "pair.toml").write_text(left.pair_toml(right))
    both = [compressed(rig, times_white=10.0, seed=seed) for seed, rig in enumerate((left, right))]
    found = orient_pair(both[0], both[1], read_camera(tmp_path / "pair.toml"))
    assert found.angles.valid.all()
    assert found.position_mm is not None
    assert np.isfinite(found.position_mm).all()


def test_motion_is_told_from_rest() -> None:
    moves = in_motion(compressed(RIG, times_white=4.0).position_px[:, 2:])
    begins = int(np.flatnonzero(moves)[0])
    assert abs(begins - np.count_nonzero(RESTS)) <= 3
    # Where the motion turns round it does not rest.
    assert moves[begins:].all()
    assert not in_motion(np.zeros((40, 2, 2))).any()
    assert in_motion(np.full((40, 2, 2), np.nan)).all()
    assert in_motion(np.zeros((0, 2, 2))).shape == (0,)
