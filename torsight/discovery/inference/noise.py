"""Noise floor, correlation time and information per sample of a residual.

Neighbouring samples of a residual are not independent. In motion, n samples with integrated correlation time τ (in
samples, τ = 1 + 2 Σ ρ_k) carry n / τ pieces of information; a stretch at rest carries one, its level, because the error
of the level lasts as long as the rest. Each sample gets the weight 1 / (σ² τ) of its kind of stretch, with σ the
residual's own size (model error included), so a sum of squares times these weights is comparable to a prior's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from torsight.core.series import correlation_time, rms, scatter
from torsight.core.units import Flags, Floats, Ints
from torsight.discovery.interface import Problem
from torsight.discovery.weight import Weight

_LEAST_PIECE: Final = 16
"""Fewest samples of a piece from which its noise is estimated: the median of 13 third differences gives it to a third,
one over the root of 2 · 13 · 0.37 (efficiency of the median deviation)."""
_FIRST_TIME_SHARE: Final = 1.0 / 40.0
"""Correlation time that is assumed before a residual is known, as a share of a stretch of motion."""
_STILL: Final = 0.01
"""Relative change of the inputs' noise from row to row up to which the model stands still: of 24 draws, one that moves
by the noise changes it by two hundredths."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """The record cut where motion turns into rest, a block ends or samples are missing.

    Stretch k is the samples from ``start`` to before ``stop`` (k,); it stands still where ``rest``, and lies in a block
    before which the state is not known where ``opening``. ``share`` (n,) is the weight of every sample in motion, in
    samples: less than one where samples lie closer than usual.
    """

    start: Ints
    stop: Ints
    rest: Flags
    opening: Flags
    share: Floats

    @classmethod
    def of(cls, problem: Problem) -> Stretches:
        """Cut a problem's record; samples that are not valid belong to no stretch."""
        valid, rest = problem.valid, problem.rest
        n = len(valid)
        cut = np.ones(n + 1, bool)
        cut[1:n] = (valid[1:] != valid[:-1]) | (rest[1:] != rest[:-1]) | (problem.block[1:] != problem.block[:-1])
        edges = np.flatnonzero(cut)
        start, stop = edges[:-1], edges[1:]
        keep = valid[start]
        opening = np.isin(problem.block[start[keep]], problem.opening_blocks)
        share = np.asarray(problem.share, np.float64)
        return cls(start[keep], stop[keep], rest[start[keep]], opening, share)

    def counts(self, correlation_samples: float) -> Floats:
        """Return the pieces of information (n,) of the samples; their sum is one in a rest, one or more in motion."""
        found = np.zeros(len(self.share))
        for a, b, rest in zip(self.start, self.stop, self.rest, strict=True):
            share = self.share[a:b]
            found[a:b] = 1.0 / (b - a) if rest else share / min(max(correlation_samples, 1.0), float(share.sum()))
        return found

    def counts_with(self, count: Floats, part: Floats, time_s: Floats, alike_s: Floats) -> Floats:
        """Return the pieces of information (n,) of samples in which a part (n,) of the variance is correlated longer.

        ``count`` (n,) are those without that part, which is correlated over ``alike_s`` (n,) seconds at least.
        Correlation times of independent errors add up with the errors' shares of the variance.
        """
        found = count.copy()
        for a, b, rest in zip(self.start, self.stop, self.rest, strict=True):
            duration_s = float(time_s[b - 1] - time_s[a])
            if not rest and duration_s > 0.0:
                step_s = duration_s * self.share[a:b] / self.share[a:b].sum()
                slower = np.maximum(1.0 / count[a:b], np.minimum(alike_s[a:b], duration_s) / step_s)
                found[a:b] = 1.0 / ((1.0 - part[a:b]) / count[a:b] + part[a:b] * slower)
        return found

    def lasting(self, noise: Floats, block: Ints) -> Flags:
        """Return the rows (n, k) of each group of rests that share a level; ``noise`` (n,) is the prediction's.

        Where nothing moves in the model, its error stays the same: rests of a block between which only the reading
        moves have one.
        """
        rest, still = np.full(len(noise), -1), np.isclose(noise, np.roll(noise, 1), rtol=_STILL)
        for number, (a, b) in enumerate(self.split()[0]):
            rest[a:b] = number
        runs = np.cumsum(~still | (np.diff(block, prepend=block[0] - 1) != 0))
        pairs = np.unique(np.column_stack([runs, rest])[(rest >= 0) & (noise > 0.0)], axis=0)
        found, times = np.unique(pairs[:, 0], return_counts=True)
        return np.asarray((runs[:, None] == found[times > 1]) & (rest >= 0)[:, None])

    def split(self) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        """Return the ranges at rest and those in motion."""
        ranges = [(int(a), int(b)) for a, b in zip(self.start, self.stop, strict=True)]
        at_rest = self.rest.tolist()
        return (
            [item for item, rest in zip(ranges, at_rest, strict=True) if rest],
            [item for item, rest in zip(ranges, at_rest, strict=True) if not rest],
        )


