r"""A marker shifts on its stick, or the camera is bumped.

.. math:: φ_{read} = φ + s \, H(t − t_s)

s step of the reading (°), t_s its time on the film's clock (s); the step is given half a second of width, so that its
time can be fitted. Predicted residual: a jump that stays, at no particular angle or temperature. A later record's start
angle holds the step already: it stays. Source: change-point in a measured level, e.g. Basseville and Nikiforov,
Detection of Abrupt Changes (1993), ch. 2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.effects import Effect, Values
from torsight.actuator.ports import Ports
from torsight.core.parameter import Parameter
from torsight.core.units import DEG

Array = NDArray[np.float64]
_WIDTH_S: Final = 0.5


def step(time_s: Array, *, at_s: float, width_s: float) -> Array:
    """Return a ramp from 0 to 1 that is centred on the step's time."""
    return np.clip((time_s - at_s) / width_s + 0.5, 0.0, 1.0)


def propose(time_s: Array, residual_rad: Array) -> tuple[Values, ...]:
    """Return the times and heights at which a step explains most of a residual (NaN: not measured)."""
    good = np.flatnonzero(np.isfinite(residual_rad))
    n = len(good)
    if n < 20:
        return ()
    total = np.cumsum(residual_rad[good])
    count = np.arange(1, n)
    before, after = total[:-1] / count, (total[-1] - total[:-1]) / (n - count)
    gain = (after - before) ** 2 * count * (n - count) / n
    # A step inside a motion hides behind the motion's error: the largest in every eighth of the record.
    parts = [part for part in np.array_split(np.arange(5, n - 6), 8) if len(part)]
    found = sorted((int(part[np.argmax(gain[part])]) for part in parts), key=lambda i: -gain[i])
    return tuple(
        {
            "slip_time_s": float(0.5 * (time_s[good[i]] + time_s[good[i + 1]])),
            "slip_deg": float((after[i] - before[i]) / DEG),
        }
        for i in found[:4]
    )


def apply(ports: Ports, values: Values) -> Ports:
    """Add the step to what the camera reads; after the record it is there from the start."""
    height = values["slip_deg"] * DEG
    at_s = -np.inf if ports.history.after_record else values["slip_time_s"]
    return ports.with_reading(lambda phi_rad, time_s: phi_rad + height * step(time_s, at_s=at_s, width_s=_WIDTH_S))


EFFECT: Final = Effect(
    id="marker_slip",
    family="camera",
    acts_on="reading",
    title="a marker slipped, or the camera was bumped",
    parameters=(
        Parameter(name="slip_deg", value=1.0, unit="°", lower=-180.0, upper=180.0, null=0.0),
        Parameter(name="slip_time_s", value=0.0, unit="s", lower=-1e7, upper=1e7),
    ),
    apply=apply,
    propose=propose,
)
