"""Priorities of the threads: measuring threads first, then the logging thread, then everything else.

Where the system allows it (root, or a limit on real-time priority) a measuring thread is scheduled before all ordinary
threads, so that it never waits for a viewer that draws or for another program; elsewhere priorities are unchanged.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from torsight.viewer.program import step_back

_LOWEST: Final = os.sched_get_priority_min(os.SCHED_RR) if hasattr(os, "sched_get_priority_min") else 1

LOGGING, TRACKING, INTAKE = range(_LOWEST, _LOWEST + 3)
"""Real-time priorities in their order: each above every ordinary thread, all below those of the system itself."""

SWITCH_S: Final = sys.getswitchinterval() / 10.0
"""Time for which a thread may keep the interpreter while a measuring one waits, s: a tenth of Python's own 5 ms, which
are longer than a frame at 240 per second."""


@contextlib.contextmanager
def served_first(level: int, *, wanted: bool = True) -> Iterator[bool]:
    """Schedule the calling thread before ordinary ones while the block lasts; yield whether the system allows it.

    Processes that are started in the block do not inherit the real-time priority. ``wanted=False`` changes nothing.
    """
    if not wanted or not hasattr(os, "sched_setscheduler"):
        yield False
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(level))
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, *before)


@contextlib.contextmanager
def quick_turns() -> Iterator[None]:
    """Let threads of this process take turns at the interpreter more often while the block lasts."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def step_back_others() -> None:
    """Lower the priority of all threads of this process but the calling one, so that they never delay a measurement."""
    own = threading.get_native_id()
    with contextlib.suppress(OSError):
        for entry in Path("/proc/self/task").iterdir():
            if int(entry.name) != own:
                step_back(int(entry.name))
