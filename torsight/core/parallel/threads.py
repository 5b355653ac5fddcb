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
"""What the libraries of linear algebra read when they are loaded."""

WORKERS: Final = 2
"""Workers of one search: results do not depend on their number, and the times in docs/ are those of two. A choice."""
_T = TypeVar("_T")
_R = TypeVar("_R")

_alone: ContextVar[bool] = ContextVar("_alone", default=False)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Give a context, or decorate a function, in which linear algebra and OpenCV use one thread.

    Several add up in another order: the last digits differ, and a search that decides by them may end elsewhere. The
    matrices and pictures here are small; what runs in parallel are whole fits and whole records.
    """
    if _alone.get():
        yield
        return
    inside = _alone.set(True)
    try:
        # The limit holds for what is loaded, the variables for what is loaded within.
        pools = _pools(len(sys.modules))
        with _in_environment(dict.fromkeys(VARIABLES, "1")), pools.limit(limits=1, user_api="blas"), _opencv():
            yield
    finally:
        _alone.reset(inside)


@functools.lru_cache(maxsize=1)
def _pools(modules: int) -> ThreadpoolController:
    """Return the libraries that are loaded; to look for them takes milliseconds, and they come with new ``modules``."""
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
    work: Sequence[_T],
    function: Callable[[_T], _R],
    *,
    step: str = "",
    progress: Progress = silent,
) -> list[_R]:
    """Return ``function`` of each item in order; results do not depend on the number of workers.

    ``progress`` is told after every item, under the name ``step``. Where the caller is asked to end, work that is
    under way ends at its next step (:func:`go_on`).
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
    """Return ``function`` of each item in order, half of them worked out beside the others where a worker is idle.

    For many short pieces of one fit, which may be the last that runs, or the only one.
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
    """Something that happens once, as ``threading.Event`` and that of ``multiprocessing``."""

    def is_set(self) -> bool:
        """Return whether it has happened."""


class _Thread(threading.local):
    """What a worker knows of its work: an event that is set once nobody waits for it, and whether it is counted."""

    over: Event | None = None
    counted: bool = False


_THREAD: Final = _Thread()


@dataclass(slots=True)
class _AtWork:
    """How many threads work now, of all processes that share the work; those apart that no one has counted."""

    lock: AbstractContextManager[Any]
    count: MutableSequence[int]

    def add(self, more: int) -> None:
        """Count so many more."""
        with self.lock:
            self.count[0] += more


_AT_WORK: Final = _AtWork(threading.Lock(), [0])


def share_work(over: Event, lock: AbstractContextManager[Any], count: MutableSequence[int]) -> None:
    """Let this process, a copy of another, share its work: until it is over, and with one count of who works."""
    _THREAD.over, _AT_WORK.lock, _AT_WORK.count = over, lock, count


@contextlib.contextmanager
def at_work() -> Iterator[None]:
    """Count this thread as one that works."""
    _AT_WORK.add(1)
    _THREAD.counted = True
    try:
        yield
    finally:
        _THREAD.counted = False
        _AT_WORK.add(-1)


def _ask_for_help() -> bool:
    """Return whether one more thread may work beside this one; then it is counted."""
    with _AT_WORK.lock:
        free = _AT_WORK.count[0] + (not _THREAD.counted) < WORKERS
        _AT_WORK.count[0] += free
    return free


def _end_with(over: Event) -> None:
    """Let the work of this thread end once nobody waits for it."""
    _THREAD.over = over


def go_on() -> None:
    """End this thread's work where nobody waits for it: called by long work at every step."""
    if _THREAD.over is not None and _THREAD.over.is_set():
        raise CancelledError
