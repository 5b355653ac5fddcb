"""Offset and drift between film and log by the best evidence that there is.

In this order: values that are given; an event that both saw (a light that shows the heating switch); what motion and
temperature say together. Where nothing moves the offset stays unknown and is not guessed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from sync.belief import DRIFT_SIGMA_PPM, Belief, ClockEstimate, conclude
from sync.evidence import MotionEvidence, motion_evidence
from torsight.core.errors import NoResultError
from torsight.core.records import ClockMap, TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import PPM

_GIVEN_SIGMA_S: Final = 1e-6
_GIVEN_SIGMA_PPM: Final = 1e-3
_FEW_RATES: Final = 0.08
_WIDE_S: Final = 1.0
_ADVICE: Final = (
    "give the offset (--offset, [sync] offset_s), or film a light that shows the heating switch (led_events), or heat at "
    "two clearly different rates with one heating cut short"
)


def estimate_clock(
    angles: StickAngles,
    log: TemperatureLog,
    *,
    given_offset_s: float | None = None,
    given_drift_ppm: float | None = None,
) -> ClockMap:
    """Return the clock map with 95 % intervals.

    Parameters
    ----------
    angles : StickAngles
        Angle on the film's clock.
    log : TemperatureLog
        Temperatures on the logging clock.
    given_offset_s, given_drift_ppm : float, optional
        Values that are known; taken as exact.

    Raises
    ------
    NoResultError
        When the offset is not given and nothing in the files tells it.
    """
    if given_offset_s is not None and given_drift_ppm is not None:
        exact = (given_offset_s, given_offset_s), (given_drift_ppm, given_drift_ppm)
        return ClockMap(given_offset_s, given_drift_ppm, *exact, method="given offset and drift")
    prior = _given(given_offset_s, given_drift_ppm)
    evidence = motion_evidence(angles, log, prior=prior if given_offset_s is not None else None)
    if evidence is None:
        if given_offset_s is None:
            raise _unknown(angles, log)
        interval = (-1.96 * DRIFT_SIGMA_PPM, 1.96 * DRIFT_SIGMA_PPM)
        return ClockMap(
            given_offset_s, 0.0, (given_offset_s, given_offset_s), interval, "given offset", ("drift is not known",)
        )
    beliefs = evidence.beliefs
    if given_drift_ppm is not None:
        row = np.array([0.0, 1.0])
        beliefs = tuple(b.updated(row, given_drift_ppm * PPM, (_GIVEN_SIGMA_PPM * PPM) ** 2) for b in beliefs)
    estimate = conclude(beliefs, middle_s=evidence.middle_s)
    if given_offset_s is not None:
        return _as_map(estimate, "given offset; drift from motion and temperature", _notes(evidence, estimate))
    return _as_map(estimate, _method(evidence), _notes(evidence, estimate))


def _given(offset_s: float | None, drift_ppm: float | None) -> Belief:
    offset_sigma = _GIVEN_SIGMA_S if offset_s is not None else 1e6
    drift_sigma = _GIVEN_SIGMA_PPM if drift_ppm is not None else DRIFT_SIGMA_PPM
    return Belief(
        np.array([offset_s or 0.0, (drift_ppm or 0.0) * PPM]),
        np.diag([offset_sigma**2, (drift_sigma * PPM) ** 2]),
        0.0,
    )


def _as_map(estimate: ClockEstimate, method: str, notes: Sequence[str]) -> ClockMap:
    return ClockMap(
        offset_s=estimate.offset_s,
        drift_ppm=estimate.drift_ppm,
        offset_ci95_s=estimate.offset_ci95_s,
        drift_ci95_ppm=estimate.drift_ci95_ppm,
        method=method,
        notes=tuple(notes),
    )


def _method(evidence: MotionEvidence) -> str:
    text = f"motion against temperature: {evidence.matched} of {evidence.strokes} strokes against heating and cooling"
    if evidence.stops:
        text += f", {evidence.stops} abrupt stops against corners of the temperature"
    return text


def _notes(evidence: MotionEvidence, estimate: ClockEstimate) -> list[str]:
    notes: list[str] = []
    low, high = estimate.offset_ci95_s
    if evidence.lag.value_s is None:
        notes.append(
            "the log has no corner from which a lag of the sensor could be read; lags up to 15 s are in the interval"
        )
    elif evidence.lag.value_s > 0.3 and not evidence.stops:
        notes.append(
            f"the log's corners are rounded as by a sensor that is {evidence.lag.value_s:.2g} s late; taken as its lag. If "
            f"something else rounds them, the offset is larger by up to that much: the interval covers both"
        )
    if evidence.rate_spread < _FEW_RATES and not evidence.stops:
        notes.append(
            "all heatings have about the same rate and none was cut short: an offset, a lag and a threshold cannot be told "
            f"apart here; to narrow it, {_ADVICE}"
        )
    elif high - low > _WIDE_S:
        notes.append(f"the interval is {high - low:.3g} s wide; to narrow it, {_ADVICE}")
    weights = np.array([belief.log_weight for belief in evidence.beliefs])
    offsets = np.array([belief.mean[0] for belief in evidence.beliefs])
    likely = offsets[weights > weights.max() - 6.0]
    if np.ptp(likely) > 30.0 and len(evidence.plateaus) > 1:
        notes.append("the programme repeats itself: shifts by whole cycles explain the motion about as well")
    if evidence.swapped:
        notes.append("the motion fits better with the springs the other way round: check which channel is A")
    return notes


def _unknown(angles: StickAngles, log: TemperatureLog) -> NoResultError:
    known = angles.angle_rad[angles.valid & np.isfinite(angles.angle_rad)]
    moved = math.degrees(float(np.ptp(known))) if len(known) else 0.0
    rises = [float(np.nanmax(t) - np.nanmin(t)) for t in (log.temp_a_c, log.temp_b_c) if np.isfinite(t).any()]
    return NoResultError(
        "the offset between film and log is unknown: no motion fits the heating and cooling",
        where="angle and temperatures",
        value=f"motion over {moved:.3g}°, temperatures over {max(rises, default=0.0):.3g} °C",
        limit="strokes of 3° and more, heatings of 12 °C and more, at an offset that explains them",
        do=_ADVICE,
    )
