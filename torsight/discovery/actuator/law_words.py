"""A measured law of the actuator in one sentence: the course of its curve, as far as it is certain.

Whether a curve rises, falls, alternates or has a maximum follows from its values on the nodes and their joint
covariance: errors that all values share (an offset that other parameters could take up) do not hide a known slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np
from scipy.optimize import isotonic_regression

from torsight.core.parameter import REACH
from torsight.core.units import Floats
from torsight.core.words.wording import listed, number, variable_name
from torsight.discovery.measured_law import DRIVER_UNITS, MeasuredLaw

_WHAT: Final = {
    "torque": "a stray torque",
    "friction": "friction torque",
    "reading": "the reading's error",
    "temperature": "the wire's temperature less its sensor's",
    "winding": "a spring's torque beside its own",
    "phase": "the recoverable angle",
    "winding_time_s": "a cold spring's torque",
}
"""What a law changes, by its port, or by its own id where that differs."""
_USUAL: Final = "temp_active_c"
"""The driver that a sentence does not name: its unit identifies it."""
_WRONG: Final = 2.0 * NormalDist().cdf(-REACH)
"""Probability that a reported change is none: the complement of a 95 % interval."""
_ROUNDING: Final = float(np.sqrt(np.finfo(np.float64).eps))
"""Rounding error of linear algebra as a share of a curve's size: differences below it count as zero."""


@dataclass(frozen=True, slots=True, eq=False)
class OnNodes:
    """A law on the nodes (k,) that the record reached, in the units of its file: ``places`` are the driver's values.

    ``counted`` says what a law over cycles counts, ``half-cycle``, or ``cycle`` for a spring's own; a law over
    half-cycles has in ``springs`` the driven spring of each, 0 for A.
    """

    places: Floats
    values: Floats
    covariance: Floats
    counted: str = "half-cycle"
    springs: tuple[int, ...] = ()

    def rise(self, i: int, j: int) -> tuple[float, float]:
        """Return the law's change from node ``i`` to node ``j``, and its standard deviation."""
        spread = self.covariance[i, i] + self.covariance[j, j] - 2.0 * self.covariance[i, j]
        return float(self.values[j] - self.values[i]), float(np.sqrt(max(spread, 0.0)))

    @property
    def ways(self) -> tuple[bool, bool]:
        """Whether the law certainly rises somewhere, and whether it certainly falls somewhere.

        Every pair of nodes is tested, so the pairs share the probability of an error (Bonferroni).
        """
        pairs = [self.rise(i, j) for i in range(len(self.places)) for j in range(i + 1, len(self.places))]
        reach = NormalDist().inv_cdf(1.0 - _WRONG / max(1, len(pairs)))
        dust = _ROUNDING * float(np.max(np.abs(self.values)))
        certain = [change for change, sigma in pairs if abs(change) > reach * sigma + dust]
        return any(change > 0.0 for change in certain), any(change < 0.0 for change in certain)

    def monotone(self, *, rising: bool) -> Floats:
        """Return the rising or falling curve (k,) that is nearest to the law (isotonic regression)."""
        dust = _ROUNDING * max(float(np.max(np.abs(self.values))), np.finfo(np.float64).tiny)
        weights = 1.0 / (np.diag(self.covariance) + dust**2)
        return np.asarray(isotonic_regression(self.values, weights=weights, increasing=rising).x, np.float64)

    @property
    def alternates(self) -> bool:
        """Whether every second value is higher than all values between them; for laws over counts."""
        low, high = sorted((self.values[::2], self.values[1::2]), key=lambda one: float(np.mean(one)))
        return float(low.max()) < float(high.min())


def law_sentence(law: MeasuredLaw, tau_c_mnm: float, known: OnNodes) -> str:
    """Return a law in one sentence, over what the record covered.

    The law is in the units of its file, with its number among the laws of its port; ``tau_c_mnm`` is the friction
    torque without the law.
    """
    if law.driver in {"spring", "direction"}:
        return _of_two(law)
    what = _WHAT.get(law.id, _WHAT[law.port])
    if law.way:
        what = f"the transformation's lead over the phase law on {law.way}"
    elif law.beside_sensors:
        what = f"the {law.gives}"
    if law.spring != "both":
        what += f" (spring {law.spring.upper()})"
    beside = "" if law.number == 1 else "beside that, "
    if law.record:
        beside = f"in {law.record}, "
    whole = tau_c_mnm if law.port == "friction" else 100.0 if law.unit == "%" else None
    return f"{beside}{_course(law, what, known, whole)}"


