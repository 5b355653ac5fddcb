"""Findings on a temperature log, and on the actuator driven by it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from sync import LogReading, read_temperature_log
from sync.log.timestamps import longest_gap_s
from sync.signals.heating_segments import HeatingSegment, Spring, log_signals
from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.record.log_noise import NEGLIGIBLE_C, SHORTEST, last_digit, measure_noise
from torsight.actuator.record.slow_log import SLOW_S
from torsight.actuator.spec import ActuatorSpec
from torsight.cli.checkup.finding import RESIDUAL_DEG, Check, Finding, refusal
from torsight.cli.checkup.rig import HalfCycle, Limits, distinct_rates, half_cycles_of, limits_of, steepest_deg_per_c
from torsight.cli.checkup.separable import Separable, separable
from torsight.core.errors import TorsightError
from torsight.core.progress import Progress, silent
from torsight.core.records import SyncedTable
from torsight.core.series import rms, rounding_variance, runs, usual_step
from torsight.core.units import DEG, Flags, Floats
from torsight.core.words.wording import counted, effect_name, listed, number

_FEW: Final = 4
"""Half-cycles with motion that a record needs: either spring heated at either of two rates. With fewer, a held-out
half-cycle has no similar one in the fit."""


@dataclass(slots=True)
class LogCheck(Check):
    """Result of checking a log, and the log as read."""

    reading: LogReading | None = None


def check_log(
    path: Path, *, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> LogCheck:
    """Check a log alone: rate, gaps, repairs, ranges, noise."""
    check = LogCheck("log")
    try:
        reading = check.reading = read_temperature_log(path, columns=columns, units=units)
    except TorsightError as error:
        check.refuse(error)
        return check
    log = reading.log
    check.findings += [Finding("log", "note", f"{note}.") for note in reading.notes]
    step = np.diff(log.time_s)
    usual = usual_step(log.time_s)
    check.duration_s = float(log.time_s[-1] - log.time_s[0] + usual)
    ranges = {}
    for name, temp_c in (("temp_a_c", log.temp_a_c), ("temp_b_c", log.temp_b_c)):
        good = np.isfinite(temp_c)
        ranges[name] = {
            "min": float(np.nanmin(temp_c)),
            "max": float(np.nanmax(temp_c)),
            "noise": measure_noise(log.time_s[good], temp_c[good])[0],
            "resolution": last_digit(temp_c[good]),
        }
    check.content = {
        "rows": len(log),
        "duration_s": check.duration_s,
        "interval_s": {"median": usual, "max": float(step.max())},
        "ranges": ranges,
        "heating_switches": log.heat_a is not None and log.heat_b is not None,
        "repairs": [repair.to_json() for repair in reading.repairs],
        "restarts": len(reading.restarts),
    }
    _look_at_rows(check, reading, usual)
    _look_at_pulses(check, reading)
    return check


def _look_at_rows(check: LogCheck, reading: LogReading, usual_s: float) -> None:
    for repair in reading.repairs:
        level = "note" if repair.kind not in ("gap", "stuck", "restart") else "limits"
        check.add(level, repair.text.rstrip(".") + ".")
    if usual_s > SLOW_S:
        text = f"has a row every {usual_s:.2g} s: corners of the temperature, where a heating ends, fall between rows."
        check.add("limits", text, "log once a second or faster")
    if not check.content["heating_switches"]:
        text = "has no heating switches (heat_a, heat_b): which spring is driven is read from the temperatures."
        check.add("fine", text)


def _look_at_pulses(check: LogCheck, reading: LogReading) -> None:
    more_c = ripple_c(reading)
    check.content["ripple_c"] = more_c
    if not more_c:
        return
    springs = listed(
        [f"{number(size_c, 2)} °C more than at rest while {name.upper()} is heated" for name, size_c in more_c.items()]
    )
    text = (
        f"the readings scatter by {springs}: with a heater that is switched on and off the wire follows the peaks "
        "between readings, and they are too few to show them."
    )
    check.add("limits", text, f"log {PLENTY} readings per pulse, or pulse faster")


def check_programme(
    reading: LogReading, spec: ActuatorSpec, *, where: str, progress: Progress = silent
) -> tuple[list[Finding], dict[str, Any]]:
    """Check the actuator's response to the log: full heatings, rates, holds, and what discovery can find."""
    limits = limits_of(spec)
    if limits is None:
        text = "by these values the actuator never moves: friction holds it, or nothing can be recovered."
        return [Finding("actuator", "stops", text, "check theta_p_deg, theta_cr_deg, tau_c_mnm and the moduli")], {}
    content: dict[str, Any] = {
        "moves_from_c": limits.onset_c,
        "fully_heated_at_c": limits.full_c,
        "fully_cooled_at_c": limits.cooled_c,
        "range_deg": limits.range_deg,
    }
    try:
        drive = driven_by(reading, spec, limits, where=where)
    except TorsightError as error:
        return [refusal("log", error)], content
    cycles = half_cycles_of(drive, limits)
    findings = _look_at_cycles(cycles, limits)
    content["half_cycles"] = [asdict(cycle) for cycle in cycles]
    if not any(cycle.peak_c > limits.onset_c for cycle in cycles):
        return findings, content
    angle_deg = ActuatorModel(spec).simulate(drive).angle_rad / DEG
    active_c = drive.temps_by_role()[0]
    steepest = steepest_deg_per_c(angle_deg, active_c)
    content["steepest_deg_per_c"] = steepest
    content["expected_rate_deg_s"] = float(np.nanquantile(np.abs(np.gradient(angle_deg, drive.time_s)), 0.99))
    left_deg = float(np.median(drive.temp_sigma_c)) * steepest
    noise_c = drive.noise_c
    if noise_c > 0.0:
        level = "limits" if left_deg > RESIDUAL_DEG else "fine"
        text = (
            f"noise of {noise_c:.2g} °C; after smoothing, the remaining error moves the angle by {left_deg:.2g}° where "
            f"it is steepest ({steepest:.0f}° per °C)."
        )
        findings.append(Finding("log", level, text, "" if level == "fine" else "shield the sensors", left_deg))
    found = separable(spec, drive, progress=progress)
    content["discovery"] = asdict(found)
    return [*findings, *_look_at_separable(found, cycles)], content


