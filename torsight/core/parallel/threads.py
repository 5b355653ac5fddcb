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
    with contextlib.ExitStack() as afterwards:
        afterwards.callback(_alone.reset, _alone.set(True))
        # The limit holds for libraries that are loaded already, the variables for those that are loaded within.
        for name in VARIABLES:
            if name in os.environ:
                afterwards.callback(os.environ.__setitem__, name, os.environ[name])
            else:
                afterwards.callback(os.environ.pop, name, None)
            os.environ[name] = "1"
        afterwards.enter_context(_pools(len(sys.modules)).limit(limits=1, user_api="blas"))
        if (cv2 := sys.modules.get("cv2")) is not None:
            afterwards.callback(cv2.setNumThreads, cv2.getNumThreads())
            cv2.setNumThreads(1)
        yield


@functools.lru_cache(maxsize=1)
def _pools(modules: int) -> ThreadpoolController:
    """Return the loaded libraries; the search takes milliseconds and is repeated when the number of modules changes."""
    del modules
    return ThreadpoolController()


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
