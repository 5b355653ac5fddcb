"""Latency, drops and memory of the live view over a long record, as an hour on the bench would show them.

A film is played forth and back, again and again, with its own clock going on; `--speed` makes an hour short. Beside
it, in a process of its own and at ordinary priority, runs the yardstick: a plain loop that wakes for every frame of
a film of the same rate and decodes one picture. How late its pictures are is what the machine, busy with other
things, costs any program.

Latency counts from when a frame is there, or is due, to when its row is handed to the record, and to when its angle is
logged for the viewers.

Example: python benchmarks/live/run.py film.mp4 --minutes 60 --speed 4 --viewer
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.viewer.live.frames.intake import Picture
from torsight.viewer.live.live_session import Session
from torsight.viewer.live.measure.growing_log import WatchedLog
from torsight.viewer.live.screen import Feed, Latency
from torsight.viewer.program import free_port
from torsight.viewer.screenshots import viewer_without_screen
from tracker.frames.source import open_source

SAMPLE_S: Final = 2.0
"""How often memory is read."""


class ForthAndBack:
    """A film's frames forth and back for so many minutes of its own clock; they do not wait, as a camera's do not."""

    waits = False
    pixel_aspect = 1.0
    ended_because = ""

    def __init__(self, film: Path, *, minutes: float, speed: float, fps: float) -> None:
        self.name = str(film)
        self.speed: float | None = speed
        self._step_s = 1.0 / fps
        self._count = round(minutes * 60.0 * fps)
        frames = [frame.luma.copy() for frame in open_source(film) if frame.luma is not None]
        self._loop = frames + frames[-2:0:-1]

    def frames(self, stop: threading.Event) -> Iterator[Picture]:
        """Give the frames."""
        for index in range(self._count):
            if stop.is_set():
                return
            yield Picture(index * self._step_s, self._loop[index % len(self._loop)])

    def describe(self) -> dict[str, Any]:
        """Return what is known of the source."""
        return {"kind": "loop", "name": self.name}


class Memory:
    """Resident memory of processes over time."""

    def __init__(self, processes: dict[str, int]) -> None:
        self._processes = processes
        self.time_s: list[float] = []
        self.megabytes: dict[str, list[float]] = {name: [] for name in processes}

    def sample(self, time_s: float) -> None:
        """Read the memory of each process."""
        self.time_s.append(time_s)
        for name, process in self._processes.items():
            self.megabytes[name].append(resident_mb(process))

    def growth(self, name: str) -> tuple[float, float, float]:
        """Return the last value (MB), and the slope with its standard error (MB per hour) over the last third.

        Neighbouring samples are alike: their number is cut to that of independent ones by the residual's correlation.
        """
        begin = 2 * len(self.time_s) // 3
        hours = np.array(self.time_s[begin:]) / 3600.0
        values = np.array(self.megabytes[name][begin:])
        if len(values) < 5:
            return values[-1] if len(values) else float("nan"), float("nan"), float("nan")
        centred = hours - hours.mean()
        slope = float(centred @ values / (centred @ centred))
        rest = values - values.mean() - slope * centred
        scatter = float(rest @ rest)
        alike = max(0.0, float(rest[1:] @ rest[:-1]) / scatter) if scatter > 0.0 else 0.0
        count = max(3.0, len(values) * (1.0 - alike) / (1.0 + alike))
        return float(values[-1]), slope, float(np.sqrt(scatter / (count - 2.0) / (centred @ centred)))


def resident_mb(process: int) -> float:
    """Return the resident memory of a process; NaN when it has ended."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{process}/status").read_text(encoding="ascii").splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1]) / 1024.0
    return float("nan")


def plain_loop(film: str, fps: float, counts: Any, ended: Any) -> None:
    """Wake for every frame, decode one picture, and count how late it is there."""
    latency = Latency(counts)
    while not ended.is_set():
        due_s = time.perf_counter()
        for frame in open_source(film):
            latency.add(time.perf_counter() - due_s)
            if ended.is_set() or frame.luma is None:
                break
            due_s = max(due_s + 1.0 / fps, time.perf_counter() - 1.0)
            time.sleep(max(0.0, due_s - time.perf_counter()))


