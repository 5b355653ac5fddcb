"""A fitted or extended model as one file, and its prediction for a later temperature log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import ceil, isfinite
from pathlib import Path
from typing import Any, Final, cast, get_args

import numpy as np

from torsight.actuator.doubt import Doubt, doubt_from
from torsight.actuator.drive import Drive, filled_in
from torsight.actuator.effects import chosen_effects
from torsight.actuator.laws import laws_from
from torsight.actuator.model import ActuatorModel, PhaseLaw, require_start, too_far
from torsight.actuator.ports import History
from torsight.actuator.simulation import Prediction, Simulation
from torsight.actuator.spec import KEYS, actuator_from
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.cycle import stable_cycle
from torsight.core.errors import ConfigError, InputError, TorsightError, require_kind
from torsight.core.files.config import get_names, get_number, get_table, get_text, get_whole, shown_value
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_json, write_json
from torsight.core.frozen import Frozen
from torsight.core.parameter import Parameter
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG, Floats
from torsight.core.words.plausible import MOST_ROWS_APART_S, SHORTEST_S
from torsight.core.words.shown import Shown
from torsight.core.words.wording import number

KIND: Final = "torsight actuator model"
_KEYS: Final = (
    "schema", "kind", "actuator", "effects", "phase_law", "theta_l_deg", "values", "cycles", "turns",
    "start_angle_deg", "duration_s", "end", "laws", "account", "doubt",
)  # fmt: skip
"""Keys of ``model.json``."""
_MOST_COUNTED: Final = int(MOST_ROWS_APART_S / SHORTEST_S)
"""Largest number of cycles or whole turns in a file: of the shortest cycles in the longest record."""
_SAME_HOME_RAD: Final = 2.0 * DEG
"""Largest distance of two angles that count as the same home: a choice, stated in the documentation."""
_FURTHEST_DEG: Final = KEYS["theta_p_deg"].upper
_COLD: Final = 0.999
"""Martensite fraction above which a spring counts as cold: by the law's cosine the temperature is then at most
arccos(2 · 0.999 − 1) / π = 2 % of the window above M_f, 0.3 °C."""


@dataclass(frozen=True, slots=True)
class End:
    """State of the cold springs at a record's end: the last reading, and how far A and B are unwound, rad."""

    angle_rad: float
    unwound_rad: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FittedModel(Frozen, Shown):
    """A fitted model with all that a prediction needs.

    Attributes
    ----------
    model : ActuatorModel
        Characterised values and effects.
    values : mapping of str to float
        Fitted values of the free parameters, public names and units.
    cycles : (int, int)
        Number of heatings of A and of B up to the end of the fitted record; effects with a memory continue this count.
    account : mapping
        Information on the fit for the reader (error, noise floor, source).
    turns : int
        Whole turns by which the record's readings exceed the actuator's own angle.
    start_angle_rad : float or None
        The actuator's own angle at the record's start. The fitted state of the springs there also holds for logs that
        start at this angle. None where it is not known.
    duration_s : float
        Length of the record.
    end : End or None
        State of the springs at the record's end, from which logs that start at its angle continue. None where it is not
        known.
    doubt : Doubt or None
        The model's uncertainty; None where it is not known.
    """

    model: ActuatorModel
    values: Mapping[str, float]
    cycles: tuple[int, int] = (0, 0)
    account: Mapping[str, Any] = field(default_factory=dict)
    turns: int = 0
    start_angle_rad: float | None = None
    duration_s: float = 0.0
    end: End | None = None
    doubt: Doubt | None = None

    def facts(self) -> dict[str, str]:
        """Return the effects, the measured laws and the values."""
        units = {parameter.name: parameter.unit for parameter in self.model.all_parameters}
        values = {name: f"{number(value)} {units[name]}".strip() for name, value in self.values.items()}
        laws = {"laws": ", ".join(form.id for form in self.model.laws)} if self.model.laws else {}
        return {"effects": ", ".join(self.model.effects) or "none", **laws, **values}

    def __repr__(self) -> str:
        effects = ", ".join(self.model.effects) or "no effects"
        laws = f", laws: {', '.join(form.id for form in self.model.laws)}" if self.model.laws else ""
        tau = f"friction torque {number(self.values['tau_c_mnm'])} mN·m"
        return f"FittedModel({effects}{laws}, {tau}, {len(self.values)} values)"

    def _columns(self) -> dict[str, Any]:
        units = {parameter.name: parameter.unit for parameter in self.model.all_parameters}
        names = list(self.values)
        return {"name": names, "value": list(self.values.values()), "unit": [units[name] for name in names]}

    def _draw(self, axes: Any) -> None:
        """Draw the angle against the driven spring's temperature in a full cycle: A heated and cooled, then B."""
        log, start_rad = _full_cycle(Rig.from_values({**self.model.spec.values, **self.values}))
        found = self.predict(log, start_angle_rad=start_rad)
        first = log.temp_a_c > log.temp_b_c
        for name, rows, temp_c in (("A driven", first, log.temp_a_c), ("B driven", ~first, log.temp_b_c)):
            axes.plot(temp_c[rows], found.angle_rad[rows] / DEG, label=name)
        axes.set(xlabel="temperature of the driven spring, °C", ylabel="angle, °")
        axes.legend()

    def history(self, start_angle_rad: float) -> History:
        """Return the history that the fitted record provides for a log that starts at an angle.

        If this angle is within 2° of the record's end, and nearer to the end than to the record's start, the springs
        are in their state at the end.
        """
        unwound_rad = None
        if self.end is not None:
            off_rad = abs(start_angle_rad - self.end.angle_rad)
            began_rad = np.inf if self.start_angle_rad is None else self.start_angle_rad
            if off_rad <= min(_SAME_HOME_RAD, abs(start_angle_rad - began_rad)):
                unwound_rad = self.end.unwound_rad
        return History(self.cycles, after_record=True, unwound_rad=unwound_rad)

    def predict(self, log: TemperatureLog, *, start_angle_rad: float, where: str = "log") -> Prediction:
        """Predict a later temperature log at its own instants.

        Parameters
        ----------
        log : TemperatureLog
            Times and temperatures on the log's own clock: an offset between two recorders' clocks is not applied.
        start_angle_rad : float
            The reading of the angle at the first row.
        where : str
            Name of the log in messages.

        Raises
        ------
        ConfigError
            When the start angle is no number, or outside half of the total winding.
        InputError
            When the log cannot drive the model.
        """
        require_kind(log, TemperatureLog, where=f"predict, {where}", do="read_log(path) gives one")
        require_start(start_angle_rad, where=where)
        ahead_rad = 2.0 * np.pi * self._turns_of(start_angle_rad, where=where)
        whole, rows = filled_in(log)
        start_rad = start_angle_rad - ahead_rad
        drive = self.model.prepare_log(whole, start_angle_rad=start_rad, where=where, readings=log)
        simulation = self.simulate(drive).at(rows)
        angle_rad = np.where(drive.known[rows], simulation.angle_rad + ahead_rad, np.nan)
        return Prediction(angle_rad, drive, simulation, rows)

    def simulate(self, drive: Drive) -> Simulation:
        """Simulate a prepared log, with the history that the fitted record provides."""
        start_rad = drive.start_angle_rad
        return self.model.simulate(drive, self._values_from(start_rad), history=self.history(start_rad))

    def jumps_rad(self, drive: Drive) -> Floats:
        """Return the standard deviation (n,) of the angle, rad, from the rounding of the instants of jumps."""
        start_rad = drive.start_angle_rad
        return self.model.seen_rad(drive, self._values_from(start_rad), history=self.history(start_rad))[1]

    def neighbours(self) -> Iterator[tuple[FittedModel, FittedModel]]:
        """Yield pairs of models one standard deviation to either side along each axis of the values' uncertainty."""
        for step in self.doubt.steps() if self.doubt is not None else ():
            yield self._moved(step, 1.0), self._moved(step, -1.0)

    def alternatives(self) -> Iterator[tuple[FittedModel, float]]:
        """Yield the models of the record's other explanations, each with its share of the probability."""
        for other in self.doubt.alternatives if self.doubt is not None else ():
            model = replace(self.model, effects=other.effects, laws=other.laws)
            yield replace(self, model=model, values=other.values), other.share

    def _moved(self, step: Mapping[str, float], factor: float) -> FittedModel:
        """Return the model with its values changed by ``factor * step``, within their bounds."""
        bounds = {p.name: (p.lower, p.upper) for p in self.model.all_parameters}
        moved = {name: float(np.clip(self.values[name] + factor * by, *bounds[name])) for name, by in step.items()}
        return replace(self, values={**self.values, **moved})

    def other_starts(self, start_angle_rad: float) -> Iterator[FittedModel]:
        """Yield models whose springs start otherwise, by one standard deviation of each value's prior to either side.

        None where a log starts in the state of the record's start or of its end, which is known.
        """
        if self._starts_as_record(start_angle_rad) or self.history(start_angle_rad).unwound_rad is not None:
            return
        usual = self._values_from(start_angle_rad)
        for parameter in self._of_the_start():
            for side in (-1.0, 1.0):
                value = usual[parameter.name] + side * (parameter.sigma or 0.0)
                moved = {parameter.name: float(np.clip(value, parameter.lower, parameter.upper))}
                yield replace(self, values=usual | moved, start_angle_rad=None)

    def _starts_as_record(self, start_angle_rad: float) -> bool:
        return self.start_angle_rad is None or abs(start_angle_rad - self.start_angle_rad) <= _SAME_HOME_RAD

    def _of_the_start(self) -> Iterator[Parameter]:
        """Yield the parameters of the state at the record's start (family ``start``)."""
        for effect in chosen_effects(tuple(self.model.effects)):
            if effect.family == "start":
                yield from effect.parameters

    def _values_from(self, start_angle_rad: float) -> dict[str, float]:
        """Return the values for a log that starts at an angle.

        If this is not the record's start, the values of the state at the start have their null.
        """
        values = dict(self.values)
        if not self._starts_as_record(start_angle_rad):
            values |= {p.name: p.null for p in self._of_the_start() if p.null is not None}
        return values

    def _turns_of(self, start_angle_rad: float, *, where: str) -> int:
        """Return the number of whole turns by which the reading at the start exceeds the actuator's own angle.

        A film begins within half a turn of zero, whatever the actuator's own angle is. A start within half a turn may
        thus exceed it by any number of turns: the result is the one nearest to the record's number for which the
        springs can be at rest. A larger start angle counts turns as the record does, or is the actuator's own angle,
        which lies within half of the total winding.

        Raises ConfigError when a larger start angle is neither.
        """
        values = self.model.spec.values
        wound_rad = DEG * values["theta_p_deg"] / 2.0
        reach_rad = wound_rad - DEG * values["theta_cr_deg"]
        off_rad = start_angle_rad - 2.0 * np.pi * self.turns
        if abs(start_angle_rad) <= np.pi:
            further = max(0, ceil((abs(off_rad) - reach_rad) / (2.0 * np.pi)))
            return self.turns + (further if off_rad > 0.0 else -further)
        known = ((self.turns, off_rad), (0, start_angle_rad))
        for most_rad in (reach_rad, wound_rad):
            for turns, own_rad in known:
                if abs(own_rad) < most_rad:
                    return turns
        raise too_far(start_angle_rad, wound_rad / DEG, turns=dict.fromkeys((0, self.turns)), where=where)


