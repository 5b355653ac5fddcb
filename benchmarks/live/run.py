"""Latency, drops and memory of the live view over a long record at a speed-up.

A film is played forwards and backwards, again and again, with its own clock going on; what is printed every minute of
the record is what an hour on the bench would show.

Example: python benchmarks/live/run.py film.mp4 --minutes 60 --speed 8 --viewer
"""

from __future__ import annotations

import argparse
import contextlib
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.viewer.live.feed import Feed
from torsight.viewer.live.session import Session
from torsight.viewer.pictures import viewer_without_screen
from torsight.viewer.program import free_port
from tracker.source import open_source


class ForthAndBack:
    """A film's frames forth and back for so many minutes of its own clock."""

    def __init__(self, film: Path, *, minutes: float, speed: float, fps: float) -> None:
        self.name = str(film)
        self.speed: float | None = speed
        self._step_s = 1.0 / fps
        self._count = round(minutes * 60.0 * fps)
        frames = [frame.luma.copy() for frame in open_source(film) if frame.luma is not None]
        self._loop = frames + frames[-2:0:-1]

    def frames(self, stop: threading.Event) -> Iterator[tuple[float, NDArray[np.uint8] | None, bool]]:
        """Give the frames."""
        for index in range(self._count):
            if stop.is_set():
                return
            yield index * self._step_s, self._loop[index % len(self._loop)], False

    def describe(self) -> dict[str, Any]:
        """Return what is known of the source."""
        return {"kind": "loop", "name": self.name}


def memory_mb() -> float:
    """Return the resident memory of this process."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024.0
    return float("nan")


def main() -> None:
    """Play, and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("film", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--fps", type=float, default=60.0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--viewer", action="store_true", help="attach a viewer that draws without a screen")
    chosen = parser.parse_args()
    pictures = ForthAndBack(chosen.film, minutes=chosen.minutes, speed=chosen.speed, fps=chosen.fps)
    feed = Feed(free_port())
    feed.wait_until_open()
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as stack:
        if chosen.viewer:
            stack.enter_context(viewer_without_screen()).open(feed.address)
        log = Path(scratch) / "temps.csv"
        time_s = np.arange(0.0, chosen.minutes * 60.0, 0.25)
        rows = "\n".join(f"{t:.2f},{25.0 + t % 300.0 / 6.0:.2f},25.0" for t in time_s)
        log.write_text(f"time_s,temp_a_c,temp_b_c\n{rows}\n", encoding="utf-8")
        session = Session(pictures, log=log, folder=Path(scratch) / "live", feed=feed, offset_s=0.0)
        ended = threading.Event()
        watcher = threading.Thread(target=watch, args=(session, ended, 60.0 / chosen.speed), daemon=True)
        watcher.start()
        outcome = session.run(threading.Event())
        ended.set()
        watcher.join()
    feed.close()
    print(f"frames {outcome.frames}, measured {outcome.measured}, dropped {outcome.dropped}")
    print(f"latency {outcome.latency}, not shown {outcome.left_out}, memory {memory_mb():.0f} MB")


def watch(session: Session, ended: threading.Event, every_s: float) -> None:
    """Print memory and latency now and then."""
    while not ended.wait(max(every_s, 5.0)):
        outcome = session.outcome
        print(
            f"{time.strftime('%H:%M:%S')}  frames {outcome.frames}, dropped {outcome.dropped}, {memory_mb():.0f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
