"""The live view's parts: frames that wait, the angle of one frame, what stays on disk."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from torsight.core.errors import ConfigError, InputError
from torsight.core.tracks import MarkerTracks
from torsight.viewer.live.frames.intake import WAITING_FRAMES, Intake, Picture
from torsight.viewer.live.frames.sources import open_pictures
from torsight.viewer.live.measure.angle import LiveAngle
from torsight.viewer.live.measure.model_watch import STEP_S, Thinned
from torsight.viewer.live.record import LineFile, Outcome, Recorder, standing
from torsight.viewer.live.screen import Latency
from tracker.angle.orient import orient

# --- frames -----------------------------------------------------------------------------------------------------------


class Numbered:
    """Pictures that show their own number, as fast as they are taken."""

    name = "numbered"
    speed: float | None = None
    pixel_aspect = 1.0
    ended_because = ""

    def __init__(self, count: int, *, fails_at: int | None = None, waits: bool = False) -> None:
        self.count, self.fails_at, self.waits = count, fails_at, waits

    def frames(self, _stop: threading.Event) -> Iterator[Picture]:
        for index in range(self.count):
            if index == self.fails_at:
                raise InputError("broke off", where=self.name)
            yield Picture(index / 30.0, np.full((4, 4), index % 256, np.uint8))

    def describe(self) -> dict[str, object]:
        return {}


def taken(intake: Intake) -> list[tuple[int, float, int | None]]:
    frames = []
    while not intake.ended:
        frame = intake.take(0.1)
        if frame is not None:
            frames.append((frame.index, frame.time_s, None if frame.luma is None else int(frame.luma[0, 0])))
    return frames


def wait_for(intake: Intake, frames: int) -> None:
    """Wait until so many frames wait to be taken."""
    end = time.monotonic() + 30.0
    while intake.waiting < frames and time.monotonic() < end:
        time.sleep(0.01)


def test_frames_that_come_too_fast_lose_their_pictures_oldest_first_but_not_their_number_or_time() -> None:
    intake = Intake(Numbered(200))
    intake.hurry()
    intake.start()
    wait_for(intake, 200)
    frames = taken(intake)
    assert [index for index, _, _ in frames] == list(range(200))
    np.testing.assert_allclose([time_s for _, time_s, _ in frames], np.arange(200) / 30.0)
    kept = [index for index, _, shade in frames if shade is not None]
    assert kept == list(range(200 - WAITING_FRAMES, 200))
    assert intake.dropped == 200 - WAITING_FRAMES


def test_a_source_that_can_wait_loses_nothing() -> None:
    intake = Intake(Numbered(200, waits=True))
    intake.hurry()
    intake.go()
    intake.start()
    wait_for(intake, WAITING_FRAMES)
    time.sleep(0.3)
    assert intake.waiting == WAITING_FRAMES
    frames = taken(intake)
    assert [(index, shade) for index, _, shade in frames] == [(index, index) for index in range(200)]
    assert intake.dropped == 0


def test_while_the_markers_are_looked_for_the_frames_wait() -> None:
    intake = Intake(Numbered(200))
    intake.start()
    wait_for(intake, 200)
    assert all(shade is not None for _, _, shade in taken(intake))
    assert intake.dropped == 0


def test_what_ends_a_source_early_is_kept_for_whoever_takes_its_frames() -> None:
    intake = Intake(Numbered(9, fails_at=5))
    intake.start()
    assert len(taken(intake)) == 5
    assert isinstance(intake.error, InputError)


@pytest.mark.parametrize(
    ("source", "options", "error", "words"),
    [
        ("rtsp://192.168.0.7/stream", {}, ConfigError, "another computer"),
        ("film.mkv", {}, InputError, r"film\.mkv: no such file"),
        ("film.mkv", {"grows": True}, InputError, "start the recording first"),
        ("film.mkv", {"speed": 0.0}, ConfigError, "--speed"),
        ("film.mkv", {"speed": float("nan")}, ConfigError, "--speed"),
    ],
)
def test_a_source_that_cannot_be_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, options: dict[str, float], error: type, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=words):
        open_pictures(source, **options)


# --- the angle --------------------------------------------------------------------------------------------------------


def test_frame_by_frame_gives_the_angle_that_the_whole_film_gives() -> None:
    """Over two turns and a gap, the base held still; the film's own method is the other way to the same number."""
    random = np.random.default_rng(8)
    n = 400
    time_s = np.arange(n) / 30.0
    angle = 7.0 * np.sin(time_s / 2.0)
    position = np.empty((n, 4, 2))
    for marker, (radius, turn) in enumerate(((35.0, 0.0), (90.0, 0.0), (35.0, 1.0), (90.0, 1.0))):
        direction = 0.4 + turn * angle
        position[:, marker] = np.column_stack([160 + radius * np.cos(direction), 120 - radius * np.sin(direction)])
    sigma = 0.02
    position += random.normal(0.0, sigma, position.shape)
    position[200:206, 2:] = np.nan
    covariance = np.broadcast_to(sigma**2 * np.eye(2), (n, 4, 2, 2)).copy()
    covariance[200:206, 2:] = np.nan
    valid = np.isfinite(position).all(axis=2)
    tracks = MarkerTracks(np.arange(n), time_s, position, covariance, valid, (320, 240))
    whole = orient(tracks, None).angles
    live = LiveAngle(None)
    steps = [live.step(time_s[k], position[k], covariance[k]) for k in range(n)]
    found = np.array([step[0] for step in steps])
    expected_sigma = sigma * np.sqrt(2.0) / 55.0
    both = np.isfinite(found) & np.isfinite(whole.angle_rad)
    assert both.sum() >= n - 6
    difference = (found - angle)[both]
    # Six sigmas of the larger of the two, the base's own noise included.
    assert np.max(np.abs(difference)) < 6.0 * np.sqrt(2.0) * expected_sigma
    assert np.max(np.abs((found - whole.angle_rad)[both])) < 6.0 * np.sqrt(2.0) * expected_sigma
    told = np.array([step[1] for step in steps])[both]
    assert np.median(told) == pytest.approx(expected_sigma, rel=0.1)


