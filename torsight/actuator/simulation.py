"""Simulation of the model: the compiled stepping rule applied to ports, and the resulting angles and torques."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import erf, exp, pi, sqrt
from operator import itemgetter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.ports import DWELL_DECADES, SPEEDS_RAD_S, Ports
from torsight.actuator.stepping import kernel
from torsight.actuator.stepping import kernel_laws as places
from torsight.actuator.stepping.kernel_laws import Samples
from torsight.actuator.stepping.phase import PLACES
from torsight.core.compiled import compiled, inlined
from torsight.core.units import DEG, MNM, Floats, Ints
from torsight.core.words.shown import Shown, draw_series, share, span

RELEASE_SCATTER: Final = 0.005
"""Scatter of the friction at which a disk breaks loose from one time to the next, relative to this friction: a choice.
A law of the friction that is wrong by this much is as likely as the true one. Without it, one row between the measured
and the predicted instant of a jump of 40° outweighs all other rows of a record."""
_WIDE: Final = float(np.finfo(np.float64).eps) ** -0.25
"""Scatter of an instant, in rows, above which the roundings are left out: w⁻² of the probability, which is as much as
the exact formula would lose by the digits of w²."""
_TAIL: Final = 5.0
"""Standard deviations beyond which a Gaussian distribution has no weight: a millionth."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Simulation(Shown):
    """The model's angles, fractions and torques for every row of a drive.

    Attributes
    ----------
    time_s : (n,) float64
        Instants of the rows.
    angle_rad : (n,) float64
        Angle as a camera would read it.
    phi_rad : (n,) float64
        Actuator angle φ itself.
    xi_a, xi_b : (n,) float64
        Martensite fractions.
    torque_a_nm, torque_b_nm, friction_nm : (n,) float64
        Springs' torques, and the friction torque τ_f = τ^B − τ^A (+ stray torque) that holds or brakes.
    temp_a_c, temp_b_c : (n,) float64
        Wire temperatures of the simulation.
    unwound_rad : (float, float)
        Difference between the last maximum of the winding of A and of B and the winding at the last row.
    """

    time_s: Floats
    angle_rad: Floats
    phi_rad: Floats
    xi_a: Floats
    xi_b: Floats
    torque_a_nm: Floats
    torque_b_nm: Floats
    friction_nm: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    unwound_rad: tuple[float, float]

    def at(self, rows: Ints) -> Simulation:
        """Return the simulation restricted to the given rows (m,)."""
        columns = (one.name for one in fields(self) if one.name != "unwound_rad")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})

    def facts(self) -> dict[str, str]:
        """Return rows, time, angle and friction torque."""
        return {
            "rows": str(len(self.time_s)),
            "time": span(self.time_s, "s"),
            "angle": span(self.angle_rad / DEG, "°"),
            "friction torque": span(self.friction_nm / MNM, "mN·m"),
        }

    def _columns(self) -> dict[str, Any]:
        return {
            "time_s": self.time_s,
            "angle_deg": self.angle_rad / DEG,
            "temp_a_c": self.temp_a_c,
            "temp_b_c": self.temp_b_c,
            "xi_a": self.xi_a,
            "xi_b": self.xi_b,
            "torque_a_mnm": self.torque_a_nm / MNM,
            "torque_b_mnm": self.torque_b_nm / MNM,
            "friction_mnm": self.friction_nm / MNM,
        }

    def _draw(self, axes: Any) -> None:
        draw_series(axes, self.time_s, {"angle": self.angle_rad / DEG}, label="angle, °")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prediction(Shown):
    """Angles for the instants of a temperature log.

    Attributes
    ----------
    angle_rad : (n,) float64
        As a camera would read it; NaN in gaps of the temperatures that are too long to bridge.
    drive : Drive
        The conditioned log, with interpolated rows between its instants where these are far apart.
    simulation : Simulation
        All other quantities of the model, at the log's instants.
    rows : (n,) int64
        Rows of the drive at the log's instants.
    """

    angle_rad: Floats
    drive: Drive
    simulation: Simulation
    rows: Ints

    def facts(self) -> dict[str, str]:
        """Return rows, time and angle."""
        return {
            "rows": str(len(self.angle_rad)),
            "time": span(self.simulation.time_s, "s"),
            "angle": f"{span(self.angle_rad / DEG, '°')} in {share(np.isfinite(self.angle_rad))} of the rows",
        }

    def _columns(self) -> dict[str, Any]:
        return {**dict(self.simulation.to_frame()), "angle_deg": self.angle_rad / DEG}

    def _draw(self, axes: Any) -> None:
        draw_series(axes, self.simulation.time_s, {"angle": self.angle_rad / DEG}, label="angle, °")


