"""A check of scale: each stick's marker distance is constant, and both sticks must give the same scale."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from statistics import NormalDist
from typing import Any, Final

import numpy as np

from torsight.core.errors import NoResultError
from torsight.core.frozen import Frozen
from torsight.core.units import Floats

_STICKS = {"base": [0, 1], "moving": [2, 3]}
_SIGNIFICANT: Final = NormalDist().inv_cdf(1.0 - 0.5e-4)
"""Standard deviations from which a difference of lengths is reported: noise exceeds them once in 10⁴ sticks."""


@dataclass(frozen=True, slots=True)
class StickLength:
    """The measured distance of one stick's markers, and the distance measured by hand, if any.

    ``length_mm`` is the weighted mean over the film; its sigma is enlarged where the scatter exceeds the positions'
    sigmas. ``misfit`` is the root of χ² per degree of freedom of a constant length: about 1, and more where the
    cameras' geometry is wrong (the length then depends on the stick's direction).
    """

    length_mm: float
    sigma_mm: float
    misfit: float
    known_mm: float | None = None

    @property
    def ratio(self) -> float:
        """Ratio of the measured to the known distance; NaN where it is not known."""
        return self.length_mm / self.known_mm if self.known_mm else float("nan")


@dataclass(frozen=True, slots=True)
class ScaleCheck(Frozen):
    """Both sticks' lengths; ``complaints`` names disagreements and is empty where there is none."""

    sticks: Mapping[str, StickLength]
    complaints: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the form of the check in the JSON outputs."""
        sticks = {name: asdict(stick) for name, stick in self.sticks.items()}
        return {"sticks": sticks, "complaints": list(self.complaints)}


def check_scale(
    position_mm: Floats, covariance_mm2: Floats, *, known_mm: Mapping[str, float] | None = None
) -> ScaleCheck:
    """Measure the distance of each stick's markers over a film, and compare.

    Positions (n, 4, 3) are in the order of :data:`torsight.core.tracks.MARKERS`, NaN where not known; ``known_mm``
    holds distances that were measured by hand, for ``base`` and ``moving``.

    Raises NoResultError when a stick is never seen with both markers.
    """
    known = known_mm or {}
    sticks = {
        name: _length(position_mm[:, ends], covariance_mm2[:, ends], name=name, known_mm=known.get(name))
        for name, ends in _STICKS.items()
    }
    return ScaleCheck(sticks, tuple(_complaints(sticks)))


def _length(position: Floats, covariance: Floats, *, name: str, known_mm: float | None) -> StickLength:
    stick = position[:, 1] - position[:, 0]
    length = np.linalg.norm(stick, axis=1)
    along = stick / length[:, None]
    variance = np.einsum("ni,nij,nj->n", along, covariance.sum(axis=1), along)
    good = np.isfinite(length) & np.isfinite(variance)
    if not good.any():
        raise NoResultError(
            f"both markers of the {name} stick are never seen together by both cameras",
            do="film so that all four markers stay in both pictures",
        )
    length, weight = length[good], 1.0 / variance[good]
    mean = float(np.sum(weight * length) / np.sum(weight))
    misfit = float(np.sqrt(np.sum(weight * (length - mean) ** 2) / max(len(length) - 1, 1)))
    sigma = max(misfit, 1.0) / float(np.sqrt(np.sum(weight)))
    return StickLength(mean, sigma, misfit if len(length) > 1 else 1.0, known_mm)


def _complaints(sticks: Mapping[str, StickLength]) -> list[str]:
    found = []
    scales = {}
    for name, stick in sticks.items():
        if stick.misfit > 2.0:
            found.append(
                f"the {name} stick's marker distance is not constant: it scatters {stick.misfit:.1f} times as much "
                "as the markers' sigmas explain; check the calibration and that neither camera moved"
            )
        if stick.known_mm:
            # By hand: a caliper is read to 0.05 mm, and the middles of both dots are found by eye to about as much.
            sigma = float(np.hypot(stick.sigma_mm, 0.1)) / stick.known_mm
            scales[name] = (stick.ratio, sigma)
            if abs(stick.ratio - 1.0) > _SIGNIFICANT * sigma:
                found.append(
                    f"the {name} stick is measured {100.0 * (stick.ratio - 1.0):+.2f} % off its known "
                    f"{stick.known_mm:g} mm; check square_mm of the board"
                )
    if len(scales) == 2:
        (first, first_sigma), (second, second_sigma) = scales.values()
        if abs(first - second) > _SIGNIFICANT * np.hypot(first_sigma, second_sigma):
            found.append(
                f"the two sticks disagree on the scale by {100.0 * abs(first - second):.2f} %; "
                "check their known distances and the stereo geometry"
            )
    return found
