"""Pairs of a film's angle and a temperature log with a known clock, made by arithmetic of their own.

Wire temperatures are ramps, holds and Newton cooling, written down in closed form. The angle follows an explicit
inverse phase law: for every angle of a stroke there is one temperature at which it is reached, a cosine law over the
stroke plus a stress term that is linear in the angle; warming pushes on, never back. The sensor follows the wire with
a first-order lag. Nothing of the code under test is used.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles

ROOM_C = 24.0
STEP_S = 0.02


@dataclass(frozen=True)
class HalfCycle:
    spring: str
    rate_c_s: float
    peak_c: float
    hold_s: float
    rest_s: float
    steps_c: tuple[float, ...] = ()
    step_s: float = 60.0


@dataclass(frozen=True)
class Rig:
    cooling_s: float = 40.0
    lag_s: float = 0.0
    start_c: float = 47.6
    window_c: float = 18.0
    stress_c_per_deg: float = 0.0107
    snap_c: float = 51.5
    snap_window_c: float = 4.5
    home_deg: float = 178.0
    full_deg: float = 415.0
    temp_noise_c: float = 0.03
    angle_noise_deg: float = 0.06
    passive_share: float = 0.1
    threshold_scatter_c: float = 0.0
    late_s: float = 0.0
    """How late a heated spring's motion is in the middle of a stroke; at its ends half of it."""


@dataclass
class Pair:
    film_s: np.ndarray
    angle_deg: np.ndarray
    log_s: np.ndarray
    temp_a_c: np.ndarray
    temp_b_c: np.ndarray
    heat_a: np.ndarray
    heat_b: np.ndarray
    offset_s: float
    drift_ppm: float
    switch_true_s: np.ndarray = field(default_factory=lambda: np.empty(0))


def programme(seed, *, half_cycles=8, rates=(0.08, 0.2), incomplete=True, hold=(10.0, 40.0), rest_s=300.0):
    """Half-cycles A, B, A, B, ... with rates drawn at random and, late in it, one incomplete pair."""
    rng = np.random.default_rng(seed)
    cycles = []
    for index in range(half_cycles):
        partial = incomplete and index in (half_cycles - 4, half_cycles - 3)
        cycles.append(
            HalfCycle(
                spring="ab"[index % 2],
                rate_c_s=float(rng.uniform(*rates)),
                peak_c=60.0 if partial else float(rng.uniform(73.0, 80.0)),
                hold_s=float(rng.uniform(*hold)),
                rest_s=rest_s,
            )
        )
    return cycles


def stairs(cycle):
    """Return times and temperatures of a heating's corners: a ramp, held at every step on the way up."""
    times, temps = [0.0], [ROOM_C]
    for target_c in cycle.steps_c:
        times += [times[-1] + (target_c - temps[-1]) / cycle.rate_c_s]
        times += [times[-1] + cycle.step_s]
        temps += [target_c, target_c]
    return [*times, times[-1] + (cycle.peak_c - temps[-1]) / cycle.rate_c_s], [*temps, cycle.peak_c]


def wire_temperatures(cycles, rig):
    """Return time and true wire temperatures of both springs on a fine grid, and when each was switched on and off."""
    total = sum(stairs(c)[0][-1] + c.hold_s + c.rest_s for c in cycles)
    time_s = np.arange(0.0, total, STEP_S)
    temps = {"a": np.full(len(time_s), ROOM_C), "b": np.full(len(time_s), ROOM_C)}
    number = np.zeros(len(time_s), dtype=int)
    begin, off_times = 0.0, []
    for index, c in enumerate(cycles):
        knots_s, knots_c = stairs(c)
        ramp_s = knots_s[-1]
        top, off, end = begin + ramp_s, begin + ramp_s + c.hold_s, begin + ramp_s + c.hold_s + c.rest_s
        x = time_s
        rise = (x >= begin) & (x < top)
        keep = (x >= top) & (x < off)
        fall = (x >= off) & (x < end)
        shape = np.zeros(len(time_s))
        shape[rise] = np.interp(x[rise] - begin, knots_s, knots_c) - ROOM_C
        shape[keep] = c.peak_c - ROOM_C
        shape[fall] = (c.peak_c - ROOM_C) * np.exp(-(x[fall] - off) / rig.cooling_s)
        temps[c.spring] += shape
        other = "b" if c.spring == "a" else "a"
        temps[other] += rig.passive_share * shape
        number[(x >= begin) & (x < end)] = index
        off_times.append((begin, off))
        begin = end
    return time_s, temps, number, np.array(off_times)


