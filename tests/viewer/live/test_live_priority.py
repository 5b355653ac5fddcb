"""Threads that measure are served first where the system allows it, and only they, and only as long as they measure."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import pytest

from torsight.viewer.live.priority import SWITCH_S, TRACKING, quick_turns, served_first

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="this system has no such priorities")


def test_a_measuring_thread_goes_first_and_what_it_starts_does_not() -> None:
    before = os.sched_getscheduler(0)
    others: list[int] = []
    with served_first(TRACKING) as first:
        inside = os.sched_getscheduler(0)
        other = threading.Thread(target=lambda: others.append(os.sched_getscheduler(0)))
        other.start()
        other.join()
        code = "import os; print(os.sched_getscheduler(0))"
        child = int(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout)
    # An ordinary user gets none of it, and loses nothing.
    assert (inside == os.SCHED_RR | os.SCHED_RESET_ON_FORK) is first
    assert others == [os.SCHED_OTHER]
    assert child == os.SCHED_OTHER
    assert os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == before


def test_a_system_that_refuses_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object) -> None:
        raise PermissionError

    before = os.sched_getscheduler(0)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with served_first(TRACKING) as first:
        assert not first
    assert os.sched_getscheduler(0) == before


def test_nothing_changes_where_it_is_not_wanted() -> None:
    before = os.sched_getscheduler(0)
    with served_first(TRACKING, wanted=False) as first:
        assert not first
        assert os.sched_getscheduler(0) == before


def test_turns_at_the_interpreter_are_as_before_afterwards() -> None:
    before = sys.getswitchinterval()
    with quick_turns():
        assert sys.getswitchinterval() == pytest.approx(SWITCH_S)
    assert sys.getswitchinterval() == before
