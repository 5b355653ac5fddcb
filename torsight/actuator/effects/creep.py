r"""The wound cold spring relaxes with the logarithm of time.

.. math:: τ_p \, (1 − c \log_{10}(1 + t / t_0))

τ_p torque of the spring that is not driven, t time since the driven one was switched on (s), c share of the torque lost
per decade, t_0 onset time (s). A spring regains its whole torque when it is driven; the spring that is driven first is
assumed to have relaxed before the record for as long as the first half-cycle lasts. Predicted residual: the angle
creeps on in a hold, and slow heatings go further. Source: relaxation of stress-induced martensite, e.g. Grabe and
Bruhns, Int. J. Solids Struct. 45 (2008) 1876.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values


def apply(ports: Ports, values: Values) -> Ports:
    """Scale the torque of the spring that is not driven."""
    begins_s = ports.time_s[np.searchsorted(ports.half, ports.half)]
    decades = np.log10(1.0 + (ports.time_s - begins_s) / values["creep_onset_s"])
    left = 1.0 - values["creep_per_decade"] * decades
    return ports.changed(passive_scale=left, first_share=float(left[np.searchsorted(ports.half, 1) - 1]))


EFFECT = Effect(
    id="creep",
    family="material",
    acts_on="torque",
    title="a wound spring that relaxes with time",
    parameters=(
        Parameter("creep_per_decade", 0.01, "", 0.0, 0.3, null=0.0, symbol="c", title="torque lost per decade of time"),
        Parameter("creep_onset_s", 10.0, "s", 0.5, 600.0, sigma=20.0, symbol="t_0", title="onset time of creep"),
    ),
    apply=apply,
    starts=({"creep_per_decade": 0.05},),
)