def _full_cycle(rig: Rig) -> tuple[TemperatureLog, float]:
    """Return the log of a full cycle, A and then B, one row per second, and the angle of its start, rad.

    When cold, a spring is full martensite without stress; when hot, full austenite under the stress at the stroke's
    end. A quarter of the transformation's width beyond both makes them complete.
    """
    cycle = stable_cycle(rig)
    torque_nm = rig.loading_torque(rig.theta_p_rad - cycle.theta_2_rad) + rig.tau_c_nm
    hot_c = rig.a_finish_c + torque_nm * rig.stress_per_torque / rig.c_austenite
    hot_c += 0.25 * (rig.a_finish_c - rig.a_start_c)
    cold_c = rig.m_finish_c - 0.25 * (rig.m_start_c - rig.m_finish_c)
    # The plain model does not depend on the duration of a heating, and a sensor's lag is much shorter.
    edges_s, edges_c = 200.0 * np.arange(5), [cold_c, hot_c, cold_c]
    time_s = np.arange(0.0, edges_s[-1] + 1.0)
    a_c, b_c = np.interp(time_s, edges_s[:3], edges_c), np.interp(time_s, edges_s[2:], edges_c)
    return TemperatureLog(time_s, a_c, b_c), cycle.theta_1_rad - 0.5 * rig.theta_p_rad