def run_ports(ports: Ports) -> Simulation:
    """Run the stepping rule on ports, starting from the reading at the first row."""
    out, unwound = _stepped(ports)
    phi = out[0] - 0.5 * ports.rig.theta_p_rad
    friction = out[4] - out[3]
    if ports.stray_nm is not None:
        friction = friction + np.interp(phi, ports.phi_grid_rad(), ports.stray_nm)
    return Simulation(
        time_s=ports.time_s,
        angle_rad=ports.read(phi, ports.time_s),
        phi_rad=phi,
        xi_a=out[1],
        xi_b=out[2],
        torque_a_nm=out[3],
        torque_b_nm=out[4],
        friction_nm=friction,
        temp_a_c=ports.temp_a_c,
        temp_b_c=ports.temp_b_c,
        unwound_rad=(float(unwound[0]), float(unwound[1])),
    )


def seen_of_ports(ports: Ports) -> tuple[Floats, Floats]:
    """Return the expected angle (n,) at the rows, and its standard deviation (n,) from the instants of jumps, rad.

    Film and log each round the instant at which a disk breaks loose to one of their rows, so that the measured jump
    comes up to one row before or after the model's, with the distribution of the sum of two roundings (a triangle). The
    friction at which it breaks loose differs from one time to the next (:data:`RELEASE_SCATTER`), and the instant by
    the time in which the torque grows by that.
    """
    out, _ = _stepped(ports)
    theta_a, sigma = _shown(out, ports.time_s, ports.active, ports.half)
    return ports.read(theta_a - 0.5 * ports.rig.theta_p_rad, ports.time_s), sigma


@compiled
def _shown(out: Floats, time_s: Floats, active: NDArray[np.int8], half: Ints) -> tuple[Floats, Floats]:
    """Return the expected θ^A (n,) at the rows and its standard deviation (n,) from the kernel's result ``out``.

    A jump shows in its own heating or cooling, and between its neighbours, however slowly the torque grows.
    """
    theta, variance = out[0].copy(), np.zeros(len(time_s))
    for k in range(1, len(time_s)):
        jump = out[5, k]
        if jump == 0.0:
            continue
        step_s = time_s[k] - time_s[k - 1]
        at_s, width = time_s[k - 1] + out[6, k] * step_s, RELEASE_SCATTER / out[7, k]
        reach = 1.0 + _TAIL * width
        for sense in (-1, 1):
            row = k - 1 if sense < 0 else k
            while 0 <= row < len(time_s) and abs(time_s[row] - at_s) < reach * step_s:
                if active[row] != active[k] or half[row] != half[k] or (row != k and out[5, row] != 0.0):
                    break
                early = _begun((time_s[row] - at_s) / step_s, width)
                theta[row] += jump * (early - (row >= k))
                variance[row] += jump**2 * early * (1.0 - early)
                row += sense
    return theta, np.sqrt(variance)


@inlined
def _begun(after: float, width: float) -> float:
    """Return the probability that a jump shows a number of rows ``after`` its instant.

    The instant has the distribution of the sum of two roundings and of a Gaussian variable of standard deviation
    ``width``, all in rows.
    """
    if width > _WIDE:
        return 0.5 * (1.0 + erf(after / width / sqrt(2.0)))
    share = _ramp(after + 1.0, width) - 2.0 * _ramp(after, width) + _ramp(after - 1.0, width)
    return min(max(share, 0.0), 1.0)


@inlined
def _ramp(x: float, width: float) -> float:
    """Return the second integral of a Gaussian density of standard deviation ``width``."""
    z = x / max(width, 1e-9)
    below = 0.5 * (1.0 + erf(z / sqrt(2.0)))
    return 0.5 * ((x**2 + width**2) * below + x * width * exp(-0.5 * z**2) / sqrt(2.0 * pi))


def _stepped(ports: Ports) -> tuple[Floats, Floats]:
    """Return the result of :func:`torsight.actuator.stepping.kernel.run` on ports."""
    start = _unread(ports.drive.start_angle_rad, ports) + 0.5 * ports.rig.theta_p_rad
    per_s, temps, directions = ports.sampled()
    changes = directions, ports.friction_scale, ports.load_change(), ports.slipped()
    samples = Samples(per_s, temps, ports.active, ports.half, *changes)
    cycling = np.array((ports.theta_l_scale, ports.theta_l_loss_rad, ports.warmer_heating_c, ports.warmer_cooling_c))
    sections = np.array((ports.section_weight, ports.section_drop_c, ports.section_drop_share))
    return kernel.run(samples, cycling.T.copy(), _scalars(ports), _tables(ports), sections, start)


