r"""Stress shifts the transformation temperatures of this wire by more or less than its actuator file states.

.. math:: C_A → r_A C_A, \qquad C_M → r_M C_M

C stress coefficients, r ratio of true to declared values. Predicted residual: motion begins and ends earlier or later
the more torque a spring carries, differently on heating and on cooling; a fit without this effect shifts A_s to M_f. A
curve of angle over temperature determines only the ratios of moduli, friction and coefficients: r can be identified
where moduli and friction are known. Source: paper, (13) and (14), where C_A and C_M come from tests at several loads;
files often have one value from a table for both.
"""

from __future__ import annotations

from dataclasses import replace

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.springs import Rig


def apply(ports: Ports, values: Values) -> Ports:
    """Scale the stress coefficients of both springs."""

    def scaled(rig: Rig) -> Rig:
        return replace(
            rig,
            c_austenite=rig.c_austenite * values["stress_ratio_heating"],
            c_martensite=rig.c_martensite * values["stress_ratio_cooling"],
        )

    return ports.changed(rig=scaled(ports.rig), rig_b=scaled(ports.rig_b))


EFFECT = Effect(
    id="stress_influence",
    family="material",
    acts_on="phase",
    title="stress coefficients are not those of the file",
    parameters=tuple(
        Parameter(
            name=f"stress_ratio_{way}",
            # Usual deviation of one wire's coefficient from a table's value: a choice.
            value=0.85,
            unit="",
            lower=0.3,
            upper=3.0,
            null=1.0,
            symbol=symbol,
            title=f"true over declared stress coefficient on {way}",
        )
        for way, symbol in (("heating", "r_A"), ("cooling", "r_M"))
    ),
    apply=apply,
    starts=(
        {"stress_ratio_heating": 1.15, "stress_ratio_cooling": 1.15},
        {"stress_ratio_heating": 0.85, "stress_ratio_cooling": 1.15},
        {"stress_ratio_heating": 1.15, "stress_ratio_cooling": 0.85},
    ),
)
