"""The action of every law on the model: functions from ports, and the law as a function of its driver, to ports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from torsight.actuator.laws.phase_window import BRANCH, phase_steps
from torsight.actuator.ports import DWELL_DECADES, SPEEDS_RAD_S, STEEPEST, Ports, no_steeper
from torsight.actuator.record.segments import by_role
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.phase import PLACES
from torsight.core.compiled import compiled
from torsight.core.units import DEG, MNM, Floats

Curve = Callable[[Floats], Floats]

_STEPS: Final = phase_steps(PLACES)
_VALUES: Final = ("a_start_c", "a_finish_c", "m_start_c", "m_finish_c")
_SHARES: Final = ("k_austenite", "k_martensite", "k_stress_induced", "theta_cr_rad")
TEMPERATURES: Final = len(_VALUES)
DIFFERING: Final = TEMPERATURES + len(_SHARES)
"""Number of values in which two springs of one kind may differ, the transformation temperatures first."""


def stray(ports: Ports, law: Curve) -> Ports:
    """Add a stray torque over the angle, mN·m."""
    return ports.with_stray(law(ports.phi_grid_rad() / DEG) * MNM)


def friction_angle(ports: Ports, law: Curve) -> Ports:
    """Change the friction over the angle by a share."""
    factor = np.maximum(0.0, 1.0 + law(ports.phi_grid_rad() / DEG))
    return ports.with_friction(factor, factor)


def stray_of(ports: Ports, angle_deg: Floats) -> Floats:
    """Return the stray torque over the angle, mN·m."""
    if ports.stray_nm is None:
        return np.zeros_like(angle_deg)
    return np.interp(angle_deg * DEG, ports.phi_grid_rad(), ports.stray_nm) / MNM


def friction_of(ports: Ports, angle_deg: Floats) -> Floats:
    """Return the share by which friction is changed over the angle, mean of both directions."""
    if ports.friction_down_nm is None or ports.friction_up_nm is None:
        return np.zeros_like(angle_deg)
    mean_nm = 0.5 * (ports.friction_down_nm + ports.friction_up_nm)
    return np.interp(angle_deg * DEG, ports.phi_grid_rad(), mean_nm) / ports.rig.tau_c_nm - 1.0


def reading_of(ports: Ports, angle_deg: Floats) -> Floats:
    """Return what is added to the reading over the angle, degrees."""
    return ports.read(angle_deg * DEG, np.zeros_like(angle_deg)) / DEG - angle_deg


def _scaled(factor: str, driver: Callable[[Ports], Floats]) -> Callable[[Ports, Curve], Ports]:
    """Return the function that changes a factor of the ports over a driver by a share."""

    def apply(ports: Ports, law: Curve) -> Ports:
        return ports.changed(**{factor: getattr(ports, factor) * np.maximum(0.0, 1.0 + law(driver(ports)))})

    return apply


friction_active = _scaled("friction_scale", lambda ports: by_role(ports.active, ports.temp_a_c, ports.temp_b_c)[0])
friction_passive = _scaled("friction_scale", lambda ports: by_role(ports.active, ports.temp_a_c, ports.temp_b_c)[1])
friction_temp_rate = _scaled(
    "friction_scale", lambda ports: by_role(ports.active, ports.rate_a_c_s, ports.rate_b_c_s)[0]
)
friction_cycle = _scaled("friction_scale", lambda ports: ports.half_cycle[ports.half].astype(np.float64))
theta_l_half = _scaled("theta_l_scale", lambda ports: ports.half_cycle.astype(np.float64))
theta_l_cycle = _scaled("theta_l_scale", lambda ports: ports.cycle.astype(np.float64))


def friction_speed(ports: Ports, law: Curve) -> Ports:
    """Add friction over the speed, in shares of τ_c."""
    return ports.with_speed_friction(law(SPEEDS_RAD_S / DEG) * ports.rig.tau_c_nm)


def friction_dwell(ports: Ports, law: Curve) -> Ports:
    """Raise the friction after a rest by a share over decades of seconds."""
    return ports.with_dwell(np.maximum(1.0, 1.0 + law(DWELL_DECADES)))


def dwell_of(ports: Ports, decades: Floats) -> Floats:
    """Return the share by which friction is raised after rests, over decades of seconds."""
    if ports.dwell_factor is None:
        return np.zeros_like(decades)
    return np.interp(decades, DWELL_DECADES, ports.dwell_factor) - 1.0


def friction_direction(ports: Ports, law: Curve) -> Ports:
    """Change the friction for a falling (−1) and a rising angle (1) by a share."""
    down, up = (np.maximum(0.0, 1.0 + law(np.full_like(ports.grid_rad(), sign))) for sign in (-1.0, 1.0))
    return ports.with_friction(down, up)


def reading_angle(ports: Ports, law: Curve) -> Ports:
    """Add to the reading over the angle, degrees."""
    return ports.with_reading(lambda angle_rad, _time_s: angle_rad + law(angle_rad / DEG) * DEG)


def reading_time(ports: Ports, law: Curve) -> Ports:
    """Add to the reading over time, degrees; later records get the law's last value, as a moved marker stays moved."""
    return ports.with_reading(lambda angle_rad, time_s: angle_rad + law(_within_record(ports, time_s)) * DEG)


def _within_record(ports: Ports, time_s: Floats) -> Floats:
    """Return the times (n,); for a log that follows the record, infinity, where a law has its last value."""
    return np.full_like(time_s, np.inf) if ports.history.after_record else time_s