def fitted_model(
    model: ActuatorModel,
    values: Mapping[str, float],
    drive: Drive,
    *,
    account: Mapping[str, Any] | None = None,
    doubt: Doubt | None = None,
    history: History | None = None,
) -> FittedModel:
    """Return the model that was fitted to a record, with the state of the springs at the record's start and end.

    The state at the start (family ``start``) stays part of the model: a later record that starts from the same home
    (within 2°) starts in this state. A record that starts at the end angle (within 2°, and nearer to it than to the
    start) continues from the simulated state at the end. ``history`` is the state after the records before this one.
    """
    own = {name: float(values[name]) for name in model.nominal() if name in values}
    springs = drive.cycles.springs
    before = (history or History()).cycles
    return FittedModel(
        model=model,
        values=own,
        cycles=(before[0] + springs.count(0), before[1] + springs.count(1)),
        account=account or {},
        turns=drive.turns,
        start_angle_rad=drive.start_angle_rad,
        duration_s=float(drive.time_s[-1] - drive.time_s[0]),
        end=_end(model, own, drive, history),
        doubt=doubt,
    )


def _end(model: ActuatorModel, values: Mapping[str, float], drive: Drive, history: History | None = None) -> End | None:
    """Return the springs' state at a record's end; None where they are not cold or no angle is known.

    A film may end before the log does: the disk has moved since its last reading as the simulation has.
    """
    simulation, read = model.simulate(drive, values, history=history), np.flatnonzero(np.isfinite(drive.angle_rad))
    cold = min(simulation.xi_a[-1], simulation.xi_b[-1]) > _COLD
    if not (cold and len(read)):
        return None
    since_rad = simulation.angle_rad[-1] - simulation.angle_rad[read[-1]]
    return End(float(drive.angle_rad[read[-1]] + since_rad), simulation.unwound_rad)


