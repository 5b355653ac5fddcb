r"""The transformation temperatures drift from cycle to cycle.

.. math:: A_{s,f}(n) = A_{s,f} + d_A \, l_n, \quad M_{s,f}(n) = M_{s,f} + d_M \, l_n, \quad l_n = 1 + q + … + q^{n−1}

n number of earlier heatings of the spring, d shift in the first cycle on heating and on cooling (°C), q shift of each
further cycle relative to the cycle before (1: without limit; less: towards a limit).
Predicted residual: every motion comes earlier or later than in the cycle before; the stroke keeps its length. Later
records continue the count. Source: defects that cycling creates, e.g. Miyazaki, Igo and Otsuka, Acta Metall. 34 (1986)
2045.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.effects.fatigue import persistence, settling


def apply(ports: Ports, values: Values) -> Ports:
    """Shift the transformation temperatures of the driven spring in every half-cycle."""
    moved = settling(ports.cycle, values["drift_persistence"])
    return ports.changed(
        warmer_heating_c=ports.warmer_heating_c + values["drift_heating_c"] * moved,
        warmer_cooling_c=ports.warmer_cooling_c + values["drift_cooling_c"] * moved,
    )


EFFECT = Effect(
    id="transformation_drift",
    family="material",
    acts_on="phase",
    title="the transformation temperatures drift from cycle to cycle",
    parameters=(
        *(
            Parameter(
                name=f"drift_{way}_c",
                value=0.2,
                unit="°C",
                lower=-20.0,
                upper=20.0,
                null=0.0,
                symbol=symbol,
                title=f"shift in the first cycle on {way}",
            )
            for way, symbol in (("heating", "d_A"), ("cooling", "d_M"))
        ),
        persistence("drift", "shift"),
    ),
    apply=apply,
    starts=({"drift_heating_c": -0.2, "drift_cooling_c": -0.2},),
    laws=("temperature_cycle",),
)