def _of_two(law: MeasuredLaw) -> str:
    """Return the sentence of a law with two values."""
    change = float(law.value[-1] - law.value[0])
    way = "higher" if change > 0.0 else "lower"
    if law.driver == "spring":
        apart = f"{number(abs(change))} °C {way} than spring A's"
        return f"spring B's transformation temperatures are {apart}: [spring_b] of the actuator file can hold its own"
    return f"friction torque is {number(abs(change))} mN·m {way} when the angle rises than when it falls"


def _course(law: MeasuredLaw, what: str, known: OnNodes, whole: float | None) -> str:
    rises, falls = known.ways
    level = None if rises or falls else _level(known, law.unit, whole)
    if level is not None:
        return f"{what} {level} and constant within its 95 % interval"
    driver = law.driver_values[law.covered]
    unit = _spaced(DRIVER_UNITS.get(law.driver, ""))
    counts = law.driver == "cycle"
    range_ = f"from {known.counted} {driver[0]:.0f} to {driver[-1]:.0f}"
    if not counts:
        range_ = f"between {number(driver[0])} and {number(driver[-1])}{unit}"
        if law.driver != _USUAL:
            range_ = f"over {variable_name(law.driver)}, {range_}"
    if not rises and not falls:
        return f"{what} has no certain change {range_}: a constant is within its 95 % interval"
    if rises != falls:
        curve = known.monotone(rising=rises)
        size = _size(float(curve[0]), float(curve[-1]), law.unit, whole)
        return f"{what} {'rises' if rises else 'falls'} by {size} {range_}"
    if counts and known.alternates:
        return f"{what} {_alternating(law, known, whole)}"
    low, high = int(np.argmin(known.values)), int(np.argmax(known.values))
    size = _size(float(known.values[low]), float(known.values[high]), law.unit, whole)
    # The outermost nodes may lie just beyond what the record covered.
    extremes = np.clip(known.places[[high, low]], driver[0], driver[-1])
    at = [f"in {known.counted} {x:.0f}" if counts else f"at {number(x)}{unit}" for x in extremes]
    return f"{what} is highest {at[0]}, {size} above its lowest value {at[1]}, {range_}"


def _size(first: float, last: float, unit: str, whole: float | None) -> str:
    """Return a change with its unit; where a law changes a ``whole``, in per cent of the first value."""
    if whole is not None and whole + first > 0.0:
        return f"{number(100.0 * abs((last - first) / (whole + first)), 2)} %"
    return f"{number(abs(last - first))}{_spaced(unit)}"


def _level(known: OnNodes, unit: str, whole: float | None) -> str | None:
    """Return the value of a constant law in words; None where it is zero within its interval."""
    mean, sigma = float(np.mean(known.values)), float(np.sqrt(max(float(np.mean(known.covariance)), 0.0)))
    if abs(mean) <= REACH * sigma:
        return None
    if whole is not None:
        return f"is {_size(0.0, mean, unit, whole)} {'higher' if mean > 0.0 else 'lower'}"
    return f"is {number(mean)}{_spaced(unit)}"


def _alternating(law: MeasuredLaw, known: OnNodes, whole: float | None) -> str:
    """Return the two values of an alternating law in words, and the half-cycles of the higher one."""
    starts = sorted((0, 1), key=lambda start: float(np.mean(known.values[start::2])))
    added = whole if law.port == "friction" and whole is not None else 0.0
    levels = []
    for start in starts:
        places = range(start, len(known.values), 2)
        weights = 1.0 / np.maximum(np.diag(known.covariance)[start::2], np.finfo(np.float64).tiny)
        mean = float(np.average(known.values[start::2], weights=weights))
        levels.append(number(0.0 if added == 0.0 and _nothing(mean, known, places) else added + mean))
    unit = _spaced(law.unit)
    ends = f"alternates between {levels[0]} and {levels[1]}{unit} from one {known.counted} to the next"
    high = [round(float(x)) for x in known.places[starts[1] :: 2]]
    where = f"higher in {known.counted}s {listed([str(x) for x in high])}"
    driven = {known.springs[x - 1] for x in high if 0 < x <= len(known.springs)}
    others = {known.springs[round(float(x)) - 1] for x in known.places[starts[0] :: 2] if x <= len(known.springs)}
    if len(driven) == 1 and len(others) == 1 and driven != others:
        where += f", in which spring {'AB'[driven.pop()]} is the driven one"
    return f"{ends} ({where})"


def _nothing(mean: float, known: OnNodes, places: range) -> bool:
    """Return whether a mean of some values is zero within its interval."""
    own = known.covariance[np.ix_(places, places)]
    return abs(mean) <= REACH * float(np.sqrt(max(float(np.mean(own)), 0.0)))


def _spaced(unit: str) -> str:
    return unit if unit in {"°", "°/s", ""} else f" {unit}"
