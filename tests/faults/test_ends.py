"""A killed track goes on to the same bytes; one that is asked to end says so and leaves nothing half-written."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.command_line import leave

FRAMES = 900
FILES = ("angle.csv", "markers.csv", "track.json", "track.png")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a film of a stick that swings, long enough for several checkpoints."""
    path = tmp_path_factory.mktemp("film") / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (320, 240))
    for k in range(FRAMES):
        picture = np.full((240, 320, 3), 200, np.uint8)
        for angle_deg in (200.0, 60.0 + 80.0 * np.sin(k / 60.0)):
            for radius_px in (40.0, 95.0):
                x_px = 160.0 + radius_px * np.cos(np.deg2rad(angle_deg))
                y_px = 120.0 - radius_px * np.sin(np.deg2rad(angle_deg))
                cv2.circle(picture, (round(16 * x_px), round(16 * y_px)), 16 * 7, (40, 40, 40), -1, cv2.LINE_AA, 4)
        writer.write(picture)
    writer.release()
    return path


@pytest.fixture(scope="module")
def undisturbed(film: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("undisturbed")
    assert leave("track", film, "--out", out) == 0
    return {name: (out / name).read_bytes() for name in FILES}


def begin(film: Path, out: Path) -> subprocess.Popen[str]:
    """Start a track that makes a checkpoint at every chance, and wait for the first."""
    code = (
        "import sys, tracker.checkpoint as c; c.EVERY_S = 0.02;from torsight.cli.main import main; main(sys.argv[1:])"
    )
    words = ["track", str(film), "--out", str(out)]
    process = subprocess.Popen([sys.executable, "-c", code, *words], stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 120.0
    while not (out / ".track" / "state.json").exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.005)
    return process


@pytest.mark.parametrize("later_s", [0.0, 0.15, 0.6])
def test_a_killed_track_goes_on_to_the_same_bytes(
    later_s: float, film: Path, undisturbed: dict[str, bytes], tmp_path: Path
) -> None:
    process = begin(film, tmp_path)
    time.sleep(later_s)
    process.kill()
    process.communicate()
    found = [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")]
    assert all((tmp_path / name).read_bytes() == undisturbed[name] for name in found)
    assert leave("track", film, "--out", tmp_path, "--resume") == 0
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == undisturbed


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_track_that_is_asked_to_end_says_so(name: str, code: int, film: Path, tmp_path: Path) -> None:
    process = begin(film, tmp_path)
    process.send_signal(getattr(signal, name))
    told = process.communicate()[1]
    assert process.returncode == code
    assert told.splitlines()[-1] == (
        "torsight: interrupted; what was finished is on disk, and --resume of run and track continues"
    )
    assert "Traceback" not in told
    assert [path.name for path in tmp_path.iterdir()] == [".track"]
