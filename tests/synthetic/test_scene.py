"""Scene files: what is refused and how it is told, what is drawn from the seed."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from torsight.core.errors import ConfigError, InputError
from torsight.synthetic.experiment import log_columns, make_record, play_scene
from torsight.synthetic.keys import rule_of
from torsight.synthetic.rig.rig_values import UNCERTAINTY
from torsight.synthetic.scene import SECTIONS, demo_scene, read_scene, scene_from

ROOT = Path(__file__).parents[2]
QUICK = {"protocol": {"time_factor": 0.05}, "seed": 5}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"protocoll": {}}, "did you mean 'protocol'"),
        ({"film": {"fsp": 3}}, "did you mean 'fps'"),
        ({"effects": {"sensor_lagg": {}}}, "did you mean 'sensor_lag'"),
        ({"effects": {"sensor_lag": {"lag": 3.0}}}, "did you mean 'lag_s'"),
        ({"effects": {"sensor_lag": {"form": "third_order"}}}, "first_order, two_stage"),
        ({"film": {"fps": "many"}}, "'fps' is not a number"),
        ({"film": {"fps": 0.0}}, "allowed 0.1 to 1000"),
        ({"film": {"crf": 18.5}}, "whole number"),
        ({"camera": {"distortion": [0.1]}}, "5 numbers"),
        ({"camera": {"width_px": 641}}, "odd"),
        ({"sticks": {"inner_mm": 30.0, "outer_mm": 20.0}}, "in order"),
        ({"output": {"markers": 1}}, "true or false"),
        ({"event": [{"kind": "foot"}]}, "hand, wire"),
        ({"event": {"kind": "hand"}}, "[[event]]"),
        ({"protocol": {"half_cycle": [{"spring": "c"}]}}, "a, b"),
        ({"protocol": {"half_cycle": [{"spring": "a", "points": [[5, 20], [1, 80]]}]}}, "do not increase"),
        ({"protocol": {"half_cycle": [{"peak": 80.0, "spring": "a"}]}}, "did you mean 'peak_c'"),
        ({"actuator": {"material": {"E_A_gp": 60}}}, "did you mean 'E_A_gpa'"),
        ({"actuator": {"material": {"E_A_gpa": 10.0}}}, "'E_M_gpa' is not below 'E_A_gpa'"),
        ({"actuator": {"material": {"E_A_gpa": 60e9}}}, "give it in GPa"),
        ({"rig": {"true": {"A_s_c": 70.0}}}, "'A_f_c' is not above 'A_s_c'"),
    ],
)
def test_refusals_say_what_where_and_what_to_do(content: dict, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        scene_from(content, where="scene.toml")
    assert words in str(caught.value)
    assert "scene.toml" in str(caught.value) or "true values" in str(caught.value)


def test_missing_scene_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        read_scene(tmp_path / "none.toml")


def test_every_key_is_documented_and_in_bounds() -> None:
    for name, kind in SECTIONS.items():
        for key in fields(kind):
            assert rule_of(key).help, (name, key.name)


def test_true_values_differ_from_the_declared_ones_by_their_uncertainty() -> None:
    ratios = []
    for seed in range(40):
        scene = scene_from({}, seed=seed)
        declared = scene.declared.flat()
        ratios += [(scene.values.public[name] - declared[name]) / sigma for name, sigma in UNCERTAINTY.items()]
    # 360 standard normal numbers cut at 2.5: standard deviation 0.97 ± 0.04.
    assert np.std(ratios) == pytest.approx(0.97, abs=0.12)
    assert abs(np.mean(ratios)) < 3.0 / np.sqrt(len(ratios))


def test_values_that_are_set_leave_the_other_draws_alone() -> None:
    free, held = scene_from({"seed": 4}), scene_from({"seed": 4, "rig": {"true": {"E_M_gpa": 21.0}}})
    assert held.values.public["E_M_gpa"] == 21.0
    assert held.values.public["M_f_c"] == free.values.public["M_f_c"]
    exact = scene_from({"seed": 4, "rig": {"as_declared": True}})
    assert exact.values.public == exact.declared.flat()


def test_log_clock_is_the_declared_map() -> None:
    content = {**QUICK, "log": {"offset_s": -7.3, "drift_ppm": 120.0, "before_s": 3.0}}
    played = play_scene(scene_from(content))
    columns = log_columns(played)
    # The reading that stands at a stamp was taken at film time (stamp − offset) / (1 + drift).
    film_s = (columns["time_s"] + 7.3) / (1.0 + 120e-6)
    assert film_s[0] == pytest.approx(-3.0, abs=0.0151)
    switched = film_s[np.flatnonzero(columns["heat_a"])[0]]
    assert switched == pytest.approx(scene_from(content).protocol.rest_s, abs=0.0301)


def test_lost_rows_are_lost_at_random() -> None:
    whole, torn = (log_columns(play_scene(scene_from({**QUICK, "log": {"lost": share}}))) for share in (0.0, 0.2))
    share = len(torn["time_s"]) / len(whole["time_s"])
    assert share == pytest.approx(0.8, abs=4 * np.sqrt(0.16 / len(whole["time_s"])))
    assert set(torn["time_s"]) <= set(whole["time_s"])


def test_record_without_film_is_seeded_and_carries_the_stated_noise() -> None:
    first, again, other = (make_record(QUICK, seed=seed, rate_hz=8.0) for seed in (7, 7, 8))
    assert np.array_equal(first.table.angle_rad, again.table.angle_rad)
    assert not np.array_equal(first.table.temp_a_c, other.table.temp_a_c)
    noise = (first.table.angle_rad - first.angle_rad) / first.table.angle_sigma_rad
    assert np.std(noise) == pytest.approx(1.0, abs=4 / np.sqrt(2 * len(noise)))


def test_hidden_clock_offset_shifts_the_temperatures() -> None:
    fast = {**QUICK, "sensor": {"noise_c": 0.0, "quantum_c": 0.0}}
    plain = make_record(fast, rate_hz=20.0)
    late = make_record({**fast, "effects": {"clock_offset": {"offset_s": 0.5}}}, rate_hz=20.0)
    # What stands at film time t was read at t − 0.5.
    assert late.table.temp_a_c[10:] == pytest.approx(plain.table.temp_a_c[:-10], abs=1e-6)
    assert np.array_equal(late.angle_rad, plain.angle_rad)


def test_play_is_the_same_whenever_it_is_asked() -> None:
    motion = {"kind": "sweep", "start_deg": 60.0, "sweep_deg": 100.0, "period_s": 4.0, "duration_s": 10.0}
    played = play_scene(scene_from({"motion": motion, "effects": {"backlash": {"gap_deg": 6.0}}}))
    time_s = np.arange(0.0, 10.0, 1.0 / 30.0)
    lag_deg = np.rad2deg(played.actuator_angle(time_s) - played.stick_angle(time_s))
    assert np.allclose([played.stick_angle(time_s[i : i + 1])[0] for i in range(300)], played.stick_angle(time_s))
    # The stick is behind by half the play on each way, but for the way through the play at each end.
    behind = np.sign(np.sin(2.0 * np.pi * time_s / 4.0)) * -3.0
    assert np.mean(np.abs(lag_deg - behind) < 0.1) > 0.8
    assert np.abs(lag_deg).max() < 3.1


def test_demo_hides_an_effect_and_has_half_cycles_to_hold_out() -> None:
    scene = demo_scene()
    assert list(scene.effects)
    assert len(scene.protocol.half_cycles) >= 4
    assert scene.protocol.duration_s * scene.film.fps < 6000


def test_scenes_of_the_repository_can_be_read() -> None:
    found = sorted((ROOT / "fixtures" / "scenes").glob("*.toml"))
    assert len(found) >= 2
    for path in found:
        read_scene(path)
