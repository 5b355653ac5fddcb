"""Discovery that tries little, for tests of what is done with its answer, whatever it is."""

from __future__ import annotations

import pytest

from torsight.actuator.effects import load_effects
from torsight.actuator.laws import laws_of


def try_few(patch: pytest.MonkeyPatch, *names: str) -> None:
    """Let discovery try a few effects (a late sensor, if none is named) and one law, not all of them."""
    few = {name: load_effects()[name] for name in (names or ("sensor_lag", "home_torque"))}
    patch.setattr("torsight.discovery.actuator_problem.load_effects", lambda: few)
    patch.setattr("torsight.discovery.actuator_problem.laws_of", lambda drive, tau_c_mnm: laws_of(drive, tau_c_mnm)[:1])
