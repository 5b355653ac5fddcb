"""What a model lacks: an engine that knows no physics, and the actuator as a problem for it.

Names are imported on first use, so that importing the package costs nothing.
"""

from __future__ import annotations

import importlib
from typing import Any, Final

_HOMES: Final = {
    "Candidate": "interface",
    "Problem": "interface",
    "Settings": "search",
    "Findings": "engine",
    "find_missing": "engine",
    "LinearProblem": "linear_problem",
    "linear_problem": "linear_problem",
    "ActuatorProblem": "actuator_problem",
    "DiscoveryReport": "report",
    "discover": "discover",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_HOMES)
