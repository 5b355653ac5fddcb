"""Crossings of common angles by strokes of one kind: their film times, and their covariances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sync.clock.clock_priors import PRIORS
from sync.signals.heating_segments import HeatingSegment
from sync.signals.strokes import Stroke
from torsight.core.units import DEG, Flags, Floats, Ints

_SHARES: Final = np.array([0.015, 0.04, 0.09, 0.17, 0.28, 0.42, 0.57, 0.72, 0.85, 0.94])
"""Levels as shares of the longest stroke of a kind; the end of a stroke, where the motion creeps, is left out."""
WHOLE_STROKE: Final = 0.955
"""Share of a whole stroke that is used. The last level of a stroke that was cut short is not used: its end coincides
with a corner of the temperature if the motion is slightly late. Half and twice the distance from 1 move a clock by 0.2
of its standard deviations at most (benchmarks/sync/constants.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class ThresholdCrossings:
    """Crossings of levels, one row each, and the prior covariances of their temperatures.

    ``time_s`` and ``time_sigma_s`` are the film times with their standard deviations; ``spring_b`` and ``heating``
    describe the driving spring; ``stroke``, ``kind`` (spring, heating or cooling) and ``cell`` (level of a kind) are
    numbers. ``common_c2`` (n, n) is the covariance of the unknowns of a kind of stroke: its curve, and its dependence
    on the start angle; ``scatter`` (n, n) is that of a scatter of 1 °C between strokes. ``delay`` (n, d) are the
    polynomials along a stroke that add up to the delay of a motion behind its temperature. The offset is determined at
    the film time ``middle_s``.
    """

    time_s: Floats
    time_sigma_s: Floats
    spring_b: Flags
    heating: Flags
    stroke: Ints
    kind: Ints
    cell: Ints
    common_c2: Floats
    scatter: Floats
    delay: Floats
    middle_s: float

    def __len__(self) -> int:
        return len(self.time_s)


def collect_crossings(
    strokes: Sequence[Stroke], segments: Sequence[HeatingSegment | None]
) -> ThresholdCrossings | None:
    """Return the crossings of common levels by strokes that have a segment; None without any.

    Strokes of one segment, as between the holds of a heating, are parts of one motion: levels count from its start.
    """
    kinds: dict[tuple[str, bool], list[int]] = {}
    for index, segment in enumerate(segments):
        if segment is not None:
            kinds.setdefault((segment.spring, segment.heating), []).append(index)
    rows: list[dict[str, NDArray[Any]]] = []
    for number, ((spring, heating), members) in enumerate(kinds.items()):
        start_rad = {k: strokes[k].sign * strokes[segments.index(segments[k])].start_rad for k in members}
        before_rad = {k: strokes[k].sign * strokes[k].start_rad - start_rad[k] for k in members}
        longest_rad = max(before_rad[index] + strokes[index].length_rad for index in members)
        level_rad = longest_rad * _SHARES
        usual_rad = _most_common(np.array(list(start_rad.values())))
        for index in members:
            stroke, own_rad = strokes[index], level_rad - before_rad[index]
            far_deg = (start_rad[index] - usual_rad) / DEG
            if abs(far_deg) > PRIORS.farthest_deg:
                continue
            at_s, sigma_s = stroke.crossing_s(own_rad)
            reached_rad = before_rad[index] + stroke.length_rad
            share = WHOLE_STROKE if reached_rad > WHOLE_STROKE * longest_rad else _SHARES[-2]
            usable = np.flatnonzero(np.isfinite(at_s) & (own_rad > 0.0) & (own_rad < share * stroke.length_rad))
            # A cooling always ends cold: one that turns the disk less far had another balance of torques.
            short = 0.0 if heating else 1.0 - reached_rad / longest_rad
            same: dict[str, Any] = {"spring_b": spring == "b", "heating": heating, "stroke": index, "kind": number}
            same |= {"far_deg": far_deg, "short": short}
            rows.append(
                {"time_s": at_s[usable], "time_sigma_s": sigma_s[usable], "level": usable}
                | {name: np.full(len(usable), value) for name, value in same.items()}
            )
    if not any(len(row["level"]) for row in rows):
        return None
    return _with_covariances({name: np.concatenate([row[name] for row in rows]) for name in rows[0]})


def _with_covariances(columns: Mapping[str, NDArray[Any]]) -> ThresholdCrossings:
    """Return the crossings with covariances, from columns (n,) with the level and the start's distance, degrees."""
    stroke, kind, level = columns["stroke"], columns["kind"], columns["level"]
    far_deg, heating, time_s = columns["far_deg"], columns["heating"], columns["time_s"]
    share = _SHARES[level]
    short_c = PRIORS.short_cooling_c * columns["short"] * share
    cell = kind * len(_SHARES) + level
    same_cell = (cell[:, None] == cell[None, :]).astype(np.float64)
    far_both = far_deg[:, None] * far_deg[None, :]
    tilt = 2.0 * share - 1.0  # along a stroke, from −1 to 1
    # Both springs are of one kind: the start angle has a common effect for both, and one for each level.
    stress = (heating[:, None] == heating[None, :]) * (1.0 + tilt[:, None] * tilt[None, :])
    common = PRIORS.curve_sigma_c**2 * same_cell
    common += far_both * PRIORS.start_sigma_c_per_deg**2 * (stress + same_cell)
    # A stroke deviates from the curve of its kind by a constant, and by a smooth function along the stroke.
    along = np.exp(-0.5 * ((share[:, None] - share[None, :]) / PRIORS.scatter_reach) ** 2)
    same_stroke = stroke[:, None] == stroke[None, :]
    scatter = same_stroke * (1.0 + PRIORS.scatter_shape**2 * along)
    when = 2.0 * (time_s - time_s.min()) / max(float(np.ptp(time_s)), 1e-9) - 1.0
    trend = (kind[:, None] == kind[None, :]) * (when[:, None] * when[None, :]) * (1.0 + tilt[:, None] * tilt[None, :])
    near_c = np.minimum(np.abs(far_deg), PRIORS.near_deg) * np.take(
        PRIORS.near_scatter_c_per_deg, heating.astype(np.int64)
    )
    common += near_c[:, None] * near_c[None, :] * scatter + same_stroke * short_c[:, None] * short_c[None, :]
    return ThresholdCrossings(
        time_s=time_s,
        time_sigma_s=columns["time_sigma_s"],
        spring_b=columns["spring_b"],
        heating=heating,
        stroke=stroke,
        kind=kind,
        cell=cell,
        common_c2=common + PRIORS.far_scatter_c_per_deg**2 * far_both * scatter,
        # A spring that ages shifts all its thresholds with time: as likely as scatter from stroke to stroke.
        scatter=scatter + trend,
        # Of the second degree: viscous friction delays the middle of a stroke most.
        delay=np.polynomial.legendre.legvander(tilt, 2) * [1.0, PRIORS.delay_shape, PRIORS.delay_shape],
        middle_s=float(0.5 * (time_s.min() + time_s.max())),
    )


def _most_common(value_rad: Floats) -> float:
    """Return the value that has the most other values within 15 degrees."""
    near = np.abs(value_rad[:, None] - value_rad[None, :]) < 15.0 * DEG
    return float(value_rad[int(np.argmax(near.sum(axis=1)))])
