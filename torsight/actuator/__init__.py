"""The torsion actuator: springs, phase laws, the stepping rule, effects, fits and characterisation.

Names are imported on first use, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import Any, Final

_HOMES: Final = {
    "ActuatorSpec": "spec",
    "read_actuator": "spec",
    "reference_spec": "spec",
    "ActuatorModel": "model",
    "Simulation": "model",
    "Drive": "drive",
    "Rig": "springs",
    "FitResult": "fit",
    "fit_model": "fit",
    "FittedModel": "fitted",
    "fitted_model": "fitted",
    "read_model": "fitted",
    "write_model": "fitted",
    "load_effects": "effects",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_HOMES)
