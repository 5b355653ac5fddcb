"""The result of the discovery: the content of ``discovery.json`` and ``curves.csv``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.fitted import FittedModel
from torsight.actuator.quantities import effect_values
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, estimates_to_json
from torsight.core.units import Floats
from torsight.core.words.shown import Shown, draw_models
from torsight.core.words.wording import effect_name, error_words, not_fixed, predicts_worse, verdict_sentence
from torsight.discovery.design.next_experiment import NextExperiment
from torsight.discovery.measured_law import MeasuredLaw


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean square errors in degrees and share of variance explained; NaN where nothing could be held out.

    ``by_half_cycle_deg`` is the error on each half-cycle that was held out, predicted from the others.
    """

    rmse_train_deg: float
    rmse_held_out_deg: float
    r2_held_out: float
    by_half_cycle_deg: tuple[float, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the keys of the contract."""
        return {**asdict(self), "by_half_cycle_deg": list(self.by_half_cycle_deg)}


@dataclass(frozen=True, slots=True)
class FoundEffect(Frozen):
    """An accepted effect as declared, with its fitted values and the derived values that follow from them.

    ``probability`` is the posterior probability of the sets that contain the effect; ``gain`` is the log evidence that
    is lost without the effect.
    """

    id: str
    family: str
    title: str
    parameters: Mapping[str, Estimate]
    probability: float
    gain: float

    def to_json(self) -> dict[str, Any]:
        """Return the keys of the contract."""
        return {
            **{one.name: getattr(self, one.name) for one in fields(self)},
            "parameters": estimates_to_json(self.parameters),
        }


@dataclass(frozen=True, slots=True)
class Pull:
    """Shift of a characterised value by a fit: nominal value, fitted value, prior's sigma, distance in sigmas."""

    name: str
    nominal: float
    value: float
    sigma: float

    @property
    def sigmas(self) -> float:
        """Distance in standard deviations of the prior."""
        return (self.value - self.nominal) / self.sigma

    def to_json(self) -> dict[str, Any]:
        """Return name, values and distance."""
        return {"name": self.name, "nominal": self.nominal, "value": self.value, "sigmas": self.sigmas}


@dataclass(frozen=True, eq=False, repr=False)
class DiscoveryReport(Frozen, Shown):
    """The answer for one record.

    Attributes
    ----------
    verdict : str
        ``none``, ``identified``, ``ambiguous`` or ``unknown``.
    effects : tuple of FoundEffect
        Accepted effects, strongest first.
    alternatives : tuple of tuple of str
        Other sets of ids that explain the record about as well.
    drivers : tuple of (str, float)
        Variables on which a missing effect depends, strongest first, with shares.
    before, after : Errors
        Errors of the plain and of the extended model.
    held_out : tuple of int
        Half-cycles that were predicted from the others, each in its turn.
    noise_floor_deg : float
        Residual that no model can remove: that due to the inputs' noise, or that of a fit where it is smaller.
    parameters, plain_parameters : mapping of str to Estimate
        Parameters of the extended and of the plain model.
    pulls, plain_pulls : tuple of Pull
        Shifts of the characterised values by either fit.
    next_experiment : NextExperiment or None
        Temperature programme that best separates the alternatives.
    notes : tuple of str
        Notes and warnings to the user.
    evidence : mapping
        Probabilities of the sets, residuals in noise floors, and the gain of every single effect and law.
    curves : mapping of str to (n,) array
        Columns of ``curves.csv``.
    model : FittedModel
        The extended model with its values, ready to predict later records.
    covariance : (m, m) float64
        Covariance of the extended model's free parameters, in the order of ``parameters``.
    laws : tuple of MeasuredLaw
        The laws that were measured, strongest first.
    """

    verdict: str
    effects: tuple[FoundEffect, ...]
    alternatives: tuple[tuple[str, ...], ...]
    drivers: tuple[tuple[str, float], ...]
    before: Errors
    after: Errors
    held_out: tuple[int, ...]
    noise_floor_deg: float
    parameters: Mapping[str, Estimate]
    plain_parameters: Mapping[str, Estimate]
    pulls: tuple[Pull, ...]
    plain_pulls: tuple[Pull, ...]
    next_experiment: NextExperiment | None
    notes: tuple[str, ...]
    evidence: Mapping[str, Any]
    curves: Mapping[str, NDArray[np.generic]]
    model: FittedModel
    covariance: Floats
    laws: tuple[MeasuredLaw, ...] = ()

    def facts(self) -> dict[str, str]:
        """Return the verdict, with the drivers of a missing effect, the named effects with values, and the errors."""
        facts = {"verdict": verdict_sentence(self.to_json())}
        for effect in self.effects:
            facts[effect_name(effect.id)] = effect_values(effect.to_json())
        before, after = self.before.rmse_held_out_deg, self.after.rmse_held_out_deg
        facts["error on held-out half-cycles"] = (
            f"{error_words(before)} (plain model), {error_words(after)} (extended model)"
        )
        return facts

    def __repr__(self) -> str:
        effects = ", ".join(effect.id for effect in self.effects)
        return f"DiscoveryReport({self.verdict}{': ' if effects else ''}{effects})"

    def _columns(self) -> dict[str, Any]:
        return dict(self.curves)

    def _draw(self, axes: Any) -> None:
        draw_models(axes, self.curves)

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``discovery.json``."""
        content: dict[str, Any] = {
            "verdict": self.verdict,
            "effects": [effect.to_json() for effect in self.effects],
            "alternatives": [list(names) for names in self.alternatives],
            "drivers": [{"variable": name, "share": share} for name, share in self.drivers],
            "before": self.before.to_json(),
            "after": self.after.to_json(),
            "held_out": list(self.held_out),
            "noise_floor_deg": self.noise_floor_deg,
            "parameters": estimates_to_json(self.parameters),
            "plain_parameters": estimates_to_json(self.plain_parameters),
            "pulls": [pull.to_json() for pull in self.pulls],
            "plain_pulls": [pull.to_json() for pull in self.plain_pulls],
            "laws": [law.to_json() for law in self.laws],
            "notes": list(self.notes),
            "evidence": dict(self.evidence),
            "next_experiment": None if self.next_experiment is None else self.next_experiment.to_json(),
        }
        content["notes"] += [doubt for doubt in (not_fixed(content), predicts_worse(content)) if doubt]
        return content
