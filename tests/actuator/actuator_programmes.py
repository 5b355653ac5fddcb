"""Temperature programmes and records for the tests: made by hand, not by the package."""

from __future__ import annotations

import numpy as np

from torsight.core.records import TemperatureLog

STEP_S = 0.5


def half_cycle(points: list[tuple[float, float]], *, room_c: float, cool_s: float, decay_s: float):
    """One spring's temperature: ramps to the given (°C, rate °C/s) one after the other, then natural cooling."""
    parts, now = [], room_c
    for target, rate in points:
        duration = max(STEP_S, abs(target - now) / rate)
        time_s = np.arange(0.0, duration, STEP_S)
        parts.append(now + (target - now) * time_s / duration)
        now = target
    parts.append(np.full(20, now))
    time_s = np.arange(0.0, cool_s, STEP_S)
    parts.append(room_c + (now - room_c) * np.exp(-time_s / decay_s))
    return np.concatenate(parts)


def programme(halves, *, room_c: float = 23.0, cool_s: float = 260.0, decay_s: float = 45.0):
    """Log of a chain of half-cycles: [(spring, points), …]; the other spring stays at room temperature.

    Returns the log and the temperatures of the driven spring, half-cycle by half-cycle.
    """
    temps = [half_cycle(points, room_c=room_c, cool_s=cool_s, decay_s=decay_s) for _, points in halves]
    count = sum(map(len, temps))
    columns = [np.full(count, room_c), np.full(count, room_c)]
    heat = [np.zeros(count, bool), np.zeros(count, bool)]
    place = 0
    for (spring, _), own in zip(halves, temps, strict=True):
        columns[spring][place : place + len(own)] = own
        heat[spring][place : place + int(np.argmax(own)) + 1] = True
        place += len(own)
    log = TemperatureLog(STEP_S * np.arange(count), columns[0], columns[1], heat_a=heat[0], heat_b=heat[1])
    return log, temps
