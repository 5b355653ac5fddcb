"""Text of the recording: the summary and the list of events."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from torsight.actuator.quantities import effect_values
from torsight.core.files.results import RunResults, column
from torsight.core.words.wording import (
    capital,
    clock_words,
    effect_name,
    error_words,
    estimate,
    fixed,
    held_out_errors,
    number,
    verdict_sentence,
)

WARNINGS: Final = ("occlusion", "lost", "damage", "clipped", "timestamps", "jump", "bump", "light")
"""Kinds of events that deserve a person's attention."""


class Event(NamedTuple):
    """One line of the events' pane."""

    time_s: float
    level: str
    text: str


def run_events(results: RunResults) -> list[Event]:
    """Return the events of a run in the order of their times: tracking, clocks, fit, verdict."""
    found = []
    for event in (results.track or {}).get("events") or []:
        kind = str(event.get("kind", "event"))
        level = "WARN" if any(kind.startswith(word) for word in WARNINGS) else "INFO"
        found.append(Event(float(event.get("time_s") or 0.0), level, f"{effect_name(kind)}: {event.get('text', '')}"))
    for count, begin in enumerate(half_cycle_begins(results), 1):
        found.append(Event(begin.time_s, "INFO", f"half-cycle {count}: spring {begin.spring} is driven"))
    start_s, end_s = span_s(results)
    if results.sync is not None:
        known = clock_words(results.sync, unknown="not fixed by this record")
        clocks = ", ".join(f"{name} {value}" for name, value in known)
        found.append(Event(start_s, "INFO", f"clocks: {clocks}"))
    if results.fit is not None:
        friction = (results.fit.get("parameters") or {}).get("tau_c_mnm")
        words = "" if friction is None else f", friction torque {estimate(friction)}"
        rms = number(results.fit.get("rmse_deg"))
        found.append(Event(end_s, "INFO", f"plain model: rms {rms}°{words}"))
    if results.discovery is not None:
        found.append(Event(end_s, "INFO", f"verdict: {verdict_sentence(results.discovery)}"))
    return sorted(found, key=lambda event: event.time_s)


class HalfCycleBegin(NamedTuple):
    """Start of a half-cycle: time, measured angle (NaN where not known), and the driven spring (A or B)."""

    time_s: float
    angle_deg: float
    spring: str


def half_cycle_begins(results: RunResults) -> list[HalfCycleBegin]:
    """Return the starts of the half-cycles of a run whose model has been fitted; none without a fit."""
    table = results.curves
    if table is None or not {"half_cycle", "active"} <= set(table.columns):
        return []
    half = column(table, "half_cycle")
    rows = np.flatnonzero(np.diff(half, prepend=-np.inf) > 0.0)
    return [
        HalfCycleBegin(float(row["time_s"]), float(row["angle_deg"]), str(row["active"]).upper())
        for row in table.iloc[rows].to_dict("records")
    ]


def span_s(results: RunResults) -> tuple[float, float]:
    """Return first and last time of the record on the film's clock; zeros where there is none."""
    table = results.first_of("angle", "merged", "curves")
    if table is None:
        return 0.0, 0.0
    time_s = column(table, "time_s")
    return float(time_s[0]), float(time_s[-1])


def summary_document(results: RunResults) -> str:
    """Return the summary in Markdown."""
    discovery = results.discovery
    title = results.folder.resolve().name if discovery is None else verdict_sentence(discovery)
    rows = []
    if discovery is not None:
        before, after = held_out_errors(discovery)
        if before is not None and after is not None:
            rows.append(("Error on held-out half-cycles", f"{error_words(before)} → {error_words(after)} rms"))
        if discovery.get("noise_floor_deg") is not None:
            rows.append(("Noise floor", error_words(discovery["noise_floor_deg"])))
    friction = results.parameters().get("tau_c_mnm")
    if friction is not None:
        rows.append(("Friction torque", estimate(friction)))
    for effect in (discovery or {}).get("effects") or []:
        named = str(effect.get("title") or effect_name(str(effect["id"])))
        rows.append((capital(named), effect_values(effect)))
    rows += [("Law", str(law["sentence"])) for law in (discovery or {}).get("laws") or [] if law.get("sentence")]
    rows += _motion(results)
    return "\n".join([f"### {title}", "", *(f"- **{name}** {words}" for name, words in rows), ""])


def _motion(results: RunResults) -> list[tuple[str, str]]:
    angle = results.measured_angle_deg()
    if results.angle is None or not len(angle):
        return []
    known = results.measured_frames()
    low, high = (fixed(float(end), 1) for end in (angle.min(), angle.max()))
    return [
        ("Range of motion", f"{np.ptp(angle):.1f}° ({low}° to {high}°)"),
        ("Frames measured", f"{int(known.sum())} of {len(known)}"),
    ]