def driven_by(reading: LogReading, spec: ActuatorSpec, limits: Limits, *, where: str) -> Drive:
    """Return the drive of the log with the actuator at home before the first heating."""
    model = ActuatorModel(spec)
    log = reading.log

    def prepared(start_deg: float) -> Drive:
        angle = np.full(len(log), start_deg * DEG)
        sigma = np.full(len(log), 1e-3)  # any value: nothing is fitted to these angles
        table = SyncedTable(log.time_s, angle, sigma, log.temp_a_c, log.temp_b_c, log.heat_a, log.heat_b)
        return model.prepare(table, where=where)

    drive = prepared(limits.start_deg)
    return drive if drive.cycles.springs[0] == 0 else prepared(-limits.start_deg)


def _look_at_cycles(cycles: Sequence[HalfCycle], limits: Limits) -> list[Finding]:
    """Report incomplete heatings and coolings of the springs, and the number of half-cycles."""
    findings: list[Finding] = []
    moving = [cycle for cycle in cycles if cycle.peak_c > limits.onset_c]
    peaks = ", ".join(f"{cycle.peak_c:.1f} °C ({cycle.spring.upper()})" for cycle in cycles)
    if not moving:
        text = f"no heating reaches {limits.onset_c:.1f} °C, where the actuator begins to move (peaks: {peaks})."
        return [Finding("log", "stops", text, f"heat to {limits.full_c:.0f} °C and more")]
    full = [cycle for cycle in cycles if cycle.peak_c >= limits.full_c]
    text = (
        f"{counted(len(cycles), 'half-cycle')} with peaks of {peaks}; {len(full)} of the {len(moving)} that move "
        f"anything reach {limits.full_c:.1f} °C, where the transformation is complete."
    )
    level = "limits" if not full else "fine"
    advice = f"heat at least once to {limits.full_c:.0f} °C" if not full else ""
    findings.append(Finding("log", level, text, advice))
    warm = [cycle for cycle in cycles[:-1] if cycle.end_c > limits.cooled_c]
    if warm:
        text = (
            f"{counted(len(warm), 'half-cycle')} with a spring that has not cooled to {limits.cooled_c:.1f} °C, "
            "where it is martensite again, as the model assumes."
        )
        findings.append(Finding("log", "limits", text, "let each spring cool for longer"))
    if len(moving) < _FEW:
        text = f"only {counted(len(moving), 'half-cycle')} with motion: an effect is accepted on held-out half-cycles."
        findings.append(Finding("record", "limits", text, "record four and more, both springs, at two rates"))
    return findings


def _look_at_separable(found: Separable, cycles: Sequence[HalfCycle]) -> list[Finding]:
    """Report which effects discovery will and will not be able to find, and why."""
    rates = distinct_rates(cycles)
    visible = listed([effect_name(name) for name in found.visible]) or "no effect"
    level = "fine" if found.visible else "limits"
    findings = [Finding("record", level, f"discovery would see {visible} at usual size.")]
    if found.hidden:
        names = listed([effect_name(name) for name in found.hidden])
        text = f"{names} would be too small to see, or be taken up by the characterised values."
        findings.append(Finding("record", "note", text, "add half-cycles, rates, and incomplete heatings"))
    if found.alike:
        pairs = "; ".join(f"{effect_name(one)} and {effect_name(other)}" for one, other in found.alike)
        same = " All heatings have one rate." if len(rates) < 2 else ""
        advice = "heat at two rates that differ by three times, hold once in mid-stroke, end one heating early"
        findings.append(Finding("record", "limits", f"cannot be distinguished: {pairs}.{same}", advice))
    return findings


