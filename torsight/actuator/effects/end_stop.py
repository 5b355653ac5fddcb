r"""A stop at one end of the stroke: disk, stick or lead wire touches an obstacle.

.. math:: τ_b − τ_a − τ_f − k \, s \, (s \, (φ − φ_s))_+ = 0, \quad s = \mathrm{sign} \, φ_s

φ_s angle of the stop (°), k its stiffness (mN·m/rad), the same for loading and unloading. Predicted residual: strokes
to one side end early, all at the same angle, however far the spring alone would drive. Source: unilateral contact
modelled as a stiff spring, e.g. Brogliato, Nonsmooth Mechanics (2016), ch. 2.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.series import extent
from torsight.core.units import DEG, MNM, Floats


def stop_torque(phi_rad: Floats, *, stop_rad: float, stiffness_nm: float) -> Floats:
    """Return the torque of a stop at ``stop_rad``, N·m; it is zero at angles nearer to zero than the stop."""
    side = 1.0 if stop_rad >= 0.0 else -1.0
    return -stiffness_nm * side * np.maximum(0.0, side * (phi_rad - stop_rad))


def stiffness(name: str, title: str) -> Parameter:
    """Return the declaration of a stop's stiffness."""
    return Parameter(name, 3.0, "mN·m/rad", lower=0.0, upper=200.0, null=0.0, symbol="k", title=title)


def ends_deg(angle_rad: Floats) -> tuple[float, float]:
    """Return the start values of stops: inside the extreme measured angles, beyond which a stop has no effect."""
    low_deg, high_deg = extent(angle_rad / DEG)
    inside_deg = 2.0
    return low_deg + inside_deg, high_deg - inside_deg


def apply(ports: Ports, values: Values) -> Ports:
    """Add the stop's torque along φ."""
    stop_rad, stiffness_nm = values["stop_deg"] * DEG, values["stop_mnm_per_rad"] * MNM
    return ports.with_stray(stop_torque(ports.phi_grid_rad(), stop_rad=stop_rad, stiffness_nm=stiffness_nm))


def starts_from(angle_rad: Floats) -> tuple[Values, ...]:
    """Return a stop at either end."""
    return tuple({"stop_deg": end_deg} for end_deg in ends_deg(angle_rad))


EFFECT = Effect(
    id="end_stop",
    family="mechanics",
    acts_on="torque",
    title="a stop at one end",
    parameters=(
        stiffness("stop_mnm_per_rad", "stiffness of the stop"),
        Parameter("stop_deg", 160.0, "°", -400.0, 400.0, symbol="φ_s", title="place of the stop"),
    ),
    apply=apply,
    starts_from=starts_from,
    laws=("torque_angle_deg",),
)
