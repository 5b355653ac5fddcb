"""A measured law as an effect's file: it is one, zero is the plain model, and it does what the law did."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from torsight.actuator.drive import Drive, prepare_log
from torsight.actuator.effects import Effect
from torsight.actuator.fitted import FittedModel
from torsight.actuator.laws import FAMILIES
from torsight.actuator.model import ActuatorModel
from torsight.actuator.simulation import run_ports
from torsight.actuator.spec import reference_spec
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.law import LawForm
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG
from torsight.discovery.actuator.export_effect import export_effect
from torsight.discovery.measured_law import MeasuredLaw


def heated() -> Drive:
    """Return A heated to 80 °C and cooled, then B."""
    time_s = np.arange(0.0, 1200.0, 0.5)
    rise = np.interp(time_s % 600.0, [0.0, 20.0, 300.0, 420.0, 600.0], [23.0, 23.0, 80.0, 26.0, 23.0])
    a, b = np.where(time_s < 600.0, rise, 23.0), np.where(time_s < 600.0, 23.0, rise)
    return prepare_log(TemperatureLog(time_s, a, b), start_angle_rad=170.0 * DEG)


def form() -> LawForm:
    nodes = np.linspace(-250.0, 250.0, 21)
    return LawForm("torque_angle_deg", nodes, 0.05 * np.sin(nodes * DEG)[:, None], "mN·m", 0.05, prior=True)


def told(law: LawForm) -> MeasuredLaw:
    zeros = np.zeros(len(law.nodes))
    ends = {"driver_values": law.nodes, "value": zeros, "sigma": zeros, "covered": zeros == 0.0}
    return MeasuredLaw(
        None, "torque", "angle_deg", "both", "mN·m", 1.0, sentence="a stray torque", id=form().id, **ends
    )


def loaded(path: Path) -> Effect:
    made = importlib.util.spec_from_file_location(path.stem, path)
    assert made is not None
    assert made.loader is not None
    module = importlib.util.module_from_spec(made)
    made.loader.exec_module(module)
    assert module.__doc__ is not None
    assert ".. math::" in module.__doc__
    return module.EFFECT


def test_a_law_becomes_an_effect_that_does_the_same(tmp_path: Path) -> None:
    law = form()
    model = ActuatorModel(reference_spec(), laws=(law,))
    fitted = FittedModel(model, {**model.nominal(), law.names[0]: 1.0})
    export_effect(tmp_path / "lead_wires.py", fitted, (told(law),))
    effect = loaded(tmp_path / "lead_wires.py")
    assert effect.id == "lead_wires"
    assert effect.acts_on == FAMILIES["torque_angle_deg"].stage
    drive, plain = heated(), ActuatorModel(reference_spec())
    expected = model.simulate(drive, fitted.values).angle_rad
    ports = effect.apply(plain.ports(drive, {}), {"lead_wires_share": 1.0})
    found = run_ports(ports).angle_rad
    # Six digits of a torque of 0.05 mN·m stand in the file.
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert np.abs(expected - plain.simulate(drive).angle_rad).max() > 0.5 * DEG
    off = effect.apply(plain.ports(drive, {}), {"lead_wires_share": 0.0})
    null = run_ports(off).angle_rad
    np.testing.assert_allclose(null, plain.simulate(drive).angle_rad, atol=1e-9)


@pytest.mark.parametrize("name", ["sensor_lag.py", "Lead Wires.py", "lead_wires.txt"])
def test_a_name_that_is_none_is_refused(name: str, tmp_path: Path) -> None:
    law = form()
    model = ActuatorModel(reference_spec(), laws=(law,))
    with pytest.raises(ConfigError, match="no name for a new effect"):
        export_effect(tmp_path / name, FittedModel(model, model.nominal()), (told(law),))


def test_without_a_law_there_is_nothing_to_write(tmp_path: Path) -> None:
    model = ActuatorModel(reference_spec())
    with pytest.raises(NoResultError, match="no law was measured"):
        export_effect(tmp_path / "lead_wires.py", FittedModel(model, model.nominal()), ())
