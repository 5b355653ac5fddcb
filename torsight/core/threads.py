"""Work in several threads, with results that do not depend on their number."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextvars import ContextVar
from typing import Final, TypeVar

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
    with ThreadPoolExecutor(WORKERS, initializer=_end_with, initargs=(over,)) as pool:
        try:
            for result in pool.map(function, work):
                found.append(result)
                progress(step, len(found), len(work))
        finally:
            over.set()
    return found


class _Thread(threading.local):
    """What a worker knows of its work: an event that is set once nobody waits for it."""

    over: threading.Event | None = None


_THREAD: Final = _Thread()


def _end_with(over: threading.Event) -> None:
    """Let the work of this thread end once nobody waits for it."""
    _THREAD.over = over


def go_on() -> None:
    """End this thread's work where nobody waits for it: called by long work at every step."""
    if _THREAD.over is not None and _THREAD.over.is_set():
        raise CancelledError
