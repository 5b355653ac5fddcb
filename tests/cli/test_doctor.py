"""The doctor's figures against closed forms and films of known make, its verdicts, and the codes that it ends with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sync import LogReading, find_clock
from sync.clock.clock_priors import PRIORS
from tests.cli.bad_inputs import ACTUATOR, make_world
from tests.command_line import leave
from tests.tracker.films import Rig, write_film
from torsight.actuator.effects import load_effects
from torsight.actuator.spec import reference_spec
from torsight.cli.checkup import separable
from torsight.cli.checkup.examine import Filming, predict_clock
from torsight.cli.checkup.film_check import check_film
from torsight.cli.checkup.finding import Finding, exit_code, ordered, verdict
from torsight.cli.checkup.log import check_log, check_programme, driven_by
from torsight.cli.checkup.rig import distinct_rates, half_cycles_of, limits_of
from torsight.cli.doctor import verdict_lines
from torsight.core.errors import ConfigError, InputError
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.synthetic import make_record
from torsight.synthetic.scene import demo_scene

ROOM_C = 23.0


def ramp(
    time_s: np.ndarray, start_s: float, peak_c: float, rate_c_s: float, *, hold_c: float = 0.0, hold_s: float = 0.0
) -> np.ndarray:
    """Temperature that rises at a rate, with a hold on the way, and falls at the same rate."""
    corners = [(start_s, ROOM_C)]
    for target in (hold_c, peak_c) if hold_s else (peak_c,):
        corners.append((corners[-1][0] + (target - corners[-1][1]) / rate_c_s, target))
        if target == hold_c and hold_s:
            corners.append((corners[-1][0] + hold_s, target))
    corners.append((corners[-1][0] + (peak_c - ROOM_C) / rate_c_s, ROOM_C))
    times, temps = zip(*corners, strict=True)
    return np.interp(time_s, times, temps, left=ROOM_C, right=ROOM_C)


def write_log(path: Path, ramps: list[tuple[str, dict[str, float]]], *, length_s: float, step_s: float = 0.25) -> Path:
    time_s = np.arange(0.0, length_s, step_s)
    temps = {spring: np.full_like(time_s, ROOM_C) for spring in "ab"}
    for spring, about in ramps:
        temps[spring] = np.maximum(temps[spring], ramp(time_s, **about))
    columns = np.column_stack([time_s, temps["a"], temps["b"]])
    np.savetxt(path, columns, fmt="%.4f", delimiter=",", header="time_s,temp_a_c,temp_b_c", comments="")
    return path


def four(rates: tuple[float, float, float, float], *, peaks: tuple[float, ...] = (80.0,) * 4) -> list:
    """Four half-cycles, A and B in turn."""
    made, start_s = [], 30.0
    for spring, rate, peak in zip("abab", rates, peaks, strict=True):
        made.append((spring, {"start_s": start_s, "peak_c": peak, "rate_c_s": rate}))
        start_s += 2.0 * (peak - ROOM_C) / rate + 20.0
    return made


def test_the_temperatures_of_motion_are_those_of_the_reference_rig() -> None:
    limits = limits_of(reference_spec())
    assert limits is not None
    assert round(limits.onset_c, 1) == 47.6
    assert round(limits.full_c, 1) == 70.0
    assert round(limits.range_deg, 1) == 465.8
    assert round(limits.start_deg, 1) == 177.6


def test_half_cycles_and_rates_are_read_from_the_log(tmp_path: Path) -> None:
    programme = [
        ("a", {"start_s": 20.0, "peak_c": 80.0, "rate_c_s": 0.5}),
        ("b", {"start_s": 290.0, "peak_c": 62.0, "rate_c_s": 0.2, "hold_c": 55.0, "hold_s": 60.0}),
    ]
    check = check_log(write_log(tmp_path / "temps.csv", programme, length_s=800.0))
    assert check.reading is not None
    spec, limits = reference_spec(), limits_of(reference_spec())
    assert limits is not None
    cycles = half_cycles_of(driven_by(check.reading, spec, limits, where="log"), limits)
    assert [cycle.spring for cycle in cycles] == ["a", "b"]
    assert [cycle.peak_c for cycle in cycles] == pytest.approx([80.0, 62.0], abs=0.1)
    assert [cycle.rate_c_s for cycle in cycles] == pytest.approx([0.5, 0.2], rel=0.05)
    assert distinct_rates(cycles) == pytest.approx([0.2, 0.5], rel=0.05)


def test_one_rate_takes_up_a_clock_offset_and_a_lag_and_two_rates_show_both(tmp_path: Path) -> None:
    """On ramps of one slope a time shift is a shift of temperature, which the transformation temperatures take up."""
    slow = check_log(write_log(tmp_path / "slow.csv", four((0.2,) * 4), length_s=2500.0, step_s=0.5))
    both = check_log(write_log(tmp_path / "both.csv", four((0.2, 0.2, 0.6, 0.6)), length_s=1800.0, step_s=0.5))
    told_slow = check_programme(slow.reading, reference_spec(), where="slow")[1]["discovery"]
    told_both = check_programme(both.reading, reference_spec(), where="both")[1]["discovery"]
    assert "clock_offset" in told_slow["hidden"]
    assert {"clock_offset", "sensor_lag"} <= set(told_both["visible"])
    for name in ("clock_offset", "sensor_lag"):
        assert told_slow["left_deg"][name] < 0.25 * told_both["left_deg"][name]
    # the other spring stays at room temperature in both: it has nothing to transform
    assert "heat_crosstalk" in told_slow["hidden"]
    assert "heat_crosstalk" in told_both["hidden"]


def test_what_every_fit_has_takes_up_its_share_of_an_effect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = check_log(write_log(tmp_path / "log.csv", four((1.0,) * 4), length_s=560.0, step_s=1.0))

    def left_deg() -> dict[str, float]:
        return check_programme(log.reading, reference_spec(), where="log")[1]["discovery"]["left_deg"]

    beside = left_deg()
    # Two stay: of what is always fitted, they alone start at a value that changes the model.
    stay = tuple(load_effects()[name] for name in ("reference_state", "change_of_springs"))
    monkeypatch.setattr(separable, "always_fitted", lambda: stay)
    alone = left_deg()
    # Least squares over more columns leaves no more of anything.
    assert all(beside[name] <= left * (1.0 + 1e-6) for name, left in alone.items())
    assert any(beside[name] < 0.9 * left for name, left in alone.items())


def clock_told(log: Path, settings: dict[str, object], **about: object) -> tuple[Finding, dict]:
    check = check_log(log)
    assert check.reading is not None
    (finding,), content = predict_clock(check.reading, settings, filming=Filming(**about), spec=reference_spec())  # type: ignore[arg-type]
    return finding, content


@pytest.mark.parametrize(("scene", "level"), [(demo_scene(), "fine"), ({"motion": {"kind": "rig"}}, "limits")])
def test_the_clock_is_predicted_as_well_as_sync_finds_it_on_the_rig_of_another_integrator(
    scene: Any, level: str
) -> None:
    record = make_record(scene, rate_hz=15.0)
    table, count = record.table, len(record.table)
    log = TemperatureLog(table.time_s, table.temp_a_c, table.temp_b_c)
    known = np.ones(count, np.bool_)
    angles = StickAngles(np.arange(count), table.time_s, table.angle_rad, table.angle_sigma_rad, known, known)
    found = find_clock(angles, LogReading(log)).clock
    (finding,), told = predict_clock(LogReading(log), {}, spec=reference_spec(), filming=Filming(15.0, 0.0, 0.06))
    assert finding.level == level
    # The rig moves by another integrator: the widths agree, not the digits.
    assert told["offset_ci95_s"] == pytest.approx(np.ptp(found.offset_ci95_s) / 2.0, rel=0.3)
    assert told["drift_ci95_ppm"] == pytest.approx(np.ptp(found.drift_ci95_ppm) / 2.0, rel=0.3)
    (read,), own = predict_clock(LogReading(log), {}, angles=angles, filming=Filming())
    assert own["offset_ci95_s"] == np.ptp(found.offset_ci95_s) / 2.0
    assert "motion against temperature" in read.text


def test_a_clock_that_one_rate_leaves_open_is_told_with_what_to_do(tmp_path: Path) -> None:
    slow = write_log(tmp_path / "slow.csv", four((0.2,) * 4), length_s=2500.0, step_s=0.5)
    finding, content = clock_told(slow, {})
    assert finding.level == "limits"
    assert content["offset_ci95_s"] > 0.5
    assert "two clearly different rates" in finding.do
    given, known = clock_told(slow, {"offset_s": 3.0})
    assert given.level == "fine"
    assert known["offset_ci95_s"] == 0.0


def test_an_event_that_both_see_is_known_to_a_frame_and_a_row(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", four((0.2,) * 4), length_s=2500.0, step_s=0.5)
    refused, _ = clock_told(log, {"led": [10, 10]})
    assert refused.level == "stops"
    assert "heat_a" in refused.text
    rows = np.loadtxt(log, delimiter=",", skiprows=1)
    heats = np.diff(rows[:, 1], prepend=ROOM_C) > 0.0
    header = "time_s,temp_a_c,temp_b_c,heat_a"
    np.savetxt(log, np.column_stack([rows, heats]), fmt="%.4f", delimiter=",", header=header, comments="")
    finding, content = clock_told(log, {"led": [10, 10]}, rate_fps=25.0)
    assert "shared event" in finding.text
    # Each change falls into an interval of a row (0.5 s) and a frame (0.04 s), whose stamps err by a millisecond.
    most_s = 0.5 * (0.5 + 0.04) + 2.0 * PRIORS.led_jitter_s
    assert 0.0 < content["offset_ci95_s"] <= most_s
    _, drifting = clock_told(log, {"led": [10, 10], "drift_ppm": 5000.0}, rate_fps=25.0)
    assert 0.0 < drifting["offset_ci95_s"] <= most_s
    assert drifting["drift_ci95_ppm"] == 0.0


def test_what_a_new_folder_lacks_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    leave("init", tmp_path / "rig")
    capsys.readouterr()
    code, answer, err = doctor(str(tmp_path / "rig"), capsys=capsys)
    assert code == 3
    stops = [item["text"] for item in answer["result"]["findings"] if item["level"] == "stops"]
    assert [name for name in ("film.mp4", "temps.csv") if any(name in text for text in stops)] == [
        "film.mp4",
        "temps.csv",
    ]
    assert "film.mp4" in err


def test_a_programme_that_never_moves_anything_is_to_be_done_again(tmp_path: Path) -> None:
    check = check_log(write_log(tmp_path / "temps.csv", four((0.5,) * 4, peaks=(44.0,) * 4), length_s=500.0))
    findings, _ = check_programme(check.reading, reference_spec(), where="temps.csv")
    assert verdict(findings) == "do again"
    assert exit_code(findings) == 4
    assert "47.6 °C" in ordered(findings)[0].text


def test_a_film_is_known_as_well_as_its_noise_allows(tmp_path: Path) -> None:
    """Cramér–Rao for a disc whose rim is sharp but for the pixel itself: σ_x = (σ/C) / √(π r)."""
    rig = Rig(lambda t: 60.0 - 60.0 * t, frames=45, texture=0.0)
    check = check_film(str(write_film(rig, tmp_path / "film.mkv")))
    tracked = check.content["tracked"]
    lengths = [rig.base_px[1] - rig.base_px[0], rig.moving_px[1] - rig.moving_px[0]]
    sigma_px = rig.noise / (rig.stick - rig.dot) / np.sqrt(np.pi * rig.radius_px)
    bound_deg = np.rad2deg(sigma_px * np.sqrt(2.0) * np.hypot(1.0 / lengths[0], 1.0 / lengths[1]))
    assert tracked["noise"]["angle_sigma_deg"]["bound"] == pytest.approx(bound_deg, rel=0.25)
    assert tracked["markers"]["radius_px"] == pytest.approx(rig.radius_px, abs=0.3)
    assert tracked["noise"]["marker_contrast_grey"] == pytest.approx(rig.stick - rig.dot, rel=0.1)
    assert tracked["noise"]["picture_noise_grey"] == pytest.approx(rig.noise, rel=0.25)
    assert check.content["motion"]["rate_deg_s"] == pytest.approx(60.0, rel=0.05)
    assert check.content["motion"]["step_deg"] == pytest.approx(2.0, rel=0.05)
    assert check.duration_s == pytest.approx(1.5, abs=1e-3)
    assert verdict(check.findings) == "good"


def test_what_limits_most_comes_first() -> None:
    small, large = Finding("film", "limits", "small", angle_deg=0.1), Finding("log", "limits", "large", angle_deg=3.0)
    findings = [Finding("film", "fine", "fine"), small, large, Finding("film", "note", "note", angle_deg=9.0)]
    assert [item.text for item in ordered(findings)] == ["large", "small", "note", "fine"]
    assert verdict(findings) == "usable"
    assert exit_code(findings) == 0
    assert verdict_lines(ordered(findings))[0].split() == ["Verdict", "usable"]


def test_the_exit_code_is_the_one_of_the_refusal() -> None:
    assert exit_code([Finding("log", "stops", "x", error=InputError("x"))]) == 3
    wrong = [
        Finding("log", "stops", "x", error=InputError("x")),
        Finding("camera", "stops", "y", error=ConfigError("y")),
    ]
    assert exit_code(wrong) == 2
    assert exit_code([Finding("record", "stops", "x")]) == 4


def doctor(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict, str]:
    code = leave("doctor", *words, "--json")
    out, err = capsys.readouterr()
    return code, json.loads(out), err


def test_everything_that_is_wrong_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_world(tmp_path / "world")
    world = tmp_path / "world"
    (world / "actuator.toml").write_text(ACTUATOR.replace("E_A_gpa = 60.0", "E_A_gpa = 60e9"))
    code, answer, err = doctor(str(world / "experiment.toml"), capsys=capsys)
    assert code == answer["exit_code"] == 2
    assert answer["result"]["verdict"] == "do again"
    stops = [item for item in answer["result"]["findings"] if item["level"] == "stops"]
    # an actuator in the wrong unit, and a film without markers
    assert {item["about"] for item in stops} == {"actuator", "film"}
    assert "GPa" in err
    assert "marker" in err


def test_a_camera_that_is_refused_is_told_before_any_film_is_tracked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_world(tmp_path / "world")
    names = [str(tmp_path / "world" / name) for name in ("film.avi", "film.avi", "camera.toml")]
    code, answer, _ = doctor(*names, capsys=capsys)
    assert code == 2
    assert "film" not in answer["result"]
    texts = {item["about"]: item["text"] for item in answer["result"]["findings"]}
    assert "two films need a camera file with a second camera" in texts["camera"]
    assert texts["film"] == "was not examined: a run ends before it, at the camera."


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [("nothing.toml", 3, "no such file"), ("nothing.mp4", 3, "no such file"), ("board.toml", 2, "is neither")],
)
def test_what_cannot_be_looked_at_is_refused(
    name: str, code: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "board.toml").write_text('kind = "chessboard"\n')
    found, answer, err = doctor(str(tmp_path / name), capsys=capsys)
    assert found == code
    assert words in err
    assert words in answer["error"]["message"]


def test_an_experiment_whose_angles_are_there_already(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_world(tmp_path / "world")
    path = tmp_path / "world" / "experiment.toml"
    path.write_text(path.read_text().replace('[video]\npath = "film.avi"', '[angle]\nfile = "angle.csv"'))
    code, answer, _ = doctor(str(path), capsys=capsys)
    assert code == 0
    about = {item["about"]: item["text"] for item in answer["result"]["findings"]}
    assert "800 of 800 frames have an angle, known to 0.0500°" in about["angle"]


def test_an_actuator_that_claims_to_be_exact_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "actuator.toml").write_text(ACTUATOR.partition("[uncertainty]")[0])
    code, answer, _ = doctor(str(tmp_path / "actuator.toml"), capsys=capsys)
    assert code == 0
    assert answer["result"]["verdict"] == "usable"
    assert "A_s_c" in answer["result"]["findings"][0]["text"]
