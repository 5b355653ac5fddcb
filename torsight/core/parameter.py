"""A number of a model with its unit, bounds, prior and the value at which it vanishes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from statistics import NormalDist
from typing import Final

from torsight.core.files.storage import plain
from torsight.core.frozen import Frozen


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a model, in the unit that its name ends in.

    Attributes
    ----------
    name : str
        Public name, the same in code, files and report; ends in its unit (``tau_c_mnm``, ``lag_s``).
    value : float
        Start value, nominal value or fitted value.
    unit : str
        Unit for display (``"mN·m"``, ``"°C"``, ``""`` for a plain number).
    lower, upper : float
        Bounds; infinite where there is none.
    sigma : float or None
        One standard deviation of the prior around ``value``; None means no prior.
    null : float or None
        Value at which an effect's parameter leaves the plain model unchanged.
    fixed : bool
        True where the value is taken as exact.
    symbol, title : str
        Symbol in an equation, with an underscore before an index, and meaning in a few words; empty where not stated.
    """

    name: str
    value: float
    unit: str
    lower: float = -math.inf
    upper: float = math.inf
    sigma: float | None = None
    null: float | None = None
    fixed: bool = False
    symbol: str = ""
    title: str = ""

    def at(self, value: float) -> Parameter:
        """Return the same parameter with another value."""
        return replace(self, value=value)


REACH: Final = NormalDist().inv_cdf(0.975)
"""Standard deviations from the value to either end of a 95 % interval of a normal distribution."""


@dataclass(frozen=True, slots=True)
class Estimate(Frozen):
    """A fitted value with its standard deviation and 95 % interval, all in ``unit``.

    ``sigma`` is NaN and the interval infinite where the record says nothing about the parameter.
    """

    value: float
    sigma: float
    ci95: tuple[float, float]
    unit: str
    fixed: bool = False

    @classmethod
    def normal(
        cls, value: float, sigma: float, unit: str, *, lower: float = -math.inf, upper: float = math.inf
    ) -> Estimate:
        """Return the estimate of a value with normal errors, with its interval limited to the value's bounds."""
        return cls(value, sigma, (max(value - REACH * sigma, lower), min(value + REACH * sigma, upper)), unit)

    def to_json(self) -> dict[str, object]:
        """Return the form of the estimate in the JSON outputs (non-finite numbers become null)."""
        content: dict[str, object] = plain(asdict(self))
        return content


def estimates_to_json(estimates: Mapping[str, Estimate]) -> dict[str, dict[str, object]]:
    """Return the form of estimates by name in the JSON outputs."""
    return {name: one.to_json() for name, one in estimates.items()}
