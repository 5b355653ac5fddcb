r"""Friction changes once per turn: an eccentric shaft or thread.

.. math:: τ_f = τ_c (1 + a \sin(φ + φ_0)) = τ_c (1 + s \sin φ + c \cos φ)

a amplitude as a share of τ_c, φ_0 phase (rad); the fit moves s and c, which are well conditioned, and the amplitude
and phase are reported. Predicted residual: once per turn in angle, its sign follows the direction of motion. Source:
position-dependent friction of screw drives, e.g. Armstrong-Hélouvry et al., Automatica 30 (1994) 1083.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.effects import Derived, Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter

Array = NDArray[np.float64]


def friction_factor(phi_rad: Array, *, sine: float, cosine: float) -> Array:
    """Return 1 + s sin φ + c cos φ, never below zero."""
    return np.maximum(0.0, 1.0 + sine * np.sin(phi_rad) + cosine * np.cos(phi_rad))


def apply(ports: Ports, values: Values) -> Ports:
    """Multiply the friction, the same for both directions."""
    factor = friction_factor(ports.phi_grid_rad(), sine=values["friction_sine"], cosine=values["friction_cosine"])
    return ports.with_friction(factor, factor)


EFFECT: Final = Effect(
    id="position_friction",
    family="friction",
    acts_on="friction",
    title="friction changes once per turn",
    parameters=(
        Parameter(name="friction_sine", value=0.2, unit="", lower=-1.5, upper=1.5, null=0.0),
        Parameter(name="friction_cosine", value=0.0, unit="", lower=-1.5, upper=1.5, null=0.0),
    ),
    apply=apply,
    starts=(
        {"friction_sine": -0.2},
        {"friction_sine": 0.0, "friction_cosine": 0.2},
        {"friction_sine": 0.0, "friction_cosine": -0.2},
    ),
    derived=(
        Derived("amplitude", "", lambda v: math.hypot(v["friction_sine"], v["friction_cosine"])),
        Derived("phase_rad", "rad", lambda v: math.atan2(v["friction_cosine"], v["friction_sine"]), period=math.tau),
    ),
)
