"""Work in copies of this process: Python's lock lets only one thread of a process run Python at a time.

A copy (``fork``) begins with all that is known here, so nothing has to be sent to it. What it finds comes back; objects
that were here before come back as themselves. Where a process cannot be copied, threads do the work.
"""

from __future__ import annotations

import gc
import io
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import FunctionType, ModuleType
from typing import Any, Final, NamedTuple, TypeVar

from torsight.core.parallel import threads
from torsight.core.parallel.threads import at_work, in_parallel, share_work
from torsight.core.progress import Progress, silent

_T = TypeVar("_T")
_R = TypeVar("_R")


def in_copies(
    work: Sequence[_T],
    function: Callable[[_T], _R],
    *,
    known: object,
    step: str = "",
    progress: Progress = silent,
) -> list[_R]:
    """Return ``function`` of each item in order, as :func:`in_parallel` does, worked out in copies of this process.

    What the function keeps or changes beside what it returns is lost. Results are pickled; ``known`` and all that it
    holds comes back as itself.
    """
    if min(len(work), threads.WORKERS) < 2 or not _may_copy():
        return in_parallel(work, function, step=step, progress=progress)
    context = multiprocessing.get_context("fork")
    over, lock, count = context.Event(), context.Lock(), context.RawArray("i", 1)
    here = _within(known)
    begin = (_Copy(function, work, {id(one): place for place, one in enumerate(here)}), over, lock, count)
    found: list[_R] = []
    progress(step, 0, len(work))
    with ProcessPoolExecutor(threads.WORKERS, mp_context=context, initializer=_begin, initargs=begin) as pool:
        try:
            with warnings.catch_warnings():
                # Python warns of threads whose locks a copy would wait for; nothing here asks for one of theirs.
                warnings.simplefilter("ignore", DeprecationWarning)
                results = pool.map(_work_on, range(len(work)))
            for result in results:
                found.append(_Reader(result, here).load())
                progress(step, len(found), len(work))
        except BrokenProcessPool:
            # The system has ended a copy, as it does where memory runs out.
            found += in_parallel(work[len(found) :], function)
        finally:
            over.set()
    return found


def _may_copy() -> bool:
    """Return whether this process can be copied: macOS's own libraries do not bear it, nor does a copy."""
    able = "fork" in multiprocessing.get_all_start_methods() and sys.platform != "darwin"
    return able and not _COPY and not multiprocessing.current_process().daemon


def _within(known: object) -> list[object]:
    """Return an object and all that it holds, but for what has a name of its own, as types have, or is a number."""
    found: dict[int, object] = {}
    left = [known]
    while left:
        one = left.pop()
        if id(one) not in found and not isinstance(one, type | ModuleType | str | int | float | None):
            found[id(one)] = one
            left.extend(one.__closure__ or () if isinstance(one, FunctionType) else gc.get_referents(one))
    return list(found.values())


class _Copy(NamedTuple):
    """What a copy works on: a function of items, and at which place every object stands that was known before."""

    function: Callable[[Any], object]
    work: Sequence[object]
    places: Mapping[int, int]


_COPY: Final[list[_Copy]] = []
"""What this process works on, where it is a copy."""


def _begin(copy: _Copy, *shared: Any) -> None:
    """Begin as a copy, which ends when the process does of which it is one."""
    # What was here before stays: to look through it for garbage would also copy it page by page.
    gc.freeze()
    # An interrupt is for the process that waits: it lets its copies end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    share_work(*shared)
    _COPY.append(copy)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work_on(place: int) -> bytes:
    """Return what comes of an item, pickled."""
    copy, into = _COPY[0], io.BytesIO()
    with at_work():
        found = copy.function(copy.work[place])
    _Writer(into, copy.places).dump(found)
    return into.getvalue()


class _Writer(pickle.Pickler):
    """Pickles what was known before by its place."""

    def __init__(self, into: io.BytesIO, places: Mapping[int, int]) -> None:
        super().__init__(into, pickle.HIGHEST_PROTOCOL)
        self._places = places

    def persistent_id(self, obj: object) -> int | None:
        """Return the place of an object that was known before."""
        return self._places.get(id(obj))


class _Reader(pickle.Unpickler):
    """Reads what :class:`_Writer` has written."""

    def __init__(self, written: bytes, here: Sequence[object]) -> None:
        super().__init__(io.BytesIO(written))
        self._here = here

    def persistent_load(self, pid: int) -> object:
        """Return the object at a place."""
        return self._here[pid]
