"""Parallel work in copies of this process, because Python's lock lets only one thread of a process run Python.

A copy (``fork``) begins with all objects of this process, so that nothing has to be sent to it. Its results are sent
back; objects in them that existed before the fork become the original objects. Where a process cannot be copied,
threads do the work.
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
from torsight.core.parallel.threads import end_with, in_parallel
from torsight.core.progress import Progress, silent

_T = TypeVar("_T")
_R = TypeVar("_R")


def in_copies(
    work: Sequence[_T], function: Callable[[_T], _R], *, known: object, step: str = "", progress: Progress = silent
) -> list[_R]:
    """Return ``function`` of each item in order, as :func:`in_parallel` does, computed in copies of this process.

    Side effects of the function are lost. Results are pickled, except that ``known`` and the objects inside it are
    passed by reference: in the results they are the original objects.
    """
    if min(len(work), threads.WORKERS) < 2 or not _may_copy():
        return in_parallel(work, function, step=step, progress=progress)
    context = multiprocessing.get_context("fork")
    over = context.Event()
    here = _within(known)
    begin = (_Copy(function, work, {id(one): place for place, one in enumerate(here)}), over.is_set)
    found: list[_R] = []
    progress(step, 0, len(work))
    with ProcessPoolExecutor(threads.WORKERS, mp_context=context, initializer=_begin, initargs=begin) as pool:
        try:
            with warnings.catch_warnings():
                # Python warns of threads whose locks a copy would wait for; the copies use no such lock.
                warnings.simplefilter("ignore", DeprecationWarning)
                results = pool.map(_work_on, range(len(work)))
            for result in results:
                found.append(_Reader(result, here).load())
                progress(step, len(found), len(work))
        except BrokenProcessPool:
            # The system has killed a copy, as it does when memory runs out.
            found += in_parallel(work[len(found) :], function)
        finally:
            over.set()
    return found


def _may_copy() -> bool:
    """Return whether this process can be forked: not on macOS, whose libraries do not support it, nor from a copy."""
    able = "fork" in multiprocessing.get_all_start_methods() and sys.platform != "darwin"
    return able and not _COPY and not multiprocessing.current_process().daemon


def _within(known: object) -> list[object]:
    """Return an object and all objects that it refers to, except types, modules, strings and numbers."""
    found: dict[int, object] = {}
    left = [known]
    while left:
        one = left.pop()
        if id(one) not in found and not isinstance(one, type | ModuleType | str | int | float | None):
            found[id(one)] = one
            left.extend(one.__closure__ or () if isinstance(one, FunctionType) else gc.get_referents(one))
    return list(found.values())


class _Copy(NamedTuple):
    """The work of a copy: function, items, and the index of every object that existed before, by its id."""

    function: Callable[[Any], object]
    work: Sequence[object]
    places: Mapping[int, int]


_COPY: Final[list[_Copy]] = []
"""The work of this process, if it is a copy."""


def _begin(copy: _Copy, over: Callable[[], bool]) -> None:
    """Initialise a copy, which ends together with its parent process."""
    # Objects from before the fork persist: a garbage collection among them would also copy them page by page.
    gc.freeze()
    # Only the parent handles an interrupt: it ends its copies.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()
    end_with(over)
    _COPY.append(copy)


def end_with_parent() -> None:
    """Wait until the parent process has ended, then end this one."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work_on(place: int) -> bytes:
    """Return the pickled result for the item with an index."""
    copy, into = _COPY[0], io.BytesIO()
    _Writer(into, copy.places).dump(copy.function(copy.work[place]))
    return into.getvalue()


class _Writer(pickle.Pickler):
    """Pickles objects that existed before the fork by their index."""

    def __init__(self, into: io.BytesIO, places: Mapping[int, int]) -> None:
        super().__init__(into, pickle.HIGHEST_PROTOCOL)
        self._places = places

    def persistent_id(self, obj: object) -> int | None:
        """Return the index of an object that existed before the fork; None for others."""
        return self._places.get(id(obj))


class _Reader(pickle.Unpickler):
    """Reads what :class:`_Writer` has written."""

    def __init__(self, written: bytes, here: Sequence[object]) -> None:
        super().__init__(io.BytesIO(written))
        self._here = here

    def persistent_load(self, pid: int) -> object:
        """Return the object with an index."""
        return self._here[pid]
