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
    "read_log": "logs",
    "Rig": "springs",
    "half_cycle": "closed_form",
    "stable_cycle": "closed_form",
    "FitResult": "fit",
    "fit_model": "fit",
    "FittedModel": "fitted",
    "Prediction": "predicted",
    "fitted_model": "fitted",
    "read_model": "fitted",
    "write_model": "fitted",
    "characterise": "characterisation",
    "read_tests": "spring_tests",
    "Effect": "effects",
    "load_effects": "effects",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
