"""The actuator as a model with parameters: prepare a record once, simulate it for any values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import ROW_RATE_HZ, Drive, prepare_log, prepare_table
from torsight.actuator.effects import STAGES, Effect, chosen_effects, load_effects
from torsight.actuator.laws import FAMILIES, apply_law
from torsight.actuator.ports import DWELL_DECADES, SPEEDS_RAD_S, History, Ports
from torsight.actuator.record.segments import by_role
from torsight.actuator.record.turns import REVERSAL_C, turning_points
from torsight.actuator.spec import ActuatorSpec
from torsight.actuator.springs import SPRING_B, Rig, values_of_b
from torsight.actuator.stepping import kernel
from torsight.actuator.stepping import kernel_laws as places
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.storage import check_keys
from torsight.core.law import LawForm
from torsight.core.parameter import Parameter
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.series import extent
from torsight.core.units import DEG, MNM, Floats, Ints
from torsight.core.words.plausible import require_units
from torsight.core.words.shown import Shown, draw_series, span
from torsight.core.words.wording import counted

PhaseLaw = Literal["liang_rogers", "tanaka"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Simulation(Shown):
    """What the model says for every row of a drive.

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
        Wire temperatures that drove it.
    unwound_rad : (float, float)
        By how much A and B had been wound further than they stand in the end.
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
        """Return it at some of its rows (m,)."""
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


