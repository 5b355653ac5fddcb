"""Whether the doctor tells a heater that is switched on and off from noise, last digits, stairs and corners."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from torsight.cli.checkup.log import check_log
from torsight.core.units import Floats

ROOM_C = 23.0


def write_log(path: Path, *, step_s: float, ripple_c: float = 0.0, digit_c: float = 0.1, held: int = 1) -> Path:
    """Write two heatings of either spring, the second with a ripple of 1.3 pulses a second; cooling by itself."""
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 1200.0, step_s)
    temps = [_spring(time_s, begin_s, ripple_c) for begin_s in ((20.0, 620.0), (320.0, 920.0))]
    read = [np.round((c + 0.03 * rng.standard_normal(len(c))) / digit_c) * digit_c for c in temps]
    read = [values[np.arange(len(values)) // held * held] for values in read]
    header = "time_s,temp_a_c,temp_b_c"
    np.savetxt(path, np.column_stack([time_s, *read]), fmt="%.4f", delimiter=",", header=header, comments="")
    return path


def _spring(time_s: Floats, begins_s: tuple[float, float], ripple_c: float) -> Floats:
    temp_c = np.full_like(time_s, ROOM_C)
    for begin_s, size_c in zip(begins_s, (0.0, ripple_c), strict=True):
        since_s = time_s - begin_s
        saw = size_c * (np.abs((since_s / 0.77) % 1.0 - 0.5) - 0.25) * 2.0
        heated = ROOM_C + 60.0 * (1.0 - np.exp(-since_s / 40.0)) / (1.0 - np.exp(-3.0)) + saw
        cooled = ROOM_C + 60.0 * np.exp(-(since_s - 120.0) / 30.0)
        temp_c = np.where(since_s > 0.0, np.where(since_s < 120.0, heated, cooled), temp_c)
    return temp_c


def told(log: Path) -> dict[str, float]:
    check = check_log(log)
    texts = [finding.text for finding in check.findings if "scatter" in finding.text]
    assert bool(texts) == bool(check.content["ripple_c"])
    return dict(check.content["ripple_c"])


@pytest.mark.parametrize("step_s", [0.5, 0.25, 0.1, 0.05])
def test_a_ripple_with_few_readings_per_pulse_is_told(tmp_path: Path, step_s: float) -> None:
    found = told(write_log(tmp_path / "log.csv", step_s=step_s, ripple_c=1.3))
    assert set(found) == {"a", "b"}
    # A triangle has a standard deviation of 1/√12; third differences take a sine for up to 8/√20 of its own.
    assert all(0.1 < size_c < 1.3 / 12.0**0.5 * 8.0 / 20.0**0.5 for size_c in found.values())


@pytest.mark.parametrize("step_s", [2.0, 1.0, 0.5, 0.25, 0.1, 0.02])
@pytest.mark.parametrize("digit_c", [0.01, 0.1, 0.25, 0.5, 1.0])
def test_a_steady_heating_is_not(tmp_path: Path, step_s: float, digit_c: float) -> None:
    assert told(write_log(tmp_path / "log.csv", step_s=step_s, digit_c=digit_c)) == {}


@pytest.mark.parametrize("held", [2, 5])
def test_readings_that_are_held_are_not(tmp_path: Path, held: int) -> None:
    assert told(write_log(tmp_path / "log.csv", step_s=0.1, held=held)) == {}


def test_a_ripple_that_is_seen_as_it_is_is_not(tmp_path: Path) -> None:
    assert told(write_log(tmp_path / "log.csv", step_s=0.01, ripple_c=1.3, digit_c=0.01)) == {}


@pytest.mark.shared_data
def test_records_without_pulses_have_none(shared_data: Path) -> None:
    for log in sorted((shared_data / "records").glob("*/*temps.csv")):
        assert told(log) == {}, log
