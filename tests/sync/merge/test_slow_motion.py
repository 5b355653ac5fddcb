"""A film that is longer than its log by a power of two."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sync.merge.slow_motion import slow_motion_factor
from torsight.cli.checkup.examine import Inputs, examine
from torsight.cli.sync import sync_to_folder


@pytest.mark.parametrize(
    ("film_s", "log_s", "factor"),
    [
        (100.0, 100.0, None),
        (100.0, 130.0, None),
        (100.0, 800.0, None),
        (130.0, 100.0, None),
        (205.0, 100.0, 2),
        (780.0, 100.0, 8),
        (300.0, 100.0, None),
        (600.0, 100.0, None),
        (100.0, 0.0, None),
    ],
)
def test_factors(film_s: float, log_s: float, factor: int | None) -> None:
    assert slow_motion_factor(film_s, log_s) == factor


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """Angles of 8 times the log's length, at 30 frames a second."""
    time_s = np.arange(0.0, 80.0, 1.0 / 30.0)
    angle = np.column_stack(
        [np.arange(len(time_s)), time_s, np.sin(time_s), np.full(len(time_s), 0.05), np.ones(len(time_s))]
    )
    head = "frame,time_s,angle_deg,angle_sigma_deg,valid"
    np.savetxt(
        tmp_path / "angle.csv", angle, fmt=["%d", "%.5f", "%.4f", "%.4f", "%d"], delimiter=",", header=head, comments=""
    )
    log_s = np.arange(0.0, 10.0, 0.25)
    temps = np.column_stack([log_s, 23.0 + 2.0 * log_s, np.full(len(log_s), 23.0)])
    np.savetxt(tmp_path / "temps.csv", temps, fmt="%.3f", delimiter=",", header="time_s,temp_a_c,temp_b_c", comments="")
    return tmp_path


def test_the_doctor_says_so(record: Path) -> None:
    findings, _ = examine(Inputs(angle=record / "angle.csv", log=record / "temps.csv"))
    (found,) = [item for item in findings if item.about == "record"]
    assert found.level == "limits"
    assert "8.0 times as long as the log" in found.text
    assert "slow motion" in found.text
    assert "fps = " in found.do


def test_the_synchronisation_says_so_with_the_rate_to_give(record: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sync_to_folder(record / "angle.csv", record / "temps.csv", settings={"offset_s": 0.0}, out=record / "out")
    told = capsys.readouterr().err
    assert "warning" in told
    assert "filmed 8 times as fast as it plays" in told
    assert "fps = 240" in told