def write_model(path: AnyPath, fitted: FittedModel) -> None:
    """Write ``model.json``."""
    path = Path(path)
    model = fitted.model
    write_json(
        path,
        {
            "kind": KIND,
            "actuator": model.spec.to_tables(),
            "effects": list(model.effects),
            "phase_law": model.phase_law,
            "theta_l_deg": model.theta_l_deg,
            "values": dict(fitted.values),
            "cycles": {"a": fitted.cycles[0], "b": fitted.cycles[1]},
            "turns": fitted.turns,
            "start_angle_deg": None if fitted.start_angle_rad is None else fitted.start_angle_rad / DEG,
            "duration_s": fitted.duration_s,
            "end": None if fitted.end is None else _end_to_json(fitted.end),
            "laws": [form.to_json() for form in model.laws],
            "account": dict(fitted.account),
            "doubt": None if fitted.doubt is None else fitted.doubt.to_json(),
        },
    )


def _end_to_json(end: End) -> dict[str, Any]:
    unwound_deg = dict(zip("ab", (rad / DEG for rad in end.unwound_rad), strict=True))
    return {"angle_deg": end.angle_rad / DEG, "unwound_deg": unwound_deg}


def _end_from(table: Mapping[str, Any], *, most_deg: float) -> End:
    """Read the springs' state at a record's end; neither is unwound by more than the total winding."""
    where = "end"
    check_keys(table, ("angle_deg", "unwound_deg"), where=where)
    unwound = get_table(table, "unwound_deg", where=where, required=True)
    a, b = (DEG * get_number(unwound, spring, where=where, lower=0.0, upper=most_deg) for spring in "ab")
    return End(DEG * get_number(table, "angle_deg", where=where, lower=-_FURTHEST_DEG, upper=_FURTHEST_DEG), (a, b))