def temperature(spring: str) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a law over the wires' temperatures to these temperatures, °C."""
    return _warmer(spring, lambda ports: (ports.temp_a_c, ports.temp_b_c))


def temperature_rate(spring: str) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a law over the temperatures' rates to the wires' temperatures, °C.

    Where a logged temperature turns, its rate jumps, and with the rate the law. A wire that cools does not warm up by
    such a jump.
    """
    warmer = _warmer(spring, lambda ports: (ports.rate_a_c_s, ports.rate_b_c_s))

    def apply(ports: Ports, law: Curve) -> Ports:
        warmed = warmer(ports, law)
        return warmed.changed(
            temp_a_c=_no_jump_up(warmed.temp_a_c, ports.temp_a_c, ports.rate_a_c_s),
            temp_b_c=_no_jump_up(warmed.temp_b_c, ports.temp_b_c, ports.rate_b_c_s),
        )

    return apply


@compiled
def _no_jump_up(wire_c: Floats, log_c: Floats, rate_c_s: Floats) -> Floats:
    """Return a wire's temperatures (n,) that rise by no more than the log's where the log's rate is negative."""
    out = wire_c.copy()
    for i in range(1, out.size):
        if rate_c_s[i] < 0.0:
            out[i] = min(out[i], out[i - 1] + max(0.0, log_c[i] - log_c[i - 1]))
    return out


def _warmer(spring: str, drivers: Callable[[Ports], tuple[Floats, Floats]]) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a law over a wire's driver to the temperature of wire ``a``, ``b`` or ``both``."""

    def apply(ports: Ports, law: Curve) -> Ports:
        over_a, over_b = drivers(ports)
        temp_a_c = ports.temp_a_c + law(over_a) if spring != "b" else ports.temp_a_c
        temp_b_c = ports.temp_b_c + law(over_b) if spring != "a" else ports.temp_b_c
        return ports.changed(temp_a_c=temp_a_c, temp_b_c=temp_b_c)

    return apply


def temperature_time(spring: str) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a law of time to the wires' temperatures, °C; later records get its last value."""
    return _warmer(spring, lambda ports: (_within_record(ports, ports.time_s),) * 2)


def temperature_cycle(ports: Ports, law: Curve) -> Ports:
    """Raise the driven wire's transformation temperatures over its own cycles, °C."""
    warmer_c = law(ports.cycle.astype(np.float64))
    heating_c, cooling_c = ports.warmer_heating_c + warmer_c, ports.warmer_cooling_c + warmer_c
    return ports.changed(warmer_heating_c=heating_c, warmer_cooling_c=cooling_c)


def clock(ports: Ports, law: Curve) -> Ports:
    """Shift the temperature log's clock ahead of the film's by a law of film time, s.

    Later records have clocks of their own: their clocks are not shifted.
    """
    return ports if ports.history.after_record else ports.at_log_times(ports.time_s + law(ports.time_s))


def _over_winding(ports: Ports, law: Curve) -> Floats:
    """Return the law over a spring's own angle on the grid, N·m; its driver is the winding beyond θ_P/2."""
    return law((ports.grid_rad() - 0.5 * ports.rig.theta_p_rad) / DEG) * MNM


def winding(spring: str) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a torque over the winding, independent of the phase, mN·m."""
    return lambda ports, law: ports.with_side(_over_winding(ports, law), spring=spring)


def relaxing(ports: Ports, law: Curve) -> Ports:
    """Change the torque of cold springs over time by a share; later records get the law's last value."""
    before = 1.0 if ports.cold_scale is None else ports.cold_scale
    return ports.changed(cold_scale=before * np.maximum(0.0, 1.0 + law(_within_record(ports, ports.time_s))))


def loading(spring: str, *, follows: float = 1.0) -> Callable[[Ports, Curve], Ports]:
    """Return the function that adds a torque to the loading curve, mN·m.

    The recoverable angle follows the loading curve by the share ``follows``.
    """

    def apply(ports: Ports, law: Curve) -> Ports:
        return ports.with_loading(_gentle(ports, _over_winding(ports, law)), follows=follows, spring=spring)

    return apply


def _gentle(ports: Ports, torque_nm: Floats) -> Floats:
    """Return a torque over the grid, limited so that the loading curve stays flatter than unwinding and never falls.

    The torque at θ_P/2, which every stroke passes, is kept: a limit at windings that no record reached leaves the curve
    at those that were reached as it is.
    """
    least = -STEEPEST * ports.rig.k_stress_induced
    limited = no_steeper(torque_nm, ports.grid_rad(), ports.steepest_bend_nm, least)
    return limited + np.interp(0.0, ports.phi_grid_rad(), torque_nm - limited)


def phase_lead(ports: Ports, law: Curve) -> Ports:
    """Let the transformation run ahead of the phase law on heating and on cooling, in windows."""
    return ports.with_lead(law(_STEPS), law(BRANCH + _STEPS))


def differing(ports: Ports, law: Curve) -> Ports:
    """Let spring B differ from A: the law gives offsets of four temperatures (°C), of three moduli and θ_cr (%)."""
    rig = ports.rig_b
    values = law(np.arange(DIFFERING, dtype=np.float64))
    warmer_c, per_cent = values[:TEMPERATURES].tolist(), values[TEMPERATURES:].tolist()
    shifted = {name: getattr(rig, name) + by for name, by in zip(_VALUES, warmer_c, strict=True)}
    scaled = {name: getattr(rig, name) * (1.0 + 0.01 * by) for name, by in zip(_SHARES, per_cent, strict=True)}
    other: Rig = replace(rig, **shifted, **scaled)
    return ports.changed(rig_b=other)