PLENTY: Final = 20
"""Readings per pulse that resolve its shape (benchmarks/actuator/pulsed_heaters.py)."""


def ripple_c(reading: LogReading) -> dict[Spring, float]:
    """Return the scatter of a spring's readings beyond that at rest, °C, in the heating in which it is largest.

    It is a ripple of the temperature, from a heater that is switched on and off within seconds. The wire's
    transformation only advances while it is heated, so it follows the peaks, whose height the conditioning of a log
    knows only to half of it (:mod:`torsight.actuator.record.ripple`), unless there are many readings per pulse.
    Differences between neighbouring readings are compared between heatings and rests: noise and the last digit are the
    same in both. Where the temperature is merely curved, these differences grow with the distance between the readings;
    with pulses they rise and fall.

    Only springs are included whose ripple exceeds the remaining scatter and moves the angle. Timestamps that are
    truncated to whole steps, and readings that are held for several rows, show no ripple.
    """
    log = reading.log
    found: dict[Spring, float] = {}
    if reading.coarse_s > 0.0:
        return found
    segments = log_signals(log, max_gap_s=longest_gap_s(log.time_s)).segments
    springs: tuple[Spring, ...] = ("a", "b")
    for spring in springs:
        own = [segment for segment in segments if segment.spring == spring]
        known = np.isfinite(log.temp_c(spring))
        most = _most_restless(log.time_s[known], log.temp_c(spring)[known], own)
        if most > NEGLIGIBLE_C:
            found[spring] = most
    return found


def _most_restless(time_s: Floats, temp_c: Floats, segments: list[HeatingSegment]) -> float:
    inside = [(time_s >= segment.begin_s) & (time_s <= segment.end_s) for segment in segments]
    heated = [rows for segment, rows in zip(segments, inside, strict=True) if segment.heating]
    if not heated:
        return 0.0
    still = _sizes(time_s, temp_c, ~np.logical_or.reduce(inside))
    # Readings that do not change at rest have the error of the last digit when the temperature changes.
    still = np.maximum(still, rounding_variance(last_digit(temp_c)))
    changing = [rows for rows in heated if 2 * np.count_nonzero(np.diff(temp_c[rows])) >= np.count_nonzero(rows)]
    return max((_beyond(_sizes(time_s, temp_c, rows), still) for rows in changing), default=0.0)


def _beyond(driven: Floats, still: Floats) -> float:
    """Return the scatter of a heating beyond that at rest, from both variances by stride; 0 without pulses."""
    count = min(len(driven), len(still))
    if count == 0:
        return 0.0
    driven, still = driven[:count], still[:count]
    at = int(np.argmax(driven - still))
    later = np.minimum.accumulate(driven[::-1])[::-1]
    bends_only = at == count - 1 and float((driven - later).max()) <= still[at]
    return 0.0 if bends_only or driven[at] <= 2.0 * still[at] else float(np.sqrt(driven[at] - still[at]))


def _sizes(time_s: Floats, temp_c: Floats, rows: Flags) -> Floats:
    """Return the variance of one reading by stride, for the strides with enough differences."""
    longest = max((end - begin for begin, end in runs(rows)), default=0)
    strides = range(1, min(PLENTY // 2, (longest - SHORTEST) // 3) + 1)
    return np.square([_scatter(time_s, temp_c, rows, stride) for stride in strides])


def _scatter(time_s: Floats, temp_c: Floats, rows: Flags, stride: int) -> float:
    """Return the standard deviation of one reading, from third divided differences, in which parabolas vanish."""
    found = [np.zeros(0)]
    for begin, end in runs(rows):
        count = end - begin - 3 * stride
        if count <= 0:
            continue
        at = begin + stride * np.arange(4)[:, None] + np.arange(count)
        apart_s = time_s[at][:, None] - time_s[at][None, :]
        weight = 1.0 / np.where(apart_s == 0.0, 1.0, apart_s).prod(axis=1)
        found.append(np.abs((weight * temp_c[at]).sum(axis=0)) / np.sqrt(np.square(weight).sum(axis=0)))
    size = np.concatenate(found)
    # Corners of the temperature cause the largest differences, but few.
    return rms(np.minimum(size, np.quantile(size, 0.95)))
