"""Requests to end that reach a command from outside: Ctrl-C, SIGTERM, and SIGHUP when its terminal is closed."""

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
"""How often a process asks itself to end: a person does not notice the wait."""


class Ended(BaseException):
    """Someone asked the process to end (Ctrl-C, SIGTERM, a closed terminal): open files are closed as it unwinds.

    It is ``usual`` where the command has nothing left to do but to wait for it. A command that catches it passes it on:
    the process is asked again until it has come through, and what comes after it was caught would be interrupted.
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
    """Let a request to end unwind the command, so that it leaves no half-written file behind.

    An exception that is raised while compiled code calls back into Python is lost there, and what the code goes on with
    then may be nothing: the compiler's is not interrupted (:func:`_compiling`). The process asks itself again until the
    request has come through. While the process unwinds, further requests change nothing. Objects that it left half made
    may fail as they are thrown away: that follows from the request and says nothing new, so they are thrown away here,
    in silence.
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
        if not _compiling(frame):
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
    """Let this thread be asked again and again until it has ended; ``asking`` holds who asks, if anyone does."""
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
    """Release the objects of the frames that a request to end went through; ``asking`` says whether there was one.

    An error that came after a request that was lost is the request.
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
    """Return whether an error is a request to end on its way up, or came of what puts things away then."""
    while error is not None and not isinstance(error, Ended):
        error = error.__context__
    return error is not None


def _compiling(frame: FrameType | None) -> bool:
    """Return whether the compiler is at work below a frame; it calls back to keep code and to fetch what was kept."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith("llvmlite."):
            return True
        frame = frame.f_back
    return False
