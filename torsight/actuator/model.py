"""The actuator as a model with parameters: prepare a record once, simulate it for any values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
from math import isfinite
from numbers import Real
from typing import Any, Final, Literal

import numpy as np

from torsight.actuator.drive import Drive, prepare_log, prepare_table
from torsight.actuator.effects import STAGES, Effect, chosen_effects, load_effects
from torsight.actuator.laws import FAMILIES, apply_law
from torsight.actuator.ports import History, Ports
from torsight.actuator.record.segments import turn_of
from torsight.actuator.simulation import Simulation, run_ports, seen_of_ports
from torsight.actuator.spec import ActuatorSpec
from torsight.actuator.springs import SPRING_B, Rig, values_of_b
from torsight.core.errors import ConfigError, InputError, NoResultError, require_kind
from torsight.core.files.storage import check_keys
from torsight.core.law import LawForm
from torsight.core.parameter import Parameter
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.series import extent, share_explained
from torsight.core.units import DEG, Flags, Floats
from torsight.core.words.plausible import require_units
from torsight.core.words.wording import counted, number

PhaseLaw = Literal["liang_rogers", "tanaka"]
_NO_HISTORY: Final = History()
_EARLY: Final = ("clock", "temperature")
"""Stages that come before everything that depends on the springs."""


@dataclass(frozen=True, repr=False)
class ActuatorModel:
    """The quasi-static model, plain or with effects.

    Attributes
    ----------
    spec : ActuatorSpec
        Characterised values and their uncertainties.
    effects : sequence of str, or str
        Ids of effects that are part of the model; they act in the order of their ids.
    phase_law : str
        ``"liang_rogers"`` (the model) or ``"tanaka"``.
    theta_l_deg : float or None
        A constant recoverable angle in place of the one that follows from the last winding.
    laws : tuple of LawForm
        Measured laws that are part of the model.
    """

    spec: ActuatorSpec
    effects: Sequence[str] = ()
    phase_law: PhaseLaw = "liang_rogers"
    theta_l_deg: float | None = None
    laws: tuple[LawForm, ...] = ()
    _cache: dict[int, tuple[tuple[tuple[Any, ...], Ports], ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        require_kind(self.spec, ActuatorSpec, where="ActuatorModel, spec", do="read_actuator(path) gives one")
        if isinstance(self.effects, str):
            object.__setattr__(self, "effects", (self.effects,))

    def __repr__(self) -> str:
        parts = ", ".join([*self.effects, *(form.id for form in self.laws)]) or "no effects"
        return f"ActuatorModel({self.spec.source}, {parts}, {counted(len(self.parameters), 'free parameter')})"

    @cached_property
    def chosen(self) -> tuple[Effect, ...]:
        """The effects' declarations, in the order in which they act."""
        return chosen_effects(tuple(self.effects))

    @cached_property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """All parameters, including the exact ones (``fixed``)."""
        own = self.spec.parameters()
        effects = tuple(parameter for effect in self.chosen for parameter in effect.parameters)
        return own + effects + tuple(parameter for form in self.laws for parameter in form.parameters)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The free parameters: those with an uncertainty, the friction torque, and the effects' own."""
        return tuple(parameter for parameter in self.all_parameters if not parameter.fixed)

    def nominal(self) -> dict[str, float]:
        """Return the start value of every parameter."""
        return dict(self._nominal)

    @cached_property
    def _nominal(self) -> dict[str, float]:
        return {parameter.name: parameter.value for parameter in self.all_parameters}

    @cached_property
    def _equal_springs(self) -> bool:
        """Whether no value is given for spring B alone, so that both springs have the same values."""
        return not any(name.startswith(SPRING_B) for name in self._nominal)

    def prepare(self, table: SyncedTable, *, where: str = "record") -> Drive:
        """Return the drive of a merged record: conditioned temperatures, half-cycles, start.

        A record that begins within a transformation is cut at the first row at which both springs are cold, if a spring
        is heated after that row.

        Raises
        ------
        InputError
            When the record cannot drive a model, turns further than the springs are wound, or has times that are no
            seconds or temperatures that are not in °C.
        """
        require_kind(table, SyncedTable, where=f"prepare, {where}", do="read_merged(path) gives one")
        self._require_reach(table, where=where)
        require_units(table.time_s, {"temp_a_c": table.temp_a_c, "temp_b_c": table.temp_b_c}, where=where)
        drive = prepare_table(table, where=where)
        rig = Rig.from_values(self._nominal)
        if not _begins_within(drive, self.simulate(drive.at(np.arange(1))), rig):
            return self._in_its_turn(drive)
        row = _first_cold_row(drive, rig)
        later = table.at(table.time_s >= drive.time_s[row]) if row < len(drive) else None
        try:
            cut = drive if later is None else prepare_table(later, where=where)
        except (InputError, NoResultError):
            cut = drive
        return replace(self._in_its_turn(cut), left_out_s=float(cut.time_s[0] - drive.time_s[0]))

    def _in_its_turn(self, drive: Drive) -> Drive:
        """Return the drive with those whole turns with which the characterised values explain its angles best.

        A film cannot tell the turns. Where the disk moves to one side only, the middle of its angles says little. Other
        turns than those of the middle have to explain something of the angles, and with half the error: a wrong
        actuator file says nothing of the turn.
        """
        reach_rad, rows = 0.5 * self.spec.values["theta_p_deg"] * DEG, drive.measured
        if not rows.any():
            return drive

        def left(one: Drive) -> float:
            return 1.0 - share_explained(one.angle_rad[rows], self.simulate(one).angle_rad[rows])

        others = {left(one): one for one in map(drive.ahead, (-1, 1)) if abs(one.start_angle_rad) < reach_rad}
        least = min(others, default=np.inf)
        return others[least] if least < min(1.0, 0.25 * left(drive)) else drive

    def _require_reach(self, table: SyncedTable, *, where: str) -> None:
        """Refuse angles whose range exceeds the total winding: such values are most likely not in radians."""
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
                limit=f"{most_deg:g}°, the total winding of both springs",
                do="give radians in Python (degrees in files and commands), and check theta_p_deg",
            )

    def prepare_log(
        self, log: TemperatureLog, *, start_angle_rad: float, where: str = "log", readings: TemperatureLog | None = None
    ) -> Drive:
        """Return the drive of a temperature log alone, at its own instants.

        Where ``log`` has interpolated rows between its readings, ``readings`` is the log without these rows.

        Raises
        ------
        ConfigError
            When the start is no number, or further than the springs are wound.
        InputError
            When the log cannot drive a model, or has times that are no seconds or temperatures that are not in °C.
        """
        require_kind(log, TemperatureLog, where=f"prepare_log, {where}", do="read_log(path) gives one")
        require_start(start_angle_rad, where=where)
        reach_deg = self.spec.values["theta_p_deg"] / 2.0
        if not abs(start_angle_rad) < reach_deg * DEG:
            raise too_far(start_angle_rad, reach_deg, where=where)
        require_units(log.time_s, {"temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c}, where=where)
        return prepare_log(log, start_angle_rad=start_angle_rad, where=where, readings=readings)

    def begin(self, drive: Drive, *, history: History = _NO_HISTORY) -> Ports:
        """Return the ports of a drive before any effect or law acts; their arrays are shared and never written to."""
        counts = drive.cycles.counts()
        before = np.array([history.cycles[spring] for spring in drive.cycles.springs], np.int64)
        whole, log_rows = drive.whole
        same = ("time_s", "temp_a_c", "temp_b_c", "rate_a_c_s", "rate_b_c_s", "room_c")
        rig = Rig.from_values(self._nominal)
        return Ports(
            **{name: getattr(drive, name) for name in same},
            rig=rig,
            rig_b=rig,
            active=drive.cycles.active,
            half=drive.cycles.half,
            cycle=counts + before,
            half_cycle=np.arange(len(counts)) + sum(history.cycles),
            drive=whole,
            log_rows=log_rows,
            history=history,
            theta_l_scale=np.ones(len(counts)),
            theta_l_loss_rad=np.zeros(len(counts)),
            warmer_heating_c=np.zeros(len(counts)),
            warmer_cooling_c=np.zeros(len(counts)),
            friction_scale=np.ones(len(drive)),
        )

    def ports(self, drive: Drive, values: Mapping[str, float], *, history: History | None = None) -> Ports:
        """Return the plain model's ports for this drive, with the effects applied.

        Raises
        ------
        ConfigError
            When a name in ``values`` is no parameter of the model; the message gives the most similar name.
        """
        history = history or _NO_HISTORY
        begun = self._cached(0, (drive, history), lambda: self.begin(drive, history=history))
        return self._acted(begun, values)

    def _acted(self, begun: Ports, values: Mapping[str, float]) -> Ports:
        """Return ports on which the values, effects and laws have acted."""
        if not values.keys() <= self._nominal.keys():
            self._refuse(values, tuple(self._nominal))
        given = {**self._nominal, **values}
        rig, zero_rad = Rig.from_values(given), given["zero_deg"] * DEG
        ports = self._temperature_ports(begun, given).changed(
            rig=rig,
            rig_b=rig if self._equal_springs else Rig.from_values(values_of_b(given)),
            reading=(lambda phi_rad, _time_s: phi_rad + zero_rad,) if zero_rad else (),
            tanaka=self.phase_law == "tanaka",
            fixed_theta_l=(self.theta_l_deg or 0.0) * DEG,
        )
        return _applied(ports, self._parts[len(self._leading_parts) :], given)

    def _temperature_ports(self, ports: Ports, given: Mapping[str, float]) -> Ports:
        """Return the ports after the leading parts, which act on clocks and temperatures alone.

        Successive simulations of a record mostly differ in a single value: the results of all parts that do not depend
        on this value come from the cache.
        """
        for place, (part, names) in enumerate(self._leading_parts, 1):
            ports = self._cached(place, (ports, *map(given.__getitem__, names)), _applied, ports, (part,), given)
        return self._cached(-1, (ports,), lambda: ports.changed(samples=ports.sampled()))

    def _cached(self, place: int, asked: tuple[Any, ...], make: Callable[..., Ports], *given: Any) -> Ports:
        """Return the ports of a place from the cache if either of its last two inputs was ``asked``; else compute."""
        kept = self._cache.get(place, ())
        found = next((one for one in kept if one[0] == asked), None) or (asked, make(*given))
        if found not in kept[:1]:
            self._cache[place] = (found, *kept[:1])
        return found[1]

    @cached_property
    def _leading_parts(self) -> tuple[tuple[Effect | LawForm, tuple[str, ...]], ...]:
        """The leading parts, with their parameters' names, that depend only on temperatures and these parameters.

        Effects of other packages may depend on more, so that they end the sequence.
        """
        leading = takewhile(_on_temperatures, self._parts)
        return tuple((part, tuple(parameter.name for parameter in part.parameters)) for part in leading)

    def _refuse(self, values: Mapping[str, float], names: Sequence[str]) -> None:
        """Refuse names that are no parameters of this model; the message names the effect that has the parameter."""
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
        """Effects and laws in the order in which they act: by stage, within a stage laws after effects."""
        staged: list[tuple[str, Effect | LawForm]] = [(effect.acts_on, effect) for effect in self.chosen]
        staged += [(FAMILIES[form.id].stage, form) for form in self.laws]
        return tuple(part for _, part in sorted(staged, key=lambda item: STAGES.index(item[0])))

    def simulate(
        self, drive: Drive, values: Mapping[str, float] | None = None, *, history: History | None = None
    ) -> Simulation:
        """Step through a drive.

        Parameters
        ----------
        drive : Drive
            From :meth:`prepare`.
        values : mapping of str to float, optional
            Parameters by public name, in the unit that the name ends in; nominal values where absent.
        history : History, optional
            State of the springs after earlier records.

        Raises
        ------
        ConfigError
            When a name in ``values`` is no parameter of the model, where the message gives the most similar name, or a
            value is not finite.
        """
        values = values or {}
        for name, value in values.items():
            if not isfinite(value):
                raise ConfigError("is not finite", where=f"values of {self!r}, '{name}'", value=value)
        return run_ports(self.ports(drive, values, history=history))

    def angle_rad(self, drive: Drive, values: Mapping[str, float], *, history: History | None = None) -> Floats:
        """Return the angle (n,) that :meth:`simulate` gives, alone."""
        return self.simulate(drive, values, history=history).angle_rad

    def seen_rad(
        self, drive: Drive, values: Mapping[str, float], *, history: History | None = None
    ) -> tuple[Floats, Floats]:
        """Return the expected angle (n,) of the rows and its standard deviation (n,) from jumps between two rows."""
        return seen_of_ports(self.ports(drive, values, history=history))

    def seen_from(self, begun: Ports, values: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Return the result of :meth:`seen_rad` for ports of :meth:`begin`; a fit calls it tens of thousands of times.

        The ports may be those of another model of the same actuator.
        """
        return seen_of_ports(self._acted(begun, values))


def require_start(start_angle_rad: object, *, where: str) -> None:
    """Refuse a start angle that is no finite number."""
    if not isinstance(start_angle_rad, Real) or not isfinite(start_angle_rad):
        raise ConfigError(
            "the start angle is no number",
            where=f"{where}, first row",
            value=repr(start_angle_rad),
            limit="a number: degrees in a command, radians in Python",
            do="give the angle as read at the first row",
        )


def too_far(start_angle_rad: float, wound_deg: float, *, where: str, turns: Iterable[int] = (0,)) -> ConfigError:
    """Return the error of a start beyond the springs' winding around each of some whole turns."""
    middles = [(360.0 * one - wound_deg, 360.0 * one + wound_deg) for one in turns]
    return ConfigError(
        "the start angle is further than the springs are wound",
        where=f"{where}, first row",
        value=f"{start_angle_rad:g} rad = {start_angle_rad / DEG:g}°".replace("-", "−"),
        limit=" or ".join(f"more than {number(low)}° and less than {number(high)}°" for low, high in middles),
        do="give the angle as read at the first row, without whole turns that were counted before it: degrees in a "
        "command, radians in Python (were these degrees?)",
    )


def _begins_within(drive: Drive, simulation: Simulation, rig: Rig) -> bool:
    """Return whether at the first row the driven spring recovers already, or the other one has not cooled down.

    Every half-cycle of the model begins with both springs as martensite. A film that starts when a spring is hot shows
    the end of a transformation without its beginning, and this error remains in the angle until the springs are cold.
    Only the first row of ``simulation`` is used.
    """
    driven = drive.cycles.springs[0]
    recovers = (simulation.xi_a, simulation.xi_b)[driven][0] < 1.0
    other_nm = (simulation.torque_b_nm, simulation.torque_a_nm)[driven][0]
    finish_c = rig.m_finish_c + other_nm * rig.stress_per_torque / rig.c_martensite
    return bool(recovers or not _cold(drive, finish_c)[1 - driven][0])


def _first_cold_row(drive: Drive, rig: Rig) -> int:
    """Return the first row at which both springs are martensite under any torque; without one, the number of rows."""
    a, b = _cold(drive, rig.m_finish_c)
    both = a & b
    return int(np.argmax(both)) if both.any() else len(drive)


def _cold(drive: Drive, finish_c: float) -> tuple[Flags, Flags]:
    """Return the masks (n,) of the rows at which A and B are martensite, as completely as they get in this record."""
    slack_c = turn_of(drive.noise_c)
    a, b = (temp_c <= max(finish_c, float(temp_c.min()) + slack_c) for temp_c in (drive.temp_a_c, drive.temp_b_c))
    return a, b


def _on_temperatures(part: Effect | LawForm) -> bool:
    if isinstance(part, LawForm):
        return FAMILIES[part.id].stage in _EARLY
    return part.acts_on in _EARLY and part.apply.__module__.startswith(__package__ or "")


def _applied(ports: Ports, parts: Sequence[Effect | LawForm], given: Mapping[str, float]) -> Ports:
    """Return ports on which effects and laws have acted, one after the other."""
    for part in parts:
        if isinstance(part, LawForm):
            ports = apply_law(ports, part, given)
        elif not _of_the_record_alone(part, ports.history):
            ports = part.apply(ports, given)
    return ports


def _of_the_record_alone(effect: Effect, history: History) -> bool:
    """Return whether an effect held in the fitted record alone: its clock, or the state of the springs before it."""
    return (effect.is_clock and history.after_record) or (effect.family == "start" and history.unwound_rad is not None)
