"""Work in several threads, with results that do not depend on their number."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator, MutableSequence, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar

from threadpoolctl import ThreadpoolController

from torsight.core.progress import Progress, silent

VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that the libraries of linear algebra read when they are loaded."""

WORKERS: Final = 2
"""Number of workers of one search, a choice: results do not depend on it; the times in docs/ are those of two."""
_T = TypeVar("_T")
_R = TypeVar("_R")

_alone: ContextVar[bool] = ContextVar("_alone", default=False)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Context manager, and decorator of functions, in which linear algebra and OpenCV use one thread.

    Several threads add in a different order: the last digits differ, and a search that depends on them may end
    elsewhere. The matrices and pictures here are small; whole fits and whole records run in parallel instead.
    """
    if _alone.get():
        yield
        return
    inside = _alone.set(True)
    try:
        # The limit holds for libraries that are loaded already, the variables for those that are loaded within.
        pools = _pools(len(sys.modules))
        with _in_environment(dict.fromkeys(VARIABLES, "1")), pools.limit(limits=1, user_api="blas"), _opencv():
            yield
    finally:
        _alone.reset(inside)


@functools.lru_cache(maxsize=1)
def _pools(modules: int) -> ThreadpoolController:
    """Return the loaded libraries; the search takes milliseconds and is repeated when the number of modules changes."""
    del modules
    return ThreadpoolController()


@contextlib.contextmanager
def _in_environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _opencv() -> Iterator[None]:
    cv2 = sys.modules.get("cv2")
    if cv2 is None:
        yield
        return
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def in_parallel(
    work: Sequence[_T], function: Callable[[_T], _R], *, step: str = "", progress: Progress = silent
) -> list[_R]:
    """Return ``function`` of each item in order; results do not depend on the number of workers.

    ``progress`` is called after every item, with the name ``step``. If the caller is interrupted, running work ends at
    its next step (:func:`go_on`).
    """
    found: list[_R] = []
    progress(step, 0, len(work))
    over = threading.Event()

    def counted(one: _T) -> _R:
        with at_work():
            return function(one)

    with ThreadPoolExecutor(WORKERS, initializer=_end_with, initargs=(over,)) as pool:
        try:
            for result in pool.map(counted, work):
                found.append(result)
                progress(step, len(found), len(work))
        finally:
            over.set()
    return found


def with_help(work: Sequence[_T], function: Callable[[_T], _R]) -> list[_R]:
    """Return ``function`` of each item in order, the second half in another thread if a worker is idle.

    For many short parts of one fit, which may be the last of several fits, or the only one.
    """
    half = len(work) // 2
    if not half or not _ask_for_help():
        return [function(one) for one in work]
    try:
        with ThreadPoolExecutor(1) as pool:
            later = pool.submit(lambda: [function(one) for one in work[half:]])
            return [function(one) for one in work[:half]] + later.result()
    finally:
        _AT_WORK.add(-1)


class Event(Protocol):
    """An event that is set once, as those of ``threading`` and ``multiprocessing``."""

    def is_set(self) -> bool:
        """Return whether the event is set."""


class _Thread(threading.local):
    """State of a worker thread: an event that is set when nobody waits for its result, and whether it is counted."""

    over: Event | None = None
    counted: bool = False


_THREAD: Final = _Thread()


@dataclass(slots=True)
class _AtWork:
    """Number of threads within :func:`at_work`, and of their helpers, in all processes that share the work."""

    lock: AbstractContextManager[Any]
    count: MutableSequence[int]

    def add(self, more: int) -> None:
        """Add ``more`` to the count."""
        with self.lock:
            self.count[0] += more


_AT_WORK: Final = _AtWork(threading.Lock(), [0])


def share_work(over: Event, lock: AbstractContextManager[Any], count: MutableSequence[int]) -> None:
    """Let this process, a copy of another, share the other's event of the end of the work and its count of workers."""
    _THREAD.over, _AT_WORK.lock, _AT_WORK.count = over, lock, count


@contextlib.contextmanager
def at_work() -> Iterator[None]:
    """Count this thread as working within the block."""
    _AT_WORK.add(1)
    _THREAD.counted = True
    try:
        yield
    finally:
        _THREAD.counted = False
        _AT_WORK.add(-1)


def _ask_for_help() -> bool:
    """Return whether one more thread may work beside this one; if so, it is counted."""
    with _AT_WORK.lock:
        free = _AT_WORK.count[0] + (not _THREAD.counted) < WORKERS
        _AT_WORK.count[0] += free
    return free


def _end_with(over: Event) -> None:
    """Set the event after which nobody waits for the work of this thread."""
    _THREAD.over = over


def go_on() -> None:
    """Raise CancelledError if nobody waits for this thread's work; long computations call this at every step."""
    if _THREAD.over is not None and _THREAD.over.is_set():
        raise CancelledError
