"""A fitted or extended model as one file, and its prediction for a later temperature log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel, Simulation
from torsight.actuator.ports import History
from torsight.actuator.spec import actuator_from
from torsight.core.errors import InputError, TorsightError
from torsight.core.records import TemperatureLog
from torsight.core.storage import read_json, write_json
from torsight.core.units import DEG

Array = NDArray[np.float64]

KIND: Final = "torsight actuator model"


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Angles for the instants of a temperature log.

    Attributes
    ----------
    angle_rad : (n,) float64
        As a camera would read it; NaN where the log has no temperature for too long.
    drive : Drive
        The log, conditioned.
    simulation : Simulation
        Everything else that the model says.
    """

    angle_rad: Array
    drive: Drive
    simulation: Simulation


@dataclass(frozen=True, slots=True, eq=False)
class FittedModel:
    """Everything that a prediction needs.

    Attributes
    ----------
    model : ActuatorModel
        Characterised values and effects.
    values : mapping of str to float
        Fitted values of the free parameters, public names and units.
    cycles : (int, int)
        How often A and B were heated in the record of the fit; effects with a memory go on counting from there.
    closure : mapping or None
        A learned correction, as plain numbers; whoever learned it evaluates it.
    account : mapping
        What people may want to know of the fit (error, noise floor, source).
    turns : int
        Whole turns by which the record's reading was ahead of the actuator's own angle.
    """

    model: ActuatorModel
    values: Mapping[str, float]
    cycles: tuple[int, int] = (0, 0)
    closure: Mapping[str, Any] | None = None
    account: Mapping[str, Any] = field(default_factory=dict)
    turns: int = 0

    @property
    def history(self) -> History:
        """What the record of the fit leaves behind."""
        return History(cycles=self.cycles, after_record=True)

    def predict(self, log: TemperatureLog, *, start_angle_rad: float, where: str = "log") -> Prediction:
        """Predict a later temperature log at its own instants.

        Parameters
        ----------
        log : TemperatureLog
            Times and temperatures on the log's own clock: an offset between two recorders' clocks is not applied.
        start_angle_rad : float
            Angle as read at the first row.
        where : str
            Name of the log in messages.

        Raises
        ------
        InputError, NoResultError
            When the log cannot drive the model.
        """
        ahead_rad = 2.0 * np.pi * self._turns_of(start_angle_rad)
        drive = self.model.prepare_log(log, start_angle_rad=start_angle_rad - ahead_rad, where=where)
        simulation = self.model.simulate(drive, self.values, history=self.history)
        return Prediction(np.where(drive.known, simulation.angle_rad + ahead_rad, np.nan), drive, simulation)

    def _turns_of(self, start_angle_rad: float) -> int:
        """Return the whole turns nearest the record's that put the start where the springs can be."""
        values = self.model.spec.values
        reach_rad = DEG * (values["theta_p_deg"] / 2.0 - values["theta_cr_deg"])
        off_rad = start_angle_rad - 2.0 * np.pi * self.turns
        further = max(0, ceil((abs(off_rad) - reach_rad) / (2.0 * np.pi)))
        return self.turns + (further if off_rad > 0.0 else -further)


def fitted_model(
    model: ActuatorModel,
    values: Mapping[str, float],
    drive: Drive,
    *,
    closure: Mapping[str, Any] | None = None,
    account: Mapping[str, Any] | None = None,
) -> FittedModel:
    """Return the model that was fitted to a record, with what the record leaves behind.

    How the springs were wound when the record began (family ``start``) stays part of the model: a later record that
    starts from the same home starts in the same state.
    """
    names = {parameter.name for parameter in model.all_parameters}
    springs = drive.cycles.springs
    return FittedModel(
        model=model,
        values={name: float(value) for name, value in values.items() if name in names},
        cycles=(springs.count(0), springs.count(1)),
        closure=closure,
        account=account or {},
        turns=drive.turns,
    )


def write_model(path: Path, fitted: FittedModel) -> None:
    """Write ``model.json``."""
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
            "closure": fitted.closure,
            "account": dict(fitted.account),
        },
    )


def read_model(path: Path) -> FittedModel:
    """Read ``model.json``.

    Raises
    ------
    InputError
        When the file is missing, is no model, or holds values that make none.
    """
    content = read_json(path)
    if content.get("kind") != KIND:
        raise InputError(
            "is no fitted model", where=f"{path}, key kind", value=repr(content.get("kind")), limit=repr(KIND),
            do="name a model.json of 'torsight fit' or 'torsight discover'",
        )  # fmt: skip
    try:
        model = ActuatorModel(
            actuator_from(content["actuator"], where=f"{path}, actuator"),
            tuple(content["effects"]),
            content["phase_law"],
            content["theta_l_deg"],
        )
        values = {str(name): float(value) for name, value in content["values"].items()}
        missing = {parameter.name for parameter in model.parameters} - set(values)
        if missing:
            raise InputError("lacks a value", where=f"{path}, values", value=", ".join(sorted(missing)))
        return FittedModel(
            model=model,
            values=values,
            cycles=(int(content["cycles"]["a"]), int(content["cycles"]["b"])),
            closure=content["closure"],
            account=content["account"],
            turns=int(content["turns"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        detail = str(error) if isinstance(error, TorsightError) else f"{type(error).__name__}: {error}"
        raise InputError(f"is damaged ({detail})", where=str(path), do="fit the record again") from error
