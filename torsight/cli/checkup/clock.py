"""Interval of the offset between the film's clock and the log's that a run will give, before there is a film.

``sync`` is run on a synthetic film (the model's angles for this log, with the camera's noise at the film's rate), or on
an existing table of angles, so that heating rates, the log's noise and step, the sensor's lag and a shared event have
the same effect as in a run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sync import LightEvents, LogReading, find_clock
from sync.clock.estimation import ADVICE, WIDE_S
from sync.signals.switchings import switchings_of
from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.cli.checkup.finding import Finding, refusal
from torsight.cli.checkup.log import driven_by
from torsight.cli.checkup.rig import limits_of
from torsight.core.errors import NoResultError, TorsightError
from torsight.core.records import ClockMap, TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG, PPM, Floats
from torsight.core.words.wording import number


@dataclass(frozen=True, slots=True)
class Filming:
    """Properties of the film: rate, length (0: as long as the log) and standard deviation of the angle.

    Without a film an ordinary film is assumed: thirty frames a second, and a standard deviation of a twentieth of a
    degree, as round dots of a few pixels give.
    """

    rate_fps: float = 30.0
    duration_s: float = 0.0
    sigma_deg: float = 0.05


def predict_clock(
    reading: LogReading,
    settings: Mapping[str, Any],
    *,
    spec: ActuatorSpec | None = None,
    angles: StickAngles | None = None,
    filming: Filming,
) -> tuple[list[Finding], dict[str, Any]]:
    """Return the expected intervals of offset and drift, as findings and as figures.

    ``settings`` is the table ``[sync]`` of the experiment. Without ``angles`` a film of the model's angles is
    simulated, with the properties of ``filming``.
    """
    offset_s, drift_ppm = settings.get("offset_s"), settings.get("drift_ppm")
    if offset_s is not None:
        text = f"the offset is given ({number(float(offset_s))} s) and taken as exact."
        return [Finding("clock", "fine", text)], {"offset_s": float(offset_s), "offset_ci95_s": 0.0}
    limits = None if spec is None else limits_of(spec)
    # The made-up film runs on the film's clock.
    on_film = replace(reading.log, time_s=reading.log.time_s / (1.0 + (drift_ppm or 0.0) * PPM))
    try:
        if angles is None:
            if spec is None or limits is None:
                return [], {}
            drive = driven_by(replace(reading, log=on_film), spec, limits, where="log")
            angles = made_up_film(drive, spec, filming)
        light = _made_up_led(on_film, angles.time_s) if {"led", "led_events"} & set(settings) else None
        clock = find_clock(angles, reading, given_drift_ppm=drift_ppm, light=light).clock
    except NoResultError as error:
        return [
            Finding("clock", "limits", "motion and temperature would not determine the offset.", error.do or ADVICE)
        ], {}
    except TorsightError as error:
        return [refusal("clock", error)], {}
    half_s, half_ppm = (float(np.ptp(ends)) / 2.0 for ends in (clock.within_s, clock.drift_ci95_ppm))
    figures = {"offset_ci95_s": half_s, "drift_ci95_ppm": half_ppm, "method": clock.method}
    return [_said(clock, half_s, half_ppm)], figures


def _said(clock: ClockMap, half_s: float, half_ppm: float) -> Finding:
    """Return the finding on a clock whose intervals have these half-widths, s and ppm."""
    text = (
        f"the offset between film and log would be known to ±{number(half_s, 2)} s, their drift to "
        f"±{number(half_ppm, 2)} ppm (95 %), from {clock.method.partition(':')[0]}."
    )
    wide = 2.0 * half_s > WIDE_S
    return Finding("clock", "limits" if wide else "fine", text, ADVICE if wide else "")


def made_up_film(drive: Drive, spec: ActuatorSpec, filming: Filming) -> StickAngles:
    """Return the angles of a simulated film of the model: of the whole log, or of its middle if the film is shorter."""
    angle_rad = ActuatorModel(spec).simulate(drive).angle_rad
    first_s, last_s = float(drive.time_s[0]), float(drive.time_s[-1])
    spare_s = max(0.0, last_s - first_s - filming.duration_s) if filming.duration_s else 0.0
    time_s = np.arange(first_s + 0.5 * spare_s, last_s - 0.5 * spare_s, 1.0 / filming.rate_fps)
    sigma_rad, count = filming.sigma_deg * DEG, len(time_s)
    noise = sigma_rad * np.random.default_rng(0).standard_normal(count)
    known = np.ones(count, np.bool_)
    angle = np.interp(time_s, drive.time_s, angle_rad) + noise
    return StickAngles(np.arange(count), time_s, angle, np.full(count, sigma_rad), known, known)


def _made_up_led(log: TemperatureLog, frame_s: Floats) -> LightEvents | None:
    """Return the first frames that would show a change of the heating switch; None where the log has no switch."""
    switch = log.heat_a if log.heat_a is not None else log.heat_b
    if switch is None:
        return LightEvents(frame_s[:1], np.ones(1, np.bool_))
    changes = switchings_of(log.time_s, switch)
    frames = np.searchsorted(frame_s, changes.time_s)
    seen = (frames > 0) & (frames < len(frame_s))
    return LightEvents(frame_s[frames[seen]], changes.goes_on[seen])
