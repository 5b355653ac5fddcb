"""Pulls: distances of fitted from characterised values, in standard deviations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from torsight.core.errors import TorsightError
from torsight.core.files.results import RunResults
from torsight.core.files.storage import read_toml
from torsight.core.words.wording import CONTRADICTED_SIGMAS, decimals_for, fixed


@dataclass(frozen=True, slots=True)
class Prior:
    """A characterised value and its standard deviation, in the parameter's own unit."""

    value: float
    sigma: float | None

    def words(self) -> str:
        """Return ``60.0 ± 1.8``."""
        if self.sigma is None:
            return f"{self.value:g}, taken as exact"
        decimals = decimals_for(self.sigma)
        return f"{fixed(self.value, decimals)} ± {fixed(self.sigma, decimals)}"

    def pull(self, fitted: Mapping[str, Any] | None) -> float | None:
        """Return how many standard deviations the fit lies from the characterised value."""
        value = None if fitted is None else fitted.get("value")
        if value is None or self.sigma is None or self.sigma <= 0.0:
            return None
        return (float(value) - self.value) / self.sigma

    def interval(self, fitted: Mapping[str, Any]) -> tuple[float, float] | None:
        """Return the 95 % interval of a fit in the same unit; None where there is none."""
        low, high = fitted.get("ci95") or (None, None)
        if low is None or high is None or fitted.get("fixed") or not self.sigma:
            return None
        return (float(low) - self.value) / self.sigma, (float(high) - self.value) / self.sigma


def contradicted(pull: float | None) -> bool:
    """Return whether a fit lies further from a characterised value than chance explains."""
    return pull is not None and abs(pull) > CONTRADICTED_SIGMAS


def common_reach(pulls: Iterable[float | None]) -> float:
    """Return the half-width, in standard deviations, at which pulls can be compared by eye: chance lies within."""
    return max([CONTRADICTED_SIGMAS, *(1.1 * abs(pull) for pull in pulls if pull is not None)])


def priors(results: RunResults) -> dict[str, Prior]:
    """Return the characterised values: those that the model file carries, else those of the actuator file used."""
    content = (results.model or {}).get("actuator")
    if not isinstance(content, Mapping):
        content = _actuator_file(results)
    sigmas = content.get("uncertainty") or {}
    values = {
        key: value
        for table, keys in content.items()
        if table != "uncertainty" and isinstance(keys, Mapping)
        for key, value in keys.items()
    }
    return {
        key: Prior(float(value), _positive(sigmas.get(key)))
        for key, value in values.items()
        if isinstance(value, (int, float)) and math.isfinite(value)
    }


def _actuator_file(results: RunResults) -> Mapping[str, Any]:
    configuration = (results.provenance or {}).get("configuration") or {}
    name = (configuration.get("actuator") or {}).get("file")
    if not isinstance(name, str):
        return {}
    try:
        return read_toml(results.folder / name)
    except TorsightError:
        # The report may be made again where the actuator file is no longer at hand.
        return {}


def _positive(sigma: Any) -> float | None:
    return float(sigma) if isinstance(sigma, (int, float)) and sigma > 0 else None
