"""The stepping rule's short ways (Newton's steps, samples that are passed over) against its long one."""

from __future__ import annotations

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.effects import load_effects
from torsight.actuator.laws import FAMILIES
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.actuator.stepping import kernel
from torsight.core.law import LawForm
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG

HALVES = [(0, [(82.0, 0.2)]), (1, [(62.0, 0.3), (55.0, 0.2), (80.0, 0.15)]), (0, [(58.0, 0.25)]), (1, [(84.0, 0.3)])]
TOGETHER = [
    ("position_friction", "stiffening", "viscous_friction"),
    ("coil_friction", "end_stops", "nonuniform_temperature"),
    ("creep", "heat_crosstalk", "position_friction"),
    ("r_phase", "static_friction"),
]
SETS = [(), *((name,) for name in sorted(load_effects())), *TOGETHER]


def warmed_log() -> TemperatureLog:
    """Return a log in which the spring that is not driven gets half as warm."""
    log, _ = programme(HALVES)
    warm_a, warm_b = log.temp_a_c - 23.0, log.temp_b_c - 23.0
    rng = np.random.default_rng(3)
    a, b = (
        23.0 + own + 0.5 * other + rng.normal(0.0, 0.02, len(own))
        for own, other in ((warm_a, warm_b), (warm_b, warm_a))
    )
    return TemperatureLog(log.time_s, a, b, heat_a=log.heat_a, heat_b=log.heat_b)


@pytest.mark.parametrize("effects", SETS, ids="+".join)
def test_short_ways_and_long_one_lead_to_the_same(effects, monkeypatch):
    same_by_both_ways(ActuatorModel(reference_spec(), effects), monkeypatch)


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_short_ways_and_long_one_lead_to_the_same_under_a_law(name, monkeypatch):
    """A wave over the driver, as large as the law's usual size."""
    family = FAMILIES[name]
    nodes = {"values": np.arange(8.0), "phase": np.arange(4.0)}.get(family.port, np.linspace(-300.0, 300.0, 41))
    wave = np.sin(np.linspace(0.3, 9.0, len(nodes))) * family.scale * (0.8 if family.unit == "mN·m" else 1.0)
    form = LawForm(name, nodes, wave[:, None], family.unit, family.scale, prior=True)
    model = ActuatorModel(reference_spec(), laws=(form,))
    same_by_both_ways(model, monkeypatch, {form.names[0]: 1.0})


def same_by_both_ways(model, monkeypatch, more=None):
    drive = model.prepare_log(warmed_log(), start_angle_rad=170.0 * DEG)
    values = {k: v for effect in model.chosen for start in effect.starts[:1] for k, v in start.items()} | (more or {})
    short = model.simulate(drive, values)
    slid, glide = [], kernel.glide

    def counted(*given):
        slid.append(glide(*given))
        return slid[-1]

    for name in ("run", "step_through"):
        monkeypatch.setattr(kernel, name, getattr(kernel, name).py_func)
    monkeypatch.setattr(kernel, "glide", counted)
    model.simulate(drive, values)
    moves = np.count_nonzero(np.abs(np.diff(short.phi_rad)) > 1e-9)
    assert sum(slid) > 0.8 * moves

    monkeypatch.setattr(kernel, "glide", lambda *_: False)
    monkeypatch.setattr(kernel, "_nothing_to_do", lambda *_: False)
    long = model.simulate(drive, values)
    for name in ("phi_rad", "xi_a", "xi_b"):
        np.testing.assert_allclose(getattr(short, name), getattr(long, name), rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(short.friction_nm, long.friction_nm, rtol=0.0, atol=1e-11)
