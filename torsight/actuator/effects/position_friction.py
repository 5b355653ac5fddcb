r"""Friction changes once per turn: an eccentric shaft or thread.

.. math:: τ_f = τ_c (1 + a (\sin ψ + h \sin 3ψ)), \qquad ψ = φ + φ_0, \quad a \sin ψ = a_s \sin φ + a_c \cos φ

a amplitude as a share of τ_c, φ_0 phase (rad), h third harmonic: above zero the wave is flat at its extremes (a thread
that binds over a part of the turn), below zero pointed. The fitted parameters are a_s and a_c, which are well
conditioned; amplitude and phase are reported. Predicted residual: a wave once per turn of the angle, whose sign follows
the direction of motion. Source: position-dependent friction of screw drives, e.g. Armstrong-Hélouvry et al.,
Automatica 30 (1994) 1083.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, amplitude_and_phase


def apply(ports: Ports, values: Values) -> Ports:
    """Multiply the friction by 1 + a (sin ψ + h sin 3ψ), never below zero, the same for both directions."""
    sine, cosine, phi_rad = values["friction_sine"], values["friction_cosine"], ports.phi_grid_rad()
    wave = sine * np.sin(phi_rad) + cosine * np.cos(phi_rad)
    square = sine**2 + cosine**2
    if square > 0.0:
        wave = wave * (1.0 + values["friction_third_harmonic"] * (3.0 - 4.0 * wave**2 / square))
    factor = np.maximum(0.0, 1.0 + wave)
    return ports.with_friction(factor, factor)


EFFECT = Effect(
    id="position_friction",
    family="friction",
    acts_on="friction",
    title="friction changes once per turn",
    parameters=(
        Parameter(
            "friction_sine", 0.2, "", -1.5, 1.5, null=0.0, symbol="a_s", title="sine part of the friction's wave"
        ),
        Parameter(
            "friction_cosine", 0.0, "", -1.5, 1.5, null=0.0, symbol="a_c", title="cosine part of the friction's wave"
        ),
        Parameter(
            "friction_third_harmonic", 0.0, "", -0.4, 0.4, sigma=0.1, symbol="h", title="third harmonic of the wave"
        ),
    ),
    apply=apply,
    starts=(
        {"friction_sine": -0.2},
        {"friction_sine": 0.0, "friction_cosine": 0.2},
        {"friction_sine": 0.0, "friction_cosine": -0.2},
    ),
    derived=amplitude_and_phase(
        "friction_sine",
        "friction_cosine",
        unit="",
        names=("amplitude", "phase_rad"),
        symbols=("a", "φ_0"),
        titles=("amplitude of the wave", "phase of the wave"),
    ),
    laws=("friction_angle_deg",),
)
