"""Strokes of a film and heatings of a log, as their shares of time and of temperature part them."""

import numpy as np
import pytest

from sync.signals.heating_segments import log_signals
from sync.signals.strokes import find_strokes
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG


def film(place_s, angle_deg, *, fps=10.0):
    time_s = np.arange(0.0, place_s[-1], 1.0 / fps)
    angle = np.interp(time_s, place_s, angle_deg) + 0.05 * np.random.default_rng(0).standard_normal(len(time_s))
    everywhere = np.ones(len(time_s), bool)
    return StickAngles(np.arange(len(time_s)), time_s, angle * DEG, np.full(len(time_s), 1e-3), everywhere, everywhere)


@pytest.mark.parametrize(
    ("pause_s", "behind_s", "strokes"), [(10.0, 60.0, 1), (22.0, 60.0, 2), (4.0, 4.0, 1), (7.5, 10.0, 2)]
)
def test_a_pause_that_is_short_against_the_motion_does_not_end_a_stroke(pause_s, behind_s, strokes):
    stops_s = np.cumsum([0.0, 50.0, 100.0, pause_s, behind_s, 50.0])
    found = find_strokes(film(stops_s, [0.0, 0.0, 100.0, 100.0, 140.0, 140.0]))
    assert len(found) == strokes
    assert sum(stroke.length_rad for stroke in found) == pytest.approx(140.0 * DEG, abs=0.2 * DEG)


@pytest.mark.parametrize(("rise_c", "later_s", "heats"), [(60.0, 0.0, False), (60.0, 15.0, False), (15.0, 300.0, True)])
def test_the_smaller_of_two_rises_at_a_time_is_the_other_springs_warmth(rise_c, later_s, heats):
    time_s = np.arange(0.0, 900.0, 0.25)
    shape = np.interp(time_s, [0.0, 100.0, 300.0, 400.0, 600.0], [0.0, 0.0, 1.0, 0.0, 0.0])
    after = np.interp(time_s - later_s, time_s, shape)
    noise = 0.03 * np.random.default_rng(1).standard_normal((2, len(time_s)))
    log = TemperatureLog(time_s, 24.0 + 75.0 * shape + noise[0], 24.0 + rise_c * after + noise[1])
    segments = log_signals(log, max_gap_s=2.0).segments
    assert [(segment.spring, segment.heating) for segment in segments if segment.spring == "a"] == [
        ("a", True),
        ("a", False),
    ]
    assert any(segment.spring == "b" for segment in segments) is heats