@contextlib.contextmanager
def yardstick(film: Path, fps: float) -> Iterator[Latency]:
    """Run the plain loop in a process of its own while the block lasts, and give its latency."""
    from torsight.viewer.live.screen import CELLS

    context = get_context("spawn")
    counts, ended = context.RawArray("q", CELLS), context.Event()
    process = context.Process(target=plain_loop, args=(str(film), fps, counts, ended), daemon=True)
    process.start()
    try:
        yield Latency(counts)
    finally:
        ended.set()
        process.join()


def main() -> None:
    """Play, and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("film", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--fps", type=float, default=60.0)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--viewer", action="store_true", help="attach a viewer that draws without a screen")
    parser.add_argument("--actuator", type=Path, help="compute the model beside")
    chosen = parser.parse_args()
    pictures = ForthAndBack(chosen.film, minutes=chosen.minutes, speed=chosen.speed, fps=chosen.fps)
    feed = Feed(free_port())
    feed.wait_until_open()
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as stack:
        if chosen.viewer:
            stack.enter_context(viewer_without_screen()).open(feed.address)
        plain = stack.enter_context(yardstick(chosen.film, chosen.fps))
        model = None if chosen.actuator is None else model_of(chosen.actuator, stack)
        log = write_log(Path(scratch) / "temps.csv", seconds=chosen.minutes * 60.0)
        session = Session(pictures, WatchedLog(log, 0.0), folder=Path(scratch) / "live", feed=feed, model=model)
        memory = Memory({"measuring": os.getpid(), "feeding the viewers": feed.process_id})
        with watched(session, memory):
            outcome = session.run(threading.Event())
    feed.close()
    print(f"frames {outcome.frames}, measured {outcome.measured}, dropped {outcome.dropped}")
    print(f"load over the last minute {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    print(f"measuring threads served before others: {'yes' if outcome.served_first else 'no'}")
    print(f"{'latency, ms':34s} {'median':>8s} {'99 %':>8s} {'longest':>8s}")
    rows = {"frame to recorded angle": outcome.latency, "frame to logged angle": outcome.latency_logged}
    for name, times in (rows | {"yardstick: plain loop, decoding": plain.to_json()}).items():
        print(f"{name:34s} {times['median_ms']:8.1f} {times['p99_ms']:8.1f} {times['longest_ms']:8.1f}")
    for name in memory.megabytes:
        last, slope, sigma = memory.growth(name)
        print(f"memory, {name:26s} {last:7.1f} MB, growth {slope:+.1f} ± {sigma:.1f} MB per hour of the record")
    print(f"entries not shown {outcome.left_out}")
    print(json.dumps({name: [round(value) for value in values[::30]] for name, values in memory.megabytes.items()}))


def model_of(actuator: Path, stack: contextlib.ExitStack) -> Any:
    """Return a model that is computed beside; it ends with the stack."""
    from torsight.actuator.spec import read_actuator
    from torsight.viewer.live.measure.model_watch import ModelWatch

    watch = ModelWatch(read_actuator(actuator))
    stack.callback(watch.close)
    return watch


def write_log(path: Path, *, seconds: float) -> Path:
    """Write a temperature log of that length: a spring is heated and cools every five minutes."""
    time_s = np.arange(0.0, seconds, 0.25)
    temp_c = 25.0 + 50.0 * np.interp(time_s % 300.0, [0.0, 120.0, 300.0], [0.0, 1.0, 0.0])
    rows = "\n".join(f"{t:.2f},{temp:.2f},25.0" for t, temp in zip(time_s, temp_c, strict=True))
    path.write_text(f"time_s,temp_a_c,temp_b_c\n{rows}\n", encoding="utf-8")
    return path


@contextlib.contextmanager
def watched(session: Session, memory: Memory) -> Iterator[None]:
    """Read memory now and then while the block lasts, and print how far the record is once a minute."""
    ended = threading.Event()

    def watch() -> None:
        told = time.monotonic()
        last_s = -1.0
        while not ended.wait(SAMPLE_S):
            # Once the last frame is taken the whole record is read back and oriented, which is another matter.
            if session.now_s > last_s >= 0.0:
                memory.sample(last_s)
            last_s = session.now_s
            if time.monotonic() - told >= 60.0:
                told = time.monotonic()
                outcome = session.outcome
                print(f"{session.now_s:7.0f} s  frames {outcome.frames}, dropped {outcome.dropped}", flush=True)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


if __name__ == "__main__":
    main()
