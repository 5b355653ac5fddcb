"""The torsion actuator: springs, phase laws, the stepping rule, effects, fits and characterisation."""

from __future__ import annotations

from typing import Final

from torsight.core.lazy import lazily

_HOMES: Final = {
    "ActuatorSpec": "spec",
    "read_actuator": "spec",
    "reference_spec": "spec",
    "ActuatorModel": "model",
    "Simulation": "model",
    "Drive": "drive",
    "read_log": "record.logs",
    "Rig": "springs",
    "half_cycle": "stepping.closed_form",
    "stable_cycle": "stepping.closed_form",
    "FitResult": "fit_result",
    # The fit is made by the discovery, above this room: the name alone is here, nothing in this room uses it.
    "fit_model": ".discovery.model_fit",
    "FittedModel": "fitted",
    "Prediction": "predicted",
    "fitted_model": "fitted",
    "read_model": "fitted",
    "write_model": "fitted",
    "characterise": "characterising.characterisation",
    "read_tests": "characterising.spring_tests",
    "Effect": "effects",
    "load_effects": "effects",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
