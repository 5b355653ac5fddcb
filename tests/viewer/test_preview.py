"""The small copy of the film: its encoder may hang, end or lack room, and leaves the process that asks as it is."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from torsight.core.errors import NoResultError
from torsight.viewer import encoding, film_preview
from torsight.viewer.film_preview import write_preview

LEVELS = (30, 90, 150, 210)

STUCK = """
import runpy, sys, time
import av
real = av.open

class Container:
    def __init__(self, *args, **options):
        self.real = real(*args, **options)
    def __enter__(self):
        return self
    def __exit__(self, *error):
        self.real.close()
    def add_stream(self, codec, **options):
        self.stream = self.real.add_stream(codec, **options)
        return self.stream if codec != "libsvtav1" else Stream()
    def mux(self, packets):
        self.real.mux(packets)

class Stream:
    def encode(self, picture=None):
        time.sleep(3600.0)

av.open = Container
sys.argv[0] = {encoder!r}
runpy.run_path({encoder!r}, run_name="__main__")
"""


def film_of(folder: Path, size_px: tuple[int, int]) -> Path:
    folder.mkdir()
    for index, level in enumerate(LEVELS):
        cv2.imwrite(str(folder / f"{index:03d}.png"), np.full(size_px[::-1], level, np.uint8))
    return folder


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return film_of(tmp_path_factory.mktemp("film") / "pictures", (160, 120))


def levels_in(path: Path) -> list[float]:
    import av

    with av.open(str(path)) as container:
        return [float(frame.to_ndarray(format="gray").mean()) for frame in container.decode(video=0)]


def codec_of(path: Path) -> str:
    import av

    with av.open(str(path)) as container:
        return str(container.streams.video[0].codec_context.name)


def test_this_process_keeps_its_priority_and_its_user(film: Path, tmp_path: Path) -> None:
    if not hasattr(os, "sched_getscheduler"):
        pytest.skip("this system has no such priorities")
    before = os.sched_getscheduler(0), os.geteuid()
    write_preview(film, tmp_path / "preview.mp4", frame_count=len(LEVELS))
    assert (os.sched_getscheduler(0), os.geteuid()) == before
    assert "av1" in codec_of(tmp_path / "preview.mp4")


def test_no_thread_of_the_encoder_goes_before_everything_else(tmp_path: Path) -> None:
    if not hasattr(os, "sched_getscheduler"):
        pytest.skip("this system has no such priorities")
    words = [str(tmp_path / "preview.mp4"), "libsvtav1", "160", "120", "25", "60"]
    with subprocess.Popen([sys.executable, "-P", encoding.__file__, *words], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        encoder.stdin.write((encoding.PICTURE + bytes(160 * 120)) * 20)
        encoder.stdin.flush()
        tasks = Path(f"/proc/{encoder.pid}/task")
        end = time.monotonic() + 60.0
        while len(list(tasks.iterdir())) < 4 and time.monotonic() < end:
            time.sleep(0.02)
        policies = set()
        for task in tasks.iterdir():
            with contextlib.suppress(ProcessLookupError):  # a thread that has ended since it was listed
                policies.add(os.sched_getscheduler(int(task.name)))
        encoder.stdin.write(encoding.END)
    assert policies == {os.SCHED_OTHER}
    assert encoder.returncode == 0


def test_an_encoder_that_hangs_ends_itself_and_the_next_one_does_the_work(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stuck = tmp_path / "stuck.py"
    stuck.write_text(STUCK.format(encoder=encoding.__file__), encoding="utf-8")
    monkeypatch.setattr(film_preview, "ENCODER", stuck)
    monkeypatch.setattr(film_preview, "STUCK_S", 1.5)
    made = write_preview(film, tmp_path / "preview.mp4", frame_count=len(LEVELS))
    assert codec_of(made.path) == "h264"
    np.testing.assert_allclose(levels_in(made.path), LEVELS, atol=4.0)
    monkeypatch.setattr(film_preview, "CODECS", ("libsvtav1",))
    with pytest.raises(NoResultError, match=r"could not be encoded.*1\.5 s.*--resume"):
        write_preview(film, tmp_path / "preview.mp4", frame_count=len(LEVELS))


def test_root_s_own_packages_may_be_closed_to_everybody_else(tmp_path: Path) -> None:
    import av

    closed = tmp_path / "closed"
    closed.mkdir(mode=0o700)
    (closed / "av").symlink_to(Path(av.__file__).parent, target_is_directory=True)
    words = [str(tmp_path / "preview.mp4"), "libx264", "160", "120", "25", "60"]
    pictures = (encoding.PICTURE + bytes(160 * 120)) * 3 + encoding.END
    command = [sys.executable, "-P", encoding.__file__, *words]
    done = subprocess.run(
        command, input=pictures, capture_output=True, check=False, env=os.environ | {"PYTHONPATH": str(closed)}
    )
    assert (done.returncode, done.stdout) == (0, b"")
    assert len(levels_in(tmp_path / "preview.mp4")) == 3


def test_a_full_disk_is_told_as_one(film: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no full device")
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as told:
        write_preview(film, Path("/dev/full"), frame_count=len(LEVELS))
    assert told.value.errno == errno.ENOSPC


def test_an_encoder_whose_sender_is_gone_ends_and_one_at_the_terminal_stays(tmp_path: Path) -> None:
    words = [str(tmp_path / "preview.mp4"), "libx264", "160", "120", "25", "60"]
    with subprocess.Popen([sys.executable, "-P", encoding.__file__, *words], stdin=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        encoder.stdin.write(encoding.PICTURE + bytes(160 * 120))
        encoder.stdin.flush()
        end = time.monotonic() + 60.0
        while not (tmp_path / "preview.mp4").exists() and time.monotonic() < end:
            time.sleep(0.02)
        # The terminal's Ctrl-C reaches the whole group; the sender is the one that decides.
        encoder.send_signal(signal.SIGINT)
        assert encoder.poll() is None
    assert encoder.returncode == encoding.GONE


@pytest.mark.parametrize("reason", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("pictures", [0, 2])
def test_who_stops_the_work_leaves_no_encoder(
    pictures: int, reason: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kill = subprocess.Popen.kill

    def kill_at_once(process: subprocess.Popen[bytes]) -> None:
        kill(process)
        process.wait()

    # Small pictures wait in a buffer, which then meets a closed pipe, every time.
    film = film_of(tmp_path / "small", (64, 48))
    monkeypatch.setattr(subprocess.Popen, "kill", kill_at_once)

    def stop(_what: str, done: float, _of: float | None) -> None:
        if done == pictures:
            raise reason

    children = Path(f"/proc/{os.getpid()}/task/{threading.get_native_id()}/children")
    before = children.read_text() if children.exists() else ""
    with pytest.raises(reason):
        write_preview(film, tmp_path / "preview.mp4", frame_count=len(LEVELS), progress=stop)
    assert not children.exists() or children.read_text() == before
