r"""Disk or markers are off the axis, or the camera is tilted.

.. math:: φ_{read} = φ + e \sin(φ + φ_0) + t \sin(2 φ + φ_t)

e amplitude of the error once per turn (°), t of the error twice per turn (°; ψ²/4 for a camera tilted by ψ); the fitted
parameters are their sine and cosine parts, e_s and e_c, t_s and t_c. Predicted residual: a function of the angle alone,
the same in both directions, constant at rest. Source: eccentricity and tilt error of angle encoders, e.g. Slocum,
Precision Machine Design (1992), ch. 4.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values, amplitude_and_phase
from torsight.core.units import DEG, Floats

_NAMES: Final = ("eccentric_sine_deg", "eccentric_cosine_deg", "tilt_sine_deg", "tilt_cosine_deg")
_SYMBOLS: Final = (
    *(("e_s", "sine part of the error once per turn"), ("e_c", "cosine part of the error once per turn")),
    *(("t_s", "sine part of the error twice per turn"), ("t_c", "cosine part of the error twice per turn")),
)


def apply(ports: Ports, values: Values) -> Ports:
    """Add the error to the camera's reading."""
    sine, cosine, twice_sine, twice_cosine = (values[name] * DEG for name in _NAMES)

    def read(phi_rad: Floats, _time_s: Floats) -> Floats:
        error = sine * np.sin(phi_rad) + cosine * np.cos(phi_rad)
        return phi_rad + error + twice_sine * np.sin(2.0 * phi_rad) + twice_cosine * np.cos(2.0 * phi_rad)

    return ports.with_reading(read)


EFFECT = Effect(
    id="eccentricity",
    family="camera",
    acts_on="reading",
    title="disk or markers off the axis, or a tilted camera",
    parameters=tuple(
        Parameter(name, 0.3 if name == _NAMES[0] else 0.0, "°", -30.0, 30.0, null=0.0, symbol=symbol, title=title)
        for name, (symbol, title) in zip(_NAMES, _SYMBOLS, strict=True)
    ),
    apply=apply,
    starts=({"eccentric_sine_deg": 0.0, "eccentric_cosine_deg": 0.3},),
    derived=(
        *amplitude_and_phase(
            *_NAMES[:2],
            unit="°",
            names=("amplitude_deg", "phase_rad"),
            symbols=("e", "φ_0"),
            titles=("error once per turn", "phase of the error once per turn"),
        ),
        *amplitude_and_phase(
            *_NAMES[2:],
            unit="°",
            names=("tilt_amplitude_deg", "tilt_phase_rad"),
            symbols=("t", "φ_t"),
            titles=("error twice per turn", "phase of the error twice per turn"),
        ),
    ),
    laws=("reading_angle_deg",),
)
