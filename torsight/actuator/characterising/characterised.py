"""The result of a characterisation: the steps of one spring, and the estimates from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from torsight.actuator.spec import ActuatorSpec
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, estimates_to_json
from torsight.core.units import Floats
from torsight.core.words.shown import Shown
from torsight.core.words.wording import estimate as words


@dataclass(frozen=True, slots=True, eq=False)
class Step(Frozen):
    """One step: its estimates, its error, and the measured and fitted curves.

    ``curves`` are (x, measured, fitted) by name; ``beyond`` holds the rows of the logs outside the fitted range.
    """

    estimates: Mapping[str, Estimate]
    rmse: float
    r2: Mapping[str, float]
    curves: Mapping[str, tuple[Floats, Floats, Floats]]
    beyond: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return values and errors."""
        return {"parameters": estimates_to_json(self.estimates), "rmse": self.rmse, "r2": dict(self.r2)}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Characterisation(Frozen, Shown):
    """All steps of one spring, and the estimates from them.

    Attributes
    ----------
    steps : mapping of str to Step
        ``free_recovery`` and ``free_recovery_tanaka``, ``force_angle``, ``block_heating``, ``block_cooling``.
    better_law : str
        The phase law with the smaller error in the free recovery.
    estimates : mapping of str to Estimate
        Characterised values by the names of ``actuator.toml``.
    spec : ActuatorSpec
        The content of ``actuator.toml``.
    """

    steps: Mapping[str, Step]
    better_law: str
    estimates: Mapping[str, Estimate]
    spec: ActuatorSpec

    def facts(self) -> dict[str, str]:
        """Return the better phase law and the values with their intervals."""
        values = {name: words(estimate.to_json()) for name, estimate in self.estimates.items()}
        return {"better phase law": self.better_law, **values}

    def __repr__(self) -> str:
        return f"Characterisation({', '.join(self.estimates)}; better phase law {self.better_law})"

    def _columns(self) -> dict[str, Any]:
        estimates = list(self.estimates.values())
        return {
            "name": list(self.estimates),
            "value": [one.value for one in estimates],
            "sigma": [one.sigma for one in estimates],
            "low": [one.ci95[0] for one in estimates],
            "high": [one.ci95[1] for one in estimates],
            "unit": [one.unit for one in estimates],
        }

    def _draw(self, axes: Any) -> None:
        """Draw the free recovery, measured and fitted with the better law."""
        step = "free_recovery" if self.better_law == "liang_rogers" else f"free_recovery_{self.better_law}"
        for name, (x, measured, fitted) in self.steps[step].curves.items():
            axes.plot(x, measured, ".", markersize=2, label=f"{name}, measured")
            axes.plot(x, fitted, label=f"{name}, fitted")
        axes.set(xlabel="temperature, °C", ylabel="recovered angle, °")
        axes.legend()

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``characterisation.json``."""
        plain, other = self.steps["free_recovery"].rmse, self.steps["free_recovery_tanaka"].rmse
        return {
            "parameters": estimates_to_json(self.estimates),
            "phase_law": {"better": self.better_law, "rmse_deg": {"liang_rogers": plain, "tanaka": other}},
            "steps": {name: step.to_json() for name, step in self.steps.items()},
        }
