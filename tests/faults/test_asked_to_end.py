"""A request to end comes through wherever it meets the command, once, and what puts things away is left in peace."""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import signal
import sys
import time
from collections.abc import Callable, Iterator
from types import FunctionType

import pytest

from torsight.cli import ends

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


def work_on() -> None:
    """Go on for longer than any test waits, in steps that a signal can interrupt."""
    for _ in itertools.repeat(None, 3000):
        time.sleep(0.01)


def ask() -> None:
    signal.raise_signal(signal.SIGTERM)


def through_compiled_code() -> None:
    """Ask while foreign code calls back into Python: an exception is lost on the way."""
    ctypes.CFUNCTYPE(None)(ask)()


def to_code_that_then_fails() -> None:
    """Ask where the exception is lost, and the foreign code goes on without what it asked for."""
    through_compiled_code()
    raise RuntimeError("no compiled object yet")


class HalfMade:
    """What a compiler makes: asked to end while it is made, it lacks the handle that its end gives back."""

    def __init__(self) -> None:
        ask()
        self.handle = 1

    def __del__(self) -> None:
        assert self.handle


def within_a_cycle() -> None:
    """Leave a half-made object where only the collector finds it."""
    made = HalfMade.__new__(HalfMade)
    made.own = made  # type: ignore[attr-defined]
    made.__init__()  # type: ignore[misc]


@pytest.mark.parametrize("how", [ask, through_compiled_code, to_code_that_then_fails, HalfMade, within_a_cycle])
def test_the_request_comes_through(how: Callable[[], object], capsys: pytest.CaptureFixture[str]) -> None:
    before = signal.getsignal(signal.SIGTERM), sys.unraisablehook

    def asked() -> None:
        with ends.asked_to_end():
            how()
            work_on()

    with pytest.raises(ends.Ended):
        asked()
    assert (signal.getsignal(signal.SIGTERM), sys.unraisablehook) == before
    assert capsys.readouterr().err == ""


def test_the_compiler_is_not_interrupted() -> None:
    """What it asks for and does not get makes it fail, or the whole process crash."""
    compiled: list[str] = []

    def called_back() -> None:
        ask()
        compiled.append("whole")

    compiler = FunctionType(
        called_back.__code__, {"__name__": "llvmlite.binding", "ask": ask}, closure=called_back.__closure__
    )

    def asked() -> None:
        with ends.asked_to_end():
            compiler()
            work_on()

    with pytest.raises(ends.Ended):
        asked()
    assert compiled == ["whole"]


def test_what_puts_things_away_is_not_interrupted() -> None:
    put_away: list[str] = []

    @contextlib.contextmanager
    def held() -> Iterator[None]:
        try:
            yield
        finally:
            ask()
            with contextlib.suppress(FileNotFoundError):
                raise FileNotFoundError
            ask()
            put_away.append("all of it")

    with pytest.raises(ends.Ended), ends.asked_to_end(), held():
        ask()
    assert put_away == ["all of it"]
