"""What a residual is worth: noise floor, correlation time, information per sample.

Neighbouring samples of a residual are not independent. In motion, n samples with integrated correlation time τ (in
samples, τ = 1 + 2 Σ ρ_k) carry n / τ pieces of information; a stretch at rest carries one, its level, because whatever
error put it there stays for as long as it lasts. Each sample gets the weight 1 / (σ² τ) of its kind of stretch, with σ
the residual's own size (model error included), so a sum of squares times these weights is comparable to a prior's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.discovery.interface import Problem

Array = NDArray[np.float64]

_FIRST_TIME_SHARE: Final = 1.0 / 40.0
"""Correlation time that is assumed before a residual is known, as a share of a stretch of motion."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretches:
    """The record cut where motion turns into rest, a block ends or samples are missing.

    Attributes
    ----------
    start, stop : (k,) int64
        Half-open ranges of samples.
    rest : (k,) bool
        Whether the stretch stands still.
    """

    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    rest: NDArray[np.bool_]

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
        return cls(start[keep], stop[keep], rest[start[keep]])


@dataclass(frozen=True, slots=True)
class Scales:
    """Sizes of a residual in units of the measurement.

    Attributes
    ----------
    motion, rest : float
        Root mean square in motion; of the levels at rest. NaN where the record has none.
    correlation_samples : float
        Integrated correlation time in motion.
    """

    motion: float
    rest: float
    correlation_samples: float


def correlation_samples(residual: Array, stretches: Stretches) -> float:
    """Return the integrated correlation time of a residual in motion, in samples (at least 1).

    The autocorrelation is pooled over the stretches and taken about zero, since a model's error has no business having
    a mean; the sum is cut at the first window that is five times its own result (Sokal's rule).
    """
    pieces = [
        residual[a:b] for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True) if not rest
    ]
    pieces = [piece for piece in pieces if len(piece) >= 4]
    if not pieces:
        return 1.0
    longest = max(len(piece) for piece in pieces)
    size = 1 << (2 * longest - 1).bit_length()
    power = np.zeros(size // 2 + 1)
    pairs = np.zeros(longest)
    for piece in pieces:
        power += np.abs(np.fft.rfft(piece, size)) ** 2
        pairs[: len(piece)] += np.arange(len(piece), 0, -1)
    product = np.fft.irfft(power, size)[:longest]
    if product[0] <= 0.0:
        return 1.0
    rho = (product / pairs) / (product[0] / pairs[0])
    tau = 1.0 + 2.0 * np.cumsum(rho[1:])
    window = np.flatnonzero(np.arange(1, longest) >= 5.0 * tau)
    return float(max(1.0, tau[window[0]] if len(window) else tau.max(initial=1.0)))


def residual_scales(residual: Array, stretches: Stretches) -> Scales:
    """Return the sizes of a residual in motion and at rest and its correlation time."""
    square, count, levels = 0.0, 0, []
    for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True):
        if rest:
            levels.append(np.mean(residual[a:b] ** 2))
        else:
            square += float(np.sum(residual[a:b] ** 2))
            count += int(b - a)
    return Scales(
        motion=float(np.sqrt(square / count)) if count else float("nan"),
        rest=float(np.sqrt(np.mean(levels))) if levels else float("nan"),
        correlation_samples=correlation_samples(residual, stretches),
    )


def information(problem: Problem, stretches: Stretches, scales: Scales, *, floor: Array | None = None) -> Array:
    """Return the weight per sample, 1 / (σ² τ); zero where a sample does not count.

    Parameters
    ----------
    floor : (n,) array, optional
        Standard deviation per sample that no model can undercut; the scales count beyond it only where they are larger.
    """
    weight = np.zeros(len(problem.observed))
    least = problem.sigma if floor is None else floor
    for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True):
        size = scales.rest if rest else scales.motion
        variance = np.maximum(size**2 if np.isfinite(size) else 0.0, least[a:b] ** 2)
        weight[a:b] = 1.0 / (variance * (b - a if rest else min(scales.correlation_samples, b - a)))
    return weight


def first_scales(problem: Problem, stretches: Stretches) -> Scales:
    """Return the scales that are assumed before any model was fitted."""
    lengths = (stretches.stop - stretches.start)[~stretches.rest]
    size = max(problem.resolution, float(np.median(problem.sigma[problem.valid])))
    return Scales(motion=size, rest=size, correlation_samples=max(1.0, float(lengths.mean() * _FIRST_TIME_SHARE)))


def reading_noise(problem: Problem, stretches: Stretches) -> float:
    """Return the standard deviation of the reading noise, measured from the record.

    At rests from the spread about a slow trend; where the record never rests from third differences, which a smooth
    motion leaves almost nothing in (variance of a third difference of white noise: 20 σ²).
    """
    rests = [
        problem.observed[a:b]
        for a, b, rest in zip(stretches.start, stretches.stop, stretches.rest, strict=True)
        if rest and b - a >= 16
    ]
    pieces = rests or [
        problem.observed[a:b] for a, b in zip(stretches.start, stretches.stop, strict=True) if b - a >= 16
    ]
    if not pieces:
        return float(np.median(problem.sigma[problem.valid]))
    square = np.concatenate([np.diff(piece, 3) for piece in pieces])
    # The median is blind to the odd glitch; 0.6745² is the median of a squared standard normal.
    return float(np.sqrt(np.median(square**2) / 0.6745**2 / 20.0))


def noise_floor(problem: Problem, stretches: Stretches, *, input_noise: Array) -> float:
    """Return the root mean square residual that no model can remove: reading noise, and noise on the inputs."""
    reading = reading_noise(problem, stretches)
    return float(np.sqrt(reading**2 + np.mean(input_noise[problem.valid] ** 2)))
