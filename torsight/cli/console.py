"""Output for people: progress bars with the time left on a terminal, occasional lines of progress elsewhere."""

from __future__ import annotations

import contextlib
import shlex
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Final

from torsight.cli.ends import runs_within
from torsight.core.progress import ATTENTION_S, Progress

PATIENCE_S: Final = ATTENTION_S
"""Interval between lines of progress in a file or pipe, s: a demo of some minutes gives a dozen lines."""


class Lines:
    """Progress as lines in a file or a pipe: work that takes no longer than :data:`PATIENCE_S` writes none."""

    def __init__(self, *, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._began_s = self._said_s = now()

    def report(self, step: str, done: float, total: float | None) -> None:
        """Print the progress of a step, where nothing has been printed for :data:`PATIENCE_S`."""
        now_s = self._now()
        if now_s - self._said_s < PATIENCE_S:
            return
        self._said_s = now_s
        share = f", {100.0 * done / total:.0f} %" if total else ""
        say(f"{now_s - self._began_s:6.0f} s  {step}{share}")


@contextlib.contextmanager
def progress_bar() -> Iterator[Progress]:
    """Give a progress callable that draws bars with the time left on a terminal, and writes lines elsewhere."""
    with _compiling_told():
        if not sys.stderr.isatty():
            yield Lines().report
            return
        from torsight.cli.bars import Bars

        bars = Bars()
        with bars.shown:
            yield bars.report


@contextlib.contextmanager
def _compiling_told() -> Iterator[None]:
    """Tell the user where the block is compiling after :data:`PATIENCE_S`, when no step can report its progress."""
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(PATIENCE_S):
            # numba itself has frames, the functions that it has compiled have none.
            frames = sys._current_frames().values()  # noqa: SLF001 - the documented way to see threads
            if any(runs_within(frame, "numba.") for frame in frames):
                say("compiling: the first start after an installation takes one or two minutes more than others")
                return

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        ended.set()


def command(*words: object) -> str:
    """Return a command of torsight as it is typed into a shell."""
    return shlex.join(["torsight", *map(str, words)])


def say(*lines: str) -> None:
    """Print lines for the person at the terminal (standard error; results go to files)."""
    sys.stderr.writelines(f"{line}\n" for line in lines)
    sys.stderr.flush()