def motion(cycles, rig, time_s, temps, number, seed=0):
    """Return the true angle in degrees."""
    rng = np.random.default_rng([seed, 99])
    angle = np.empty(len(time_s))
    at = rig.home_deg
    for index, c in enumerate(cycles):
        inside = number == index
        sign = -1.0 if c.spring == "a" else 1.0
        wire = temps[c.spring][inside]
        start = sign * at  # from here the stroke goes up in mirrored coordinates
        peak_at = int(np.argmax(wire))
        scatter = rig.threshold_scatter_c * rng.standard_normal()
        full = rig.full_deg * (360.0 - start) / (360.0 + rig.home_deg)
        share = np.linspace(0.0, 1.0, 2001)
        reached = start + full * share
        law = (
            rig.start_c
            + scatter
            + rig.stress_c_per_deg * (reached + rig.home_deg)
            + rig.window_c * np.arccos(1.0 - 2.0 * share) / np.pi
        )
        late = rig.late_s * c.rate_c_s * (0.5 + 0.5 * np.sin(np.pi * share))
        highest = np.maximum.accumulate(wire)
        up = np.interp(highest, law + late, reached, left=start, right=start + full)
        hot = float(up[-1])
        lowest = np.minimum.accumulate(wire[peak_at:])
        back = max(0.0, (hot - rig.home_deg) * 0.9)
        part = np.clip((rig.snap_c + scatter - lowest) / rig.snap_window_c, 0.0, 1.0)
        path = up.copy()
        path[peak_at:] = up[peak_at:] - back * (1.0 - np.cos(np.pi * part)) / 2.0
        angle[inside] = sign * path
        at = float(angle[inside][-1])
    return angle


def lagged(wire_c, lag_s):
    """First-order lag, exact for a straight line between the grid's points."""
    if lag_s == 0.0:
        return wire_c.copy()
    decay = np.exp(-STEP_S / lag_s)
    held = 1.0 - (1.0 - decay) * lag_s / STEP_S
    b = np.array([held, 1.0 - decay - held])
    # y[n] = decay y[n-1] + b1 x[n] + b2 x[n-1] for the mean over the step
    out, _ = lfilter(b, [1.0, -decay], wire_c, zi=[wire_c[0] * (1.0 - b[0])])
    return out


def make_pair(
    seed,
    *,
    rig=None,
    cycles=None,
    offset_s=0.0,
    drift_ppm=0.0,
    film_fps=4.0,
    log_step_s=0.25,
    film_span_s=None,
    lost_share=0.0,
    log_lead_s=0.0,
    log_tail_s=0.0,
):
    """Film and log of one run; temperature time = film time * (1 + drift) + offset.

    ``log_lead_s``: how long the log ran at room temperature before the film began (and after it ended).
    """
    rig = rig or Rig()
    rng = np.random.default_rng([seed, 7])
    cycles = cycles or programme(seed)
    time_s, temps, number, switches = wire_temperatures(cycles, rig)
    angle = motion(cycles, rig, time_s, temps, number, seed)
    begin, end = film_span_s or (0.0, time_s[-1])
    film_s = np.arange(begin, end, 1.0 / film_fps)
    seen = np.interp(film_s, time_s, angle) + rig.angle_noise_deg * rng.standard_normal(len(film_s))
    true_s = np.arange(-log_lead_s, time_s[-1] + log_tail_s, log_step_s) + rng.uniform(0.0, log_step_s)
    keep = rng.random(len(true_s)) >= lost_share
    true_s = true_s[keep]
    read = {}
    for name in "ab":
        clean = np.interp(true_s, time_s, lagged(temps[name], rig.lag_s))
        read[name] = np.round(clean + rig.temp_noise_c * rng.standard_normal(len(true_s)), 2)
    # The switch exactly as it is at each stamp: rounded to the fine grid it would come late by half a step of that.
    heats = {name: np.zeros(len(true_s), bool) for name in "ab"}
    for cycle, (on_s, off_s) in zip(cycles, switches, strict=True):
        heats[cycle.spring] |= (true_s >= on_s) & (true_s < off_s)
    film_zero = film_s - begin
    return Pair(
        film_s=film_zero,
        angle_deg=seen,
        log_s=(true_s - begin) * (1.0 + drift_ppm * 1e-6) + offset_s,
        temp_a_c=read["a"],
        temp_b_c=read["b"],
        heat_a=heats["a"],
        heat_b=heats["b"],
        offset_s=offset_s,
        drift_ppm=drift_ppm,
        switch_true_s=switches - begin,
    )


def records(pair):
    """Return the pair as the records that the code under test takes."""
    count = len(pair.film_s)
    sigma = np.full(count, np.deg2rad(0.06))
    everywhere = np.ones(count, dtype=bool)
    angles = StickAngles(np.arange(count), pair.film_s, np.deg2rad(pair.angle_deg), sigma, everywhere, everywhere)
    return angles, TemperatureLog(pair.log_s, pair.temp_a_c, pair.temp_b_c, pair.heat_a, pair.heat_b)
