"""Crossings of common angles by strokes of one kind: when, on the film, and how they are correlated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sync.clock.clock_priors import PRIORS
from sync.signals.heating_segments import HeatingSegment
from sync.signals.strokes import Stroke
from torsight.core.units import DEG

_SHARES: Final = np.array([0.015, 0.04, 0.09, 0.17, 0.28, 0.42, 0.57, 0.72, 0.85, 0.94])
"""Levels as shares of the longest stroke of a kind; the last bit of a stroke creeps and is left out."""
WHOLE_STROKE: Final = 0.955
"""Share of a whole stroke that is used. Of one that was cut short the last level is not: its end falls on a corner of
the temperature if the motion is a little late."""


@dataclass(frozen=True, slots=True, eq=False)
class ThresholdCrossings:
    """Crossings of levels, one row each, and what is known of their temperatures before the clock is.

    Attributes
    ----------
    time_s, time_sigma_s : (n,) float64
        Film time of each crossing.
    spring_b, heating : (n,) bool
        Which spring drives, and whether it is heated.
    stroke, kind, cell : (n,) int64
        Number of the stroke; of its kind (spring, heating or cooling); of the level of its kind.
    shared : (n,) float64
        Number of strokes that pass the same level of the same kind.
    common_c2 : (n, n) float64
        Covariance, °C², of what is not known about a kind of stroke: its curve, its dependence on where it began.
    scatter : (n, n) float64
        Covariance of the scatter between strokes, for a scatter of 1 °C.
    middle_s : float
        Film time at which the offset is pinned.
    """

    time_s: NDArray[np.float64]
    time_sigma_s: NDArray[np.float64]
    spring_b: NDArray[np.bool_]
    heating: NDArray[np.bool_]
    stroke: NDArray[np.int64]
    kind: NDArray[np.int64]
    cell: NDArray[np.int64]
    shared: NDArray[np.float64]
    common_c2: NDArray[np.float64]
    scatter: NDArray[np.float64]
    middle_s: float

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(slots=True)
class _Rows:
    """Columns while they grow."""

    time_s: list[NDArray[np.float64]]
    sigma_s: list[NDArray[np.float64]]
    spring_b: list[NDArray[np.bool_]]
    stroke: list[NDArray[np.int64]]
    kind: list[NDArray[np.int64]]
    level: list[NDArray[np.int64]]
    far_deg: list[NDArray[np.float64]]
    heating: list[NDArray[np.bool_]]


def collect_crossings(
    strokes: Sequence[Stroke], segments: Sequence[HeatingSegment | None]
) -> ThresholdCrossings | None:
    """Read the crossings of common levels from strokes that have a segment; ``None`` where there are none."""
    kinds: dict[tuple[str, bool], list[int]] = {}
    for index, segment in enumerate(segments):
        if segment is not None:
            kinds.setdefault((segment.spring, segment.heating), []).append(index)
    rows = _Rows([], [], [], [], [], [], [], [])
    for number, ((spring, heating), members) in enumerate(kinds.items()):
        longest_rad = max(strokes[index].length_rad for index in members)
        level_rad = longest_rad * _SHARES
        usual_rad = _most_common(np.array([strokes[index].sign * strokes[index].start_rad for index in members]))
        for index in members:
            stroke = strokes[index]
            far_deg = (stroke.sign * stroke.start_rad - usual_rad) / DEG
            if abs(far_deg) > PRIORS.farthest_deg:
                continue
            at_s, sigma_s = stroke.crossing_s(level_rad)
            share = WHOLE_STROKE if stroke.length_rad > WHOLE_STROKE * longest_rad else _SHARES[-2]
            usable = np.flatnonzero(np.isfinite(at_s) & (level_rad < share * stroke.length_rad))
            count = len(usable)
            rows.time_s.append(at_s[usable])
            rows.sigma_s.append(sigma_s[usable])
            rows.spring_b.append(np.full(count, spring == "b"))
            rows.stroke.append(np.full(count, index, dtype=np.int64))
            rows.kind.append(np.full(count, number, dtype=np.int64))
            rows.level.append(usable.astype(np.int64))
            rows.far_deg.append(np.full(count, far_deg))
            rows.heating.append(np.full(count, heating))
    if sum(len(part) for part in rows.time_s) == 0:
        return None
    return _with_covariances(rows)


def _with_covariances(rows: _Rows) -> ThresholdCrossings:
    stroke, kind, level = np.concatenate(rows.stroke), np.concatenate(rows.kind), np.concatenate(rows.level)
    far_deg, heating = np.concatenate(rows.far_deg), np.concatenate(rows.heating)
    time_s = np.concatenate(rows.time_s)
    share = _SHARES[level]
    cell = kind * len(_SHARES) + level
    same_cell = (cell[:, None] == cell[None, :]).astype(np.float64)
    far_both = far_deg[:, None] * far_deg[None, :]
    tilt = 2.0 * share - 1.0
    # Both springs are of one make: where a stroke begins matters alike for both, and beyond that for each level anew.
    stress = (heating[:, None] == heating[None, :]) * (1.0 + tilt[:, None] * tilt[None, :])
    common = PRIORS.curve_sigma_c**2 * same_cell
    common += far_both * PRIORS.start_sigma_c_per_deg**2 * (stress + same_cell)
    # A stroke misses the curve of its kind as a whole, and smoothly along its way.
    along = np.exp(-0.5 * ((share[:, None] - share[None, :]) / PRIORS.scatter_reach) ** 2)
    same_stroke = stroke[:, None] == stroke[None, :]
    scatter = same_stroke * (1.0 + PRIORS.scatter_shape**2 * along)
    when = 2.0 * (time_s - time_s.min()) / max(float(np.ptp(time_s)), 1e-9) - 1.0
    trend = (kind[:, None] == kind[None, :]) * (when[:, None] * when[None, :]) * (1.0 + tilt[:, None] * tilt[None, :])
    near_c = np.minimum(np.abs(far_deg), PRIORS.near_deg) * np.take(
        PRIORS.near_scatter_c_per_deg, heating.astype(np.int64)
    )
    common += near_c[:, None] * near_c[None, :] * scatter
    return ThresholdCrossings(
        time_s=time_s,
        time_sigma_s=np.concatenate(rows.sigma_s),
        spring_b=np.concatenate(rows.spring_b),
        heating=heating,
        stroke=stroke,
        kind=kind,
        cell=cell,
        shared=same_cell.sum(axis=1),
        common_c2=common + PRIORS.far_scatter_c_per_deg**2 * far_both * scatter,
        # A spring that ages moves all its thresholds one way with time: as likely as scatter from stroke to stroke.
        scatter=scatter + trend,
        middle_s=float(0.5 * (time_s.min() + time_s.max())),
    )


def _most_common(value_rad: NDArray[np.float64]) -> float:
    """Return the value with most others within 15 degrees."""
    near = np.abs(value_rad[:, None] - value_rad[None, :]) < 15.0 * DEG
    return float(value_rad[int(np.argmax(near.sum(axis=1)))])