_OF_PORTS: Final = tuple(name for name in places.SCALARS.names or () if name in Ports.__dataclass_fields__)
"""Scalars of the kernel that are attributes of ports."""
_in_order: Final = itemgetter(*(places.SCALARS.names or ()))
"""Selects the kernel's scalars by name, quickly: a fit does so tens of thousands of times."""


def _scalars(ports: Ports) -> NDArray[np.void]:
    """Return the kernel's scalars (2,) of dtype ``SCALARS``: with spring A's values, and with spring B's."""
    rig, grid = ports.rig, ports.grid_rad()
    # Where the load cannot change at a constant angle, the kernel skips samples at which no transformation advances.
    moving_load = ports.passive_share or ports.load_changes or ports.slips or (ports.friction_scale != 1.0).any()
    unwound_a, unwound_b = ports.history.unwound_rad or (-1.0, -1.0)
    common = {name: getattr(ports, name) for name in _OF_PORTS} | {
        "theta_p": rig.theta_p_rad,
        "tau_c": rig.tau_c_nm,
        "speed_step": 0.0 if ports.speed_friction_nm is None else SPEEDS_RAD_S[1],
        "dwell_step": 0.0 if ports.dwell_factor is None else DWELL_DECADES[1],
        "slipped_a": 0.0,
        "slipped_b": 0.0,
        "place_step": 0.0 if ports.lead is None else PLACES[1] - PLACES[0],
        "grid_start": grid[0],
        "grid_step": grid[1] - grid[0],
        "has_friction": ports.friction_down_nm is not None,
        "has_stray": ports.stray_nm is not None,
        "steady": not moving_load,
        "unwound_a": unwound_a,
        "unwound_b": unwound_b,
    }
    rows = np.array([_in_order(_of_spring(ports, spring, common)) for spring in (0, 1)], np.float64)
    return np.ndarray((2,), places.SCALARS, rows)


def _of_spring(ports: Ports, spring: int, common: dict[str, float]) -> dict[str, float]:
    """Return the scalars of one spring beside those that both have in common."""
    rig = (ports.rig, ports.rig_b)[spring]
    side, loading = ((places.SIDE_A, places.LOADING_A), (places.SIDE_B, places.LOADING_B))[spring]
    return {
        **common,
        "k_a": rig.k_austenite,
        "k_m": rig.k_martensite,
        "k_s": rig.k_stress_induced,
        "a_start": rig.a_start_c,
        # A fit may try values out of order: the window keeps a least width.
        "a_width": max(rig.a_finish_c - rig.a_start_c, 0.05),
        "m_finish": rig.m_finish_c,
        "m_width": max(rig.m_start_c - rig.m_finish_c, 0.05),
        "temp_per_torque_a": rig.stress_per_torque / rig.c_austenite,
        "temp_per_torque_m": rig.stress_per_torque / rig.c_martensite,
        "theta_cr": rig.theta_cr_rad,
        "side_row": 0 if ports.side_nm[spring] is None else side,
        "loading_row": 0 if ports.loading_nm[spring] is None else loading,
        "follows": ports.loading_follows[spring],
    }


def _tables(ports: Ports) -> Floats:
    """Return the kernel's tables (k, m); absent ones are zero and never read."""
    given = (
        ports.friction_down_nm,
        ports.friction_up_nm,
        ports.stray_nm,
        *ports.side_nm,
        *ports.loading_nm,
        ports.speed_friction_nm,
        ports.dwell_factor,
        *ports.moved_places(),
    )
    size = max([2, *(len(table) for table in given if table is not None)])
    tables = np.zeros((len(given), size))
    for row, table in enumerate(given):
        if table is not None:
            tables[row] = table
    return tables


def _unread(angle_rad: float, ports: Ports) -> float:
    """Return φ at the first row from the reading there, by fixed-point iteration (a reading is close to φ)."""
    if not ports.reading:
        return angle_rad
    phi = angle_rad
    for _ in range(60):
        step = angle_rad - float(ports.read(np.array([phi]), ports.time_s[:1])[0])
        phi += step
        if abs(step) < places.ROUNDED:
            break
    return phi