@dataclass(frozen=True, slots=True)
class Scales:
    """Sizes of a residual beyond the floor, in units of the measurement.

    ``motion`` and ``rest`` are the standard deviations to be added (in squares) to the floor in motion, and to that of
    a rest's level; ``correlation_samples`` is the integrated correlation time in motion.
    """

    motion: float
    rest: float
    correlation_samples: float


def _whole_samples(residual: Floats, share: Floats) -> Floats:
    """Return means over neighbours whose shares add up to one sample."""
    starts = np.flatnonzero(np.diff(np.floor(np.cumsum(share) - 0.5 * share), prepend=-1.0))
    weighed: Floats = np.add.reduceat(residual * share, starts) / np.add.reduceat(share, starts)
    return weighed


def correlation_samples(residual: Floats, stretches: Stretches) -> float:
    """Return the integrated correlation time of a residual in motion, in whole samples (at least 1)."""
    return correlation_time(
        [
            _whole_samples(residual[a:b], stretches.share[a:b])
            for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True)
            if not rest
        ]
    )


def residual_scales(residual: Floats, stretches: Stretches, floor: Floats) -> Scales:
    """Return the standard deviations to be added to the floor to account for a residual, in motion and at rest.

    Each is the standard deviation s for which the mean of r² / (floor² + s²) is one.
    """
    levels, motion = stretches.split()
    level = np.array([rms(residual[a:b]) for a, b in levels])
    level_floor = np.array([rms(floor[a:b]) for a, b in levels])
    rows = np.concatenate([np.arange(a, b) for a, b in motion]) if motion else np.zeros(0, np.int64)
    return Scales(
        motion=_excess(residual[rows], floor[rows]),
        rest=_excess(level, level_floor),
        correlation_samples=correlation_samples(residual, stretches),
    )


def _excess(residual: Floats, floor: Floats) -> float:
    """Return s with mean(r² / (floor² + s²)) = 1, or 0 where the floor already accounts for the residual."""
    if not len(residual):
        return 0.0
    square, least = residual**2, np.maximum(floor**2, 1e-30)
    low, high = 0.0, float(square.mean())
    if np.mean(square / least) <= 1.0:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.mean(square / (least + middle)) > 1.0:
            low = middle
        else:
            high = middle
    return float(np.sqrt(high))


def information(stretches: Stretches, scales: Scales, floor: Floats) -> Weight:
    """Return 1 / (σ² τ) per sample with σ² = floor² + scale², zero where it does not count; no error is shared."""
    size = np.full(len(floor), scales.motion)
    for a, b in stretches.split()[0]:
        size[a:b] = scales.rest
    return Weight.of(stretches.counts(scales.correlation_samples) / (1e-30 + floor**2 + size**2))


def first_scales(problem: Problem, stretches: Stretches) -> Scales:
    """Return the scales that are assumed before any model was fitted."""
    lengths = (stretches.stop - stretches.start)[~stretches.rest]
    size = max(problem.resolution, float(np.median(problem.sigma[problem.valid])))
    return Scales(motion=size, rest=size, correlation_samples=max(1.0, float(lengths.mean() * _FIRST_TIME_SHARE)))


def reading_noise(problem: Problem, stretches: Stretches, residual: Floats) -> float:
    """Return the standard deviation of the reading noise, estimated from the record.

    It is estimated from the measured values at rests, where they are constant; without rests from a fit's residual,
    which contains the noise and little of the motion. Where missing samples cut all stretches short, or the record is
    short, samples across the gaps are taken as neighbours.
    """
    levels, motion = stretches.split()
    moving = problem.valid & ~problem.rest
    blocks = (residual[moving & (problem.block == label)] for label in np.unique(problem.block[moving]))
    for pieces in ((problem.observed[a:b] for a, b in levels), (residual[a:b] for a, b in motion), blocks):
        long = [piece for piece in pieces if len(piece) >= _LEAST_PIECE]
        if long:
            return scatter(*long)
    left = residual[problem.valid]
    return scatter(left) if len(left) > 3 else float(np.median(problem.sigma[problem.valid]))
