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

    with ThreadPoolExecutor(WORKERS, initializer=end_with, initargs=(over.is_set,)) as pool:
        try:
            for result in pool.map(function, work):
                found.append(result)
                progress(step, len(found), len(work))
        finally:
            over.set()
    return found


_THREAD: Final = threading.local()
"""In a worker thread ``over``, which returns whether nobody waits for its result any more."""


def end_with(over: Callable[[], bool]) -> None:
    """Set the function that returns whether nobody waits for the work of this thread any more."""
    _THREAD.over = over


def go_on() -> None:
    """Raise CancelledError if nobody waits for this thread's work; long computations call this at every step."""
    over = getattr(_THREAD, "over", None)
    if over is not None and over():
        raise CancelledError