# --- on disk ----------------------------------------------------------------------------------------------------------


def test_a_record_is_not_written_over(tmp_path: Path) -> None:
    Recorder(tmp_path / "live", in_space=False).close()
    with pytest.raises(ConfigError, match=r"angle\.csv.*--out"):
        Recorder(tmp_path / "live", in_space=False)


def test_a_killed_program_leaves_whole_lines_up_to_its_last_flush(tmp_path: Path) -> None:
    code = f"""
import os, signal, sys
from pathlib import Path
from typing import Any
from torsight.viewer.live.record import LineFile
file = LineFile(Path({str(tmp_path / "table.csv")!r}), ["a", "b"])
for k in range(1000):
    file.add((k, 0.1 * k))
file.flush()
file.add((1000, 0.0))
os.kill(os.getpid(), signal.SIGKILL)
"""
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == -signal.SIGKILL
    text = (tmp_path / "table.csv").read_text(encoding="utf-8")
    assert text.endswith("999,99.9\n")
    assert len(text.splitlines()) == 1001


def test_what_has_waited_for_a_quarter_of_a_second_is_handed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    file = LineFile(tmp_path / "table.csv", ["a"])
    file.add((1.0,))
    file.flush_due()
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == "a\n"
    now[0] += 0.26
    file.flush_due()
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == "a\n1\n"
    file.close()


# --- statistics -------------------------------------------------------------------------------------------------------


def test_latency_percentiles_are_those_of_the_samples_to_a_bin() -> None:
    durations_s = np.random.default_rng(2).gamma(2.0, 0.002, 5000)
    latency = Latency()
    for duration in durations_s.tolist():
        latency.add(duration)
    for percent in (50.0, 99.0):
        assert latency.percentile_ms(percent) == pytest.approx(np.percentile(durations_s, percent) * 1e3, abs=0.11)
    assert latency.to_json()["longest_ms"] == pytest.approx(durations_s.max() * 1e3)


def test_how_things_stand_is_told_with_units() -> None:
    outcome = Outcome()
    for degrees_now in (-10.0, 30.0, math.nan):
        outcome.count(math.radians(degrees_now), dropped=math.isnan(degrees_now), missed=0)
    words = standing(
        outcome,
        angle_deg=-12.34,
        model_deg=(-15.0, 2.66),
        temperatures={"A": 51.23, "B": 24.0},
        latency_ms=1.7,
        trouble="",
    )
    for part in (
        "−12.3°",
        "A 51.2 °C  B 24.0 °C",
        "40.0°",
        "3, 2 measured, 1 dropped",
        "1.7 ms",
        "−15.0°, residual 2.7°",
    ):
        assert part in words
    nothing = standing(
        Outcome(), angle_deg=math.nan, model_deg=(math.nan, math.nan), temperatures={}, latency_ms=1.0, trouble="rest"
    )
    for part in ("not known yet", "none yet", "**Model** rest"):
        assert part in nothing


def test_thinning_gives_the_mean_of_every_step() -> None:
    random = np.random.default_rng(3)
    time_s = np.sort(random.uniform(0.0, 20.0, 900))
    values = random.normal(size=(900, 2))
    values[100:140, 1] = np.nan
    thinned = Thinned(2)
    for t, row in zip(time_s.tolist(), values.tolist(), strict=True):
        thinned.add(t, tuple(row))
    thinned.add(30.0, (0.0, 0.0))
    at_s, first, second = thinned.columns()
    step = np.floor(time_s / STEP_S).astype(int)
    with np.errstate(invalid="ignore"):
        for column, got in ((0, first), (1, second)):
            known = np.isfinite(values[:, column])
            count = np.bincount(step[known], minlength=step.max() + 1)
            total = np.bincount(step[known], weights=values[known, column], minlength=step.max() + 1)
            expected = (total / count)[np.unique(step)]
            np.testing.assert_allclose(got, expected)
    np.testing.assert_allclose(at_s, (np.unique(step) + 0.5) * STEP_S)
