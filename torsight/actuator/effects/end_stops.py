r"""Stops at both ends of the stroke, with equal stiffness.

.. math:: τ_b − τ_a − τ_f − k \, ((φ − φ_+)_+ − (φ_- − φ)_+) = 0

:math:`φ_+` and :math:`φ_-` angles of the stops (°), k their stiffness (mN·m/rad). Predicted residual and source: as in
:mod:`torsight.actuator.effects.end_stop`, for the strokes to both sides.
"""

from __future__ import annotations

from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.actuator.effects.end_stop import ends_deg, stiffness, stop_torque
from torsight.core.units import DEG, MNM, Floats


def apply(ports: Ports, values: Values) -> Ports:
    """Add the stops' torques along φ."""
    stiffness_nm = values["stops_mnm_per_rad"] * MNM
    for name in ("stops_high_deg", "stops_low_deg"):
        torque_nm = stop_torque(ports.phi_grid_rad(), stop_rad=values[name] * DEG, stiffness_nm=stiffness_nm)
        ports = ports.with_stray(torque_nm)
    return ports


def starts_from(angle_rad: Floats) -> tuple[Values, ...]:
    """Return stops at both ends."""
    low_deg, high_deg = ends_deg(angle_rad)
    return ({"stops_low_deg": low_deg, "stops_high_deg": high_deg},)


EFFECT = Effect(
    id="end_stops",
    family="mechanics",
    acts_on="torque",
    title="stops at both ends",
    parameters=(
        stiffness("stops_mnm_per_rad", "stiffness of the stops"),
        Parameter("stops_high_deg", 215.0, "°", 0.0, 400.0, symbol="φ_+", title="place of the upper stop"),
        Parameter("stops_low_deg", -215.0, "°", -400.0, 0.0, symbol="φ_-", title="place of the lower stop"),
    ),
    apply=apply,
    starts_from=starts_from,
    laws=("torque_angle_deg",),
)