@dataclass(frozen=True, repr=False)
class ActuatorModel:
    """The quasi-static model, plain or with effects.

    Attributes
    ----------
    spec : ActuatorSpec
        Characterised values and their uncertainties.
    effects : sequence of str
        Ids of effects that are part of the model; they act in the order of their ids.
    phase_law : str
        ``"liang_rogers"`` (the model) or ``"tanaka"``.
    theta_l_deg : float or None
        A constant recoverable angle in place of the one that the last winding left.
    laws : tuple of LawForm
        Measured laws that are part of the model.
    """

    spec: ActuatorSpec
    effects: Sequence[str] = ()
    phase_law: PhaseLaw = "liang_rogers"
    theta_l_deg: float | None = None
    laws: tuple[LawForm, ...] = ()

    def __repr__(self) -> str:
        parts = ", ".join([*self.effects, *(form.id for form in self.laws)]) or "no effects"
        return f"ActuatorModel({self.spec.source}, {parts}, {counted(len(self.parameters), 'free parameter')})"

    @cached_property
    def chosen(self) -> tuple[Effect, ...]:
        """The effects' declarations, in the order in which they act."""
        return chosen_effects(tuple(self.effects))

    @cached_property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """Every parameter, the exact ones (``fixed``) too."""
        own = self.spec.parameters()
        effects = tuple(parameter for effect in self.chosen for parameter in effect.parameters)
        return own + effects + tuple(parameter for form in self.laws for parameter in form.parameters)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The free parameters: those with an uncertainty, the friction torque, and the effects' own."""
        return tuple(parameter for parameter in self.all_parameters if not parameter.fixed)

    def nominal(self) -> dict[str, float]:
        """Return the start value of every parameter."""
        return {parameter.name: parameter.value for parameter in self.all_parameters}

    def prepare(self, table: SyncedTable, *, row_rate_hz: float = ROW_RATE_HZ, where: str = "record") -> Drive:
        """Return the drive of a merged record: conditioned temperatures, half-cycles, start.

        Raises
        ------
        InputError
            When the record cannot drive a model, turns further than the springs are wound, or has times that are no
            seconds or temperatures that are not in °C.
        """
        self._require_reach(table, where=where)
        require_units(table.time_s, {"temp_a_c": table.temp_a_c, "temp_b_c": table.temp_b_c}, where=where)
        return prepare_table(table, row_rate_hz=row_rate_hz, where=where)

    def _require_reach(self, table: SyncedTable, *, where: str) -> None:
        """Refuse angles that span more than both springs together are wound: they are hardly in radians."""
        known = table.angle_rad[np.isfinite(table.angle_rad)]
        if not len(known):
            return
        # Single frames may be wrong by whole turns.
        low, high = extent(known)
        most_deg = self.spec.values["theta_p_deg"]
        if high - low > most_deg * DEG:
            raise InputError(
                "turns further than the springs are wound",
                where=f"{where}, angle",
                value=f"a range of {(high - low) / DEG:.0f}°",
                limit=f"{most_deg:g}°, the total pre-deformation",
                do="give radians in Python (degrees in files and commands), and check theta_p_deg",
            )

    def prepare_log(self, log: TemperatureLog, *, start_angle_rad: float, where: str = "log") -> Drive:
        """Return the drive of a temperature log alone, at its own instants.

        Raises
        ------
        ConfigError
            When the start is further than the springs are wound.
        InputError
            When the log cannot drive a model, or has times that are no seconds or temperatures that are not in °C.
        """
        reach_deg = self.spec.values["theta_p_deg"] / 2.0
        if not abs(start_angle_rad) < reach_deg * DEG:
            raise ConfigError(
                "the start angle is further than the springs are wound",
                where=f"{where}, first row",
                value=f"{start_angle_rad / DEG:g}°",
                limit=f"−{reach_deg:g}° to {reach_deg:g}°",
                do="give the angle as read at the first row (radians in Python, degrees in files and commands)",
            )
        require_units(log.time_s, {"temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c}, where=where)
        return prepare_log(log, start_angle_rad=start_angle_rad, where=where)

    def ports(self, drive: Drive, values: Mapping[str, float], *, history: History | None = None) -> Ports:
        """Return the plain model's ports for this drive, with the effects applied.

        Raises
        ------
        ConfigError
            When a value is none of the model's parameters; the message names the nearest one.
        """
        nominal = self.nominal()
        if not values.keys() <= nominal.keys():
            self._refuse(values, tuple(nominal))
        given = {**nominal, **values}
        history = history or History()
        counts = drive.cycles.counts()
        before = np.array([history.cycles[spring] for spring in drive.cycles.springs], np.int64)
        zero_rad = given["zero_deg"] * DEG
        rig = Rig.from_values(given)
        whole, log_rows = drive.whole
        alike = not any(name.startswith(SPRING_B) for name in given)
        ports = Ports(
            rig=rig,
            rig_b=rig if alike else Rig.from_values(values_of_b(given)),
            time_s=drive.time_s,
            temp_a_c=drive.temp_a_c,
            temp_b_c=drive.temp_b_c,
            rate_a_c_s=drive.rate_a_c_s,
            rate_b_c_s=drive.rate_b_c_s,
            active=drive.cycles.active,
            half=drive.cycles.half,
            cycle=counts + before,
            half_cycle=np.arange(len(counts)) + sum(history.cycles),
            room_c=drive.room_c,
            drive=whole,
            log_rows=log_rows,
            history=history,
            theta_l_scale=np.ones(len(counts)),
            theta_l_loss_rad=np.zeros(len(counts)),
            friction_scale=np.ones(len(drive)),
            reading=(lambda phi_rad, _time_s: phi_rad + zero_rad,) if zero_rad else (),
        )
        for part in self._parts:
            if isinstance(part, LawForm):
                ports = apply_law(ports, part, np.array([given[name] for name in part.names]))
            elif not (part.is_clock and history.after_record):
                ports = part.apply(ports, given)
        return ports

    def _refuse(self, values: Mapping[str, float], names: Sequence[str]) -> None:
        """Refuse values that are none of this model's, naming what has them."""
        where = f"values of {self!r}"
        for effect in load_effects().values():
            others = [parameter.name for parameter in effect.parameters if parameter.name not in names]
            for name in values.keys() & others:
                raise ConfigError(
                    f"'{name}' is a value of the effect '{effect.id}', which this model lacks",
                    where=where,
                    do="simulate with the model of the fit (fit.model), or with effects=[…] as it has them",
                )
        check_keys(values, names, where=where)

    @cached_property
    def _parts(self) -> tuple[Effect | LawForm, ...]:
        """Effects and laws in the order in which they act: by place, laws after effects."""
        staged: list[tuple[str, Effect | LawForm]] = [(effect.acts_on, effect) for effect in self.chosen]
        staged += [(FAMILIES[form.id].stage, form) for form in self.laws]
        return tuple(part for _, part in sorted(staged, key=lambda item: STAGES.index(item[0])))

    def simulate(
        self,
        drive: Drive,
        values: Mapping[str, float] | None = None,
        *,
        history: History | None = None,
    ) -> Simulation:
        """Step through a drive.

        Parameters
        ----------
        drive : Drive
            From :meth:`prepare`.
        values : mapping of str to float, optional
            Parameters by public name, in the unit that the name ends in; nominal values where absent.
        history : History, optional
            What earlier records left behind.

        Raises
        ------
        ConfigError
            When a value is none of the model's parameters; the message names the nearest one.
        """
        ports = self.ports(drive, values or {}, history=history)
        law = self.phase_law == "tanaka"
        return run_ports(ports, start_angle_rad=drive.start_angle_rad, tanaka=law, theta_l_deg=self.theta_l_deg)


def run_ports(
    ports: Ports, *, start_angle_rad: float, tanaka: bool = False, theta_l_deg: float | None = None
) -> Simulation:
    """Run the kernel on ports, from the angle as read at the first row."""
    start = _unread(start_angle_rad, ports)
    temps = np.stack(by_role(ports.active, ports.temp_a_c, ports.temp_b_c))
    directions = np.ones(temps.shape, np.int8)
    for row in (0, 1) if ports.passive_share > 0.0 else (0,):
        directions[row] = turning_points(temps[row], ports.half, REVERSAL_C)
    per_s = np.zeros(len(ports.time_s))
    per_s[1:] = 1.0 / np.diff(ports.time_s)
    half_turn = 0.5 * ports.rig.theta_p_rad
    out, unwound = kernel.run(
        places.Samples(per_s, temps, ports.active, ports.half, directions, ports.friction_scale, ports.load_change()),
        np.stack([ports.theta_l_scale, ports.theta_l_loss_rad], axis=1),
        scalars(ports, tanaka=tanaka, theta_l_deg=theta_l_deg),
        _tables(ports),
        np.stack([ports.section_weight, ports.section_drop_c, ports.section_drop_share]),
        start + half_turn,
    )
    phi = out[0] - half_turn
    angle = phi
    for reading in ports.reading:
        angle = reading(angle, ports.time_s)
    friction = out[4] - out[3]
    if ports.stray_nm is not None:
        friction = friction + np.interp(phi, ports.phi_grid_rad(), ports.stray_nm)
    return Simulation(
        time_s=ports.time_s,
        angle_rad=angle,
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


def scalars(ports: Ports, *, tanaka: bool = False, theta_l_deg: float | None = None) -> NDArray[np.void]:
    """Return the kernel's scalars (2,) of dtype ``SCALARS``: with spring A's values, and with spring B's."""
    rig, grid = ports.rig, ports.grid_rad()
    # Where the load cannot change while the angle stands, samples at which nothing advances are passed over.
    moving_load = ports.passive_share or ports.load_changes or np.any(ports.friction_scale != 1.0)
    unwound_a, unwound_b = ports.history.unwound_rad or (-1.0, -1.0)
    common = {
        "theta_p": rig.theta_p_rad,
        "tau_c": rig.tau_c_nm,
        "viscous": ports.viscous_nms,
        "viscous_power": ports.viscous_power,
        "latent": ports.latent_c_s,
        "speed_step": 0.0 if ports.speed_friction_nm is None else SPEEDS_RAD_S[1],
        "dwell_step": 0.0 if ports.dwell_factor is None else DWELL_DECADES[1],
        "passive_share": ports.passive_share,
        "tanaka": tanaka,
        "room_c": ports.room_c,
        "grid_start": grid[0],
        "grid_step": grid[1] - grid[0],
        "has_friction": ports.friction_down_nm is not None,
        "has_stray": ports.stray_nm is not None,
        "home_hold": ports.home_hold,
        "first_share": ports.first_share,
        "heating_bend": ports.heating_bend,
        "cooling_bend": ports.cooling_bend,
        "steady": not moving_load,
        "unwound_a": unwound_a,
        "unwound_b": unwound_b,
        "fixed_theta_l": 0.0 if theta_l_deg is None else theta_l_deg * DEG,
    }
    each = ({**common, **_of_spring(ports, spring)} for spring in (0, 1))
    rows = np.array([[values[name] for name in places.SCALARS.names or ()] for values in each], np.float64)
    return rows.view(places.SCALARS)[:, 0]


def _of_spring(ports: Ports, spring: int) -> dict[str, float]:
    """Return the scalars of one spring."""
    rig = (ports.rig, ports.rig_b)[spring]
    side, loading = ((places.SIDE_A, places.LOADING_A), (places.SIDE_B, places.LOADING_B))[spring]
    return {
        "k_a": rig.k_austenite,
        "k_m": rig.k_martensite,
        "k_s": rig.k_stress_induced,
        "a_start": rig.a_start_c,
        # A fit may try values out of order: a window never closes.
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
    """Return the kernel's tables; those that are not there are zero and never looked at."""
    given = (
        ports.friction_down_nm,
        ports.friction_up_nm,
        ports.stray_nm,
        *ports.side_nm,
        *ports.loading_nm,
        ports.speed_friction_nm,
        ports.dwell_factor,
    )
    size = max([2, *(len(table) for table in given if table is not None)])
    return np.stack([np.zeros(size) if table is None else table for table in given])


def _unread(angle_rad: float, ports: Ports) -> float:
    """Return φ at the first row from the angle as read there (the readings are near one to one)."""
    if not ports.reading:
        return angle_rad
    phi = angle_rad
    for _ in range(60):
        read = np.array([phi])
        for reading in ports.reading:
            read = reading(read, ports.time_s[:1])
        step = angle_rad - float(read[0])
        phi += step
        if abs(step) < places.ROUNDED:
            break
    return phi
