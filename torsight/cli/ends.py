"""Requests from outside to end a command: Ctrl-C, SIGTERM, and SIGHUP when its terminal is closed."""

from __future__ import annotations

import contextlib
import gc
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator
from types import FrameType
from typing import Final

from torsight.core.progress import AT_ONCE_S

_ASKED_AGAIN_S: Final = 0.5 * AT_ONCE_S
"""Interval at which a process repeats a request to end, s: too short for a person to notice."""


class Ended(BaseException):
    """A request to end the process (Ctrl-C, SIGTERM, a closed terminal), raised so that open files are closed.

    The request is ``usual`` where the command only waits for it. A command that catches it must raise it again: the
    request is repeated until it has left the command, and would interrupt any code after the ``except``.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
        self.usual = False


def asks() -> list[int]:
    """Return the signals that ask this process to end; signals that are ignored (``nohup``) are not among them."""
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


@contextlib.contextmanager
def handled(numbers: Iterable[int], handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Answer signals with ``handler`` while the block lasts."""
    kept = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, before in kept.items():
            signal.signal(number, before)


@contextlib.contextmanager
def asked_to_end() -> Iterator[None]:
    """Let a request to end unwind the command as an exception, so that no half-written file remains.

    An exception that is raised while compiled code calls back into Python is lost there, and the code may continue with
    a null result: the compiler is therefore not interrupted, and the request is repeated until it
    arrives. While the process unwinds, further requests are ignored. Incomplete objects may fail when they are deleted;
    these errors only follow from the request, so the objects are deleted here and the errors are not reported.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = threading.Event()
    asking: dict[int, threading.Thread] = {}

    def end(number: int, frame: FrameType | None) -> None:
        if _unwinding(sys.exception()):
            return
        _ask_again(number, asking, ended)
        # The compiler calls back into Python to cache code and to load it.
        if not runs_within(frame, "llvmlite."):
            raise Ended(number)

    def tell_unless_ended(lost: sys.UnraisableHookArgs, /) -> None:
        if not asking and not isinstance(lost.exc_value, Ended):
            tell_lost(lost)

    tell_lost, sys.unraisablehook = sys.unraisablehook, tell_unless_ended
    with handled(asks(), end):
        try:
            with _thrown_away(asking):
                yield
        finally:
            ended.set()
            for thread in asking.values():
                thread.join()
            sys.unraisablehook = tell_lost


def _ask_again(number: int, asking: dict[int, threading.Thread], ended: threading.Event) -> None:
    """Repeat a signal to this thread until ``ended`` is set; ``asking`` holds the thread that repeats it, if any."""
    if asking:
        return
    asked = threading.get_ident()

    def ask() -> None:
        while not ended.wait(_ASKED_AGAIN_S):
            signal.pthread_kill(asked, number)

    asking[number] = threading.Thread(target=ask, daemon=True)
    asking[number].start()


@contextlib.contextmanager
def _thrown_away(asking: Collection[int]) -> Iterator[None]:
    """Delete the objects of the frames that a request to end has left; ``asking`` is empty where there was no request.

    An error that follows a lost request is replaced by this request.
    """
    try:
        yield
    except Ended as error:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
        raise
    except Exception as error:
        if asking and not _unwinding(error):
            raise Ended(next(iter(asking))) from error
        raise


def _unwinding(error: BaseException | None) -> bool:
    """Return whether an error is a request to end, or was raised by clean-up code during such a request."""
    while error is not None and not isinstance(error, Ended):
        error = error.__context__
    return error is not None


def runs_within(frame: FrameType | None, package: str) -> bool:
    """Return whether a frame, or a caller of it, is code of a module whose name begins with ``package``."""
    while frame is not None and not frame.f_globals.get("__name__", "").startswith(package):
        frame = frame.f_back
    return frame is not None
