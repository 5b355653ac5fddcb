"""Results that do not depend on the number of threads."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Final

from threadpoolctl import threadpool_limits

VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What the libraries of linear algebra read when they are loaded."""

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
        with _in_environment(dict.fromkeys(VARIABLES, "1")), threadpool_limits(limits=1, user_api="blas"), _opencv():
            yield
    finally:
        _alone.reset(inside)


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