def read_model(path: AnyPath) -> FittedModel:
    """Read ``model.json``.

    Raises
    ------
    InputError
        When the file is missing, is no model, or holds invalid values.
    """
    path = Path(path)
    content = read_json(path)
    if content.get("kind") != KIND:
        raise InputError(
            "is no fitted model", where=f"{path}, key kind", value=shown_value(content, "kind"), limit=repr(KIND),
            do="name a model.json of 'torsight fit' or 'torsight discover'",
        )  # fmt: skip
    try:
        return _model_from(content)
    except TorsightError as error:
        text = f"is damaged, or of another version of torsight ({error})"
        raise InputError(text, where=str(path), do="fit the record again") from error


def _optional_deg(content: Mapping[str, Any], key: str, *, where: str, lower: float) -> float | None:
    known = content.get(key) is not None
    return get_number(content, key, where=where, lower=lower, upper=_FURTHEST_DEG) if known else None


def _model_from(content: Mapping[str, Any]) -> FittedModel:
    where = "model"
    # A part that is not known would be left out of every prediction.
    check_keys(content, _KEYS, where=where)
    law = get_text(content, "phase_law", where=where, choices=get_args(PhaseLaw))
    effects = get_names(content, "effects", where=where)
    theta_l_deg = _optional_deg(content, "theta_l_deg", where=where, lower=0.0)
    spec = actuator_from(get_table(content, "actuator", where=where, required=True), where="actuator")
    laws = laws_from(content.get("laws"), where=f"{where}, key laws")
    model = ActuatorModel(spec, effects, cast("PhaseLaw", law), theta_l_deg, laws)
    cycles = get_table(content, "cycles", where=where, required=True)
    counts = tuple(get_whole(cycles, name, where="cycles", lower=0, upper=_MOST_COUNTED) for name in ("a", "b"))
    start_deg = _optional_deg(content, "start_angle_deg", where=where, lower=-_FURTHEST_DEG)
    end = None
    if content.get("end") is not None:
        end = _end_from(get_table(content, "end", where=where), most_deg=spec.values["theta_p_deg"])
    doubt = None
    if content.get("doubt") is not None:
        doubt = doubt_from(get_table(content, "doubt", where=where), free=[p.name for p in model.parameters])
        for other in doubt.alternatives:
            _values(other.values, ActuatorModel(spec, other.effects, model.phase_law, theta_l_deg, other.laws))
    return FittedModel(
        model=model,
        values=_values(get_table(content, "values", where=where, required=True), model),
        cycles=(counts[0], counts[1]),
        account=get_table(content, "account", where=where),
        turns=get_whole(content, "turns", where=where, lower=-_MOST_COUNTED, upper=_MOST_COUNTED),
        start_angle_rad=None if start_deg is None else start_deg * DEG,
        duration_s=get_number(content, "duration_s", where=where, lower=0.0, upper=MOST_ROWS_APART_S),
        end=end,
        doubt=doubt,
    )


def _values(table: Mapping[str, Any], model: ActuatorModel) -> dict[str, float]:
    """Return the fitted values, each checked against its bounds in the fit."""
    parameters = {parameter.name: parameter for parameter in model.all_parameters}
    check_keys(table, tuple(parameters), where="values")
    missing = [name for name, parameter in parameters.items() if name not in table and not parameter.fixed]
    if missing:
        raise ConfigError("lacks a value", where="values", value=", ".join(missing))
    values = {}
    for name in table:
        lower, upper = parameters[name].lower, parameters[name].upper
        slack = 1e-6 * max(abs(bound) for bound in (lower, upper, 1.0) if isfinite(bound))
        values[name] = get_number(table, name, where="values", lower=lower - slack, upper=upper + slack)
    return values
