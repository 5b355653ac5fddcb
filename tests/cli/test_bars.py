"""Bars: the time left from the pace so far, whatever the pace; a step that begins again begins anew."""

from __future__ import annotations

import pytest

from torsight.cli.bars import Bars, LeftColumn


@pytest.fixture
def clock() -> list[float]:
    """Return the time, s, that the bars go by."""
    return [100.0]


def left(bars: Bars, place: int = 0) -> str:
    return LeftColumn().render(bars.shown.tasks[place]).plain


def bars_of(clock: list[float]) -> Bars:
    return Bars(now=lambda: clock[0])


def test_slow_steps_tell_their_time_left_and_it_goes_down(clock: list[float]) -> None:
    bars = bars_of(clock)
    bars.report("experiments", 0, 4)
    assert left(bars) == "-:--:-- left"
    clock[0] += 90.0
    bars.report("experiments", 1, 4)
    assert left(bars) == "0:04:30 left"
    clock[0] += 60.0
    assert left(bars) == "0:03:30 left"
    clock[0] += 1000.0
    assert left(bars) == "0:00:00 left"


def test_a_step_that_begins_again_begins_anew(clock: list[float]) -> None:
    bars = bars_of(clock)
    for done in (0, 1, 2):
        bars.report("refits", done, 2)
        clock[0] += 50.0
    bars.report("refits", 0, 10)
    clock[0] += 2.0
    bars.report("refits", 1, 10)
    assert left(bars) == "0:00:18 left"
    assert len(bars.shown.tasks) == 1


def test_an_amount_that_is_not_known_has_no_time_left(clock: list[float]) -> None:
    bars = bars_of(clock)
    bars.report("rig", 0, None)
    clock[0] += 5.0
    assert left(bars) == "-:--:-- left"
    bars.report("rig", 1, 1)
    assert not left(bars)
