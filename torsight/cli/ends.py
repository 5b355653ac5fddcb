"""Requests to end that reach a command from outside: Ctrl-C, SIGTERM, and SIGHUP when its terminal is closed."""

from __future__ import annotations

import contextlib
import gc
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from types import FrameType
from typing import Final

_ASKED_AGAIN_S: Final = 0.3
"""How often a process asks itself to end: a person does not notice the wait."""


class Ended(BaseException):
    """Someone asked the process to end (Ctrl-C, SIGTERM, a closed terminal): what it holds open is put away."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def asks() -> list[int]:
    """Return the signals that ask this process to end; what it was told to ignore (by ``nohup``) is none."""
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

    An exception that is raised while compiled code calls back into Python is lost there. So the process asks itself
    again until the request has come through; while it unwinds, further requests change nothing. Objects that it left
    half made (those of a compiler, say) may fail as they are thrown away: that follows from the request and says
    nothing new, so they are thrown away here, in silence.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ended = threading.Event()
    asking: list[threading.Thread] = []

    def ask_again(thread: int, number: int) -> None:
        while not ended.wait(_ASKED_AGAIN_S):
            signal.pthread_kill(thread, number)

    def end(number: int, _frame: object) -> None:
        if _unwinding():
            return
        if not asking:
            asking.append(threading.Thread(target=ask_again, args=(threading.get_ident(), number), daemon=True))
            asking[0].start()
        raise Ended(number)

    def tell_unless_ended(lost: sys.UnraisableHookArgs, /) -> None:
        if not asking and not isinstance(lost.exc_value, Ended):
            tell_lost(lost)

    tell_lost, sys.unraisablehook = sys.unraisablehook, tell_unless_ended
    with handled(asks(), end):
        try:
            with _thrown_away():
                yield
        finally:
            ended.set()
            for thread in asking:
                thread.join()
            sys.unraisablehook = tell_lost


@contextlib.contextmanager
def _thrown_away() -> Iterator[None]:
    """Let go of what the frames that a request to end went through had in hand."""
    try:
        yield
    except Ended as error:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
        raise


def _unwinding() -> bool:
    """Return whether a request to end is on its way up through what puts things away."""
    error = sys.exception()
    while error is not None and not isinstance(error, Ended):
        error = error.__context__
    return error is not None
