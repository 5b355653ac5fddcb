r"""The phase law's form is an approximation.

.. math:: u → u + b_h \, u (1 − u), \qquad u → u + b_c \, u (1 − u)

u place in the law's window, 0 at its start and 1 at its end; b lead of the transformation over the law (below 0: lag),
largest in the middle of the window, b_h on heating and b_c on cooling. It is no effect of the rig: every wire's law has
its own form, and with the cosine alone other values and effects would compensate for the difference. So discovery
always fits b beside the characterised values, within a percent or two, and never names it. Source: Liang and Rogers, J.
Intell. Mater. Syst. Struct. 1 (1990) 207, who choose the cosine for its shape.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Set the bends of the phase law on heating and on cooling."""
    return ports.changed(heating_bend=values["heating_bend"], cooling_bend=values["cooling_bend"])


EFFECT = Effect(
    id="phase_shape",
    family="form",
    acts_on="phase",
    title="the form of the phase law",
    parameters=tuple(
        Parameter(
            name=f"{way}_bend",
            value=0.0,
            unit="",
            lower=-0.3,
            upper=0.3,
            sigma=0.01,
            null=0.0,
            symbol=f"b_{way[0]}",
            title=f"bend of the phase law on {way}",
        )
        for way in ("heating", "cooling")
    ),
    apply=apply,
)
