"""Instants at which a motion passes an angle, and lags in two stages, against closed forms and a stepwise oracle."""

import numpy as np
import pytest

from sync import estimate_clock
from sync.signals.changepoints import lagged_decay, lagged_ramp
from sync.signals.strokes import crossing_time
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG
from torsight.synthetic.experiment import log_columns, play_scene
from torsight.synthetic.scene import demo_scene

NOISE_RAD = 0.012 * DEG


def onset(time_s, begin_s):
    """Return a way that starts at once with 40 degrees per second, and slows down."""
    return 40.0 * DEG * 3.0 * (1.0 - np.exp(-np.maximum(time_s - begin_s, 0.0) / 3.0))


def when(level_rad, begin_s):
    return begin_s - 3.0 * np.log(1.0 - level_rad / (120.0 * DEG))


@pytest.mark.parametrize("fps", [15.0, 60.0])
def test_errors_are_what_their_sigmas_say(fps):
    rng = np.random.default_rng(8)
    misses, errors = [], []
    for _ in range(150):
        begin_s = float(rng.uniform(1.0, 1.0 + 1.0 / fps))
        time_s = np.arange(0.0, 6.0, 1.0 / fps)
        way = onset(time_s, begin_s) + NOISE_RAD * rng.standard_normal(len(time_s))
        level_rad = float(rng.uniform(8.0, 80.0)) * DEG
        true_s = when(level_rad, begin_s)
        near_s = true_s + float(rng.uniform(-0.4, 0.4)) / fps
        at_s, sigma_s = crossing_time(time_s, way, level_rad, near_s=near_s, noise_rad=NOISE_RAD)
        errors.append(abs(at_s - true_s))
        misses.append(abs(at_s - true_s) / sigma_s)
    assert np.mean(np.array(misses) < 3.0) > 0.97
    # Away from the onset, a few thousandths of a frame.
    assert np.median(errors) < 0.02 / fps


def test_an_onset_within_a_frame_is_known_to_be_unsure():
    time_s = np.arange(0.0, 4.0, 1.0 / 15.0)
    begin_s = 1.03
    at_s, sigma_s = crossing_time(time_s, onset(time_s, begin_s), 0.4 * DEG, near_s=1.05, noise_rad=NOISE_RAD)
    assert sigma_s > 0.005
    assert abs(at_s - when(0.4 * DEG, begin_s)) < 3.0 * sigma_s


def test_where_nothing_passes_there_is_no_instant():
    time_s = np.arange(0.0, 4.0, 0.1)
    for way, near_s in ((np.zeros(40), 2.0), (-time_s, 2.0), (time_s, 0.0)):
        assert np.isnan(crossing_time(time_s, way, 0.5, near_s=near_s, noise_rad=1e-4)).all()


@pytest.mark.parametrize(("lag_s", "split"), [(4.0, 0.0), (5.0, 0.2), (6.0, 0.45)])
def test_lags_in_two_stages_as_stepped_through(lag_s, split):
    step_s = 1e-3
    time_s = np.arange(0.0, 40.0, step_s)
    for closed, wire in (
        (lagged_ramp(time_s, lag_s, split), time_s),
        (lagged_decay(time_s, 25.0, lag_s, split), 1.0 - np.exp(-time_s / 25.0)),
    ):
        seen = wire
        for stage_s in ((1.0 - split) * lag_s, split * lag_s):
            if stage_s == 0.0:
                continue
            out, follower = np.empty_like(seen), 0.0
            for index, value in enumerate(seen.tolist()):
                follower += step_s / stage_s * (value - follower)
                out[index] = follower
            seen = out
        # Euler's rule is late or early by half a step.
        assert np.max(np.abs(closed - seen)) < 2.0 * step_s


def test_the_demo_rig_tells_its_offset():
    scene = demo_scene()
    played = play_scene(scene)
    time_s = np.arange(0.0, played.duration_s, 1.0 / scene.film.fps)
    noise = np.random.default_rng(2).standard_normal(len(time_s)) * 0.015 * DEG
    count = len(time_s)
    everywhere = np.ones(count, dtype=bool)
    angle_rad = played.stick_angle(time_s) + noise
    angles = StickAngles(np.arange(count), time_s, angle_rad, np.full(count, 0.015 * DEG), everywhere, everywhere)
    columns = log_columns(played)
    log = TemperatureLog(**{name: columns[name] for name in ("time_s", "temp_a_c", "temp_b_c", "heat_a", "heat_b")})
    clock = estimate_clock(angles, log)
    assert clock.offset_ci95_s[0] <= scene.log.offset_s <= clock.offset_ci95_s[1]
    assert clock.drift_ci95_ppm[0] <= scene.log.drift_ppm <= clock.drift_ci95_ppm[1]
    # Heating rates of 0.98 to 1.38 °C/s and thresholds that repeat to some 0.005 °C: 0.005 / 0.2 s of one level.
    assert abs(clock.offset_s - scene.log.offset_s) < 0.05
    assert clock.offset_ci95_s[1] - clock.offset_ci95_s[0] < 0.4
