"""The stepping rule's short ways (Newton's steps, samples that are passed over) against its long one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.drive import Drive
from torsight.actuator.effects import load_effects
from torsight.actuator.laws import FAMILIES
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.actuator.stepping import kernel
from torsight.core.law import LawForm
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG

HALVES = [(0, [(82.0, 0.8)]), (1, [(62.0, 1.2), (55.0, 0.8), (80.0, 0.6)]), (0, [(58.0, 1.0)]), (1, [(84.0, 1.2)])]
TOGETHER = [
    ("position_friction", "stiffening", "viscous_friction"),
    ("coil_friction", "end_stops", "nonuniform_temperature"),
    ("creep", "heat_crosstalk", "position_friction"),
    ("r_phase", "static_friction"),
]
EARLY = ("clock", "temperature")
SETS = [(), *((name,) for name in sorted(load_effects())), *TOGETHER]


@pytest.fixture(scope="module")
def drive() -> Drive:
    """Return the drive of a log in which the spring that is not driven gets half as warm; no effect changes it."""
    # Cooled to 2 °C above the room, well below M_f: longer rests hold nothing but samples that are passed over.
    log, _ = programme(HALVES, cool_s=80.0, decay_s=22.5)
    warm_a, warm_b = log.temp_a_c - 23.0, log.temp_b_c - 23.0
    rng = np.random.default_rng(3)
    a, b = (
        23.0 + own + 0.5 * other + rng.normal(0.0, 0.02, len(own))
        for own, other in ((warm_a, warm_b), (warm_b, warm_a))
    )
    warmed = TemperatureLog(log.time_s, a, b, heat_a=log.heat_a, heat_b=log.heat_b)
    return ActuatorModel(reference_spec()).prepare_log(warmed, start_angle_rad=170.0 * DEG)


@pytest.mark.parametrize("effects", SETS, ids="+".join)
def test_short_ways_and_long_one_lead_to_the_same(drive, effects, monkeypatch):
    same_by_both_ways(drive, ActuatorModel(reference_spec(), effects), monkeypatch)


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_short_ways_and_long_one_lead_to_the_same_under_a_law(drive, name, monkeypatch):
    """A wave over the driver, as large as the law's usual size."""
    form = wave_of(name)
    model = ActuatorModel(reference_spec(), laws=(form,))
    same_by_both_ways(drive, model, monkeypatch, {form.names[0]: 1.0})


def wave_of(name):
    family = FAMILIES[name]
    nodes = {"values": np.arange(8.0), "phase": np.arange(4.0)}.get(family.port, np.linspace(-300.0, 300.0, 41))
    wave = np.sin(np.linspace(0.3, 9.0, len(nodes))) * family.scale * (0.8 if family.unit == "mN·m" else 1.0)
    return LawForm(name, nodes, wave[:, None], family.unit, family.scale, prior=True)


@pytest.mark.parametrize("name", [effect.id for effect in load_effects().values() if effect.acts_on in EARLY])
def test_a_model_that_has_run_with_other_values_gives_what_a_new_one_gives(drive, name):
    used_before(drive, *(ActuatorModel(reference_spec(), (name, "position_friction")) for _ in range(2)))


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if family.stage in EARLY])
def test_a_law_that_has_run_with_other_values_gives_what_a_new_one_gives(drive, name):
    used_before(drive, *(ActuatorModel(reference_spec(), laws=(wave_of(name),)) for _ in range(2)))


def used_before(drive, used, new):
    """Move values of the rig and all that act: what acts on temperatures is kept while others change."""
    values = started(used) | {form.names[0]: 1.0 for form in used.laws}
    used.angle_rad(drive, values)
    own = [name for effect in used.chosen for name in (p.name for p in effect.parameters)]
    moved = ["E_A_gpa", "A_s_c", "theta_cr_deg", *own, *(name for form in used.laws for name in form.names)]
    for parameter in (p for p in used.parameters if p.name in moved):
        start = values.get(parameter.name, parameter.value)
        other = values | {parameter.name: min(1.01 * start + 0.01, parameter.upper)}
        np.testing.assert_array_equal(used.angle_rad(drive, other), replace(new).angle_rad(drive, other))


def started(model):
    return {k: v for effect in model.chosen for start in effect.starts[:1] for k, v in start.items()}


def same_by_both_ways(drive, model, monkeypatch, more=None):
    values = started(model) | (more or {})
    short = model.simulate(drive, values)
    slid, glide = [], kernel.glide

    def counted(*given):
        slid.append(glide(*given))
        return slid[-1]

    for name in ("run", "step_through", "_balanced_with_crosstalk"):
        monkeypatch.setattr(kernel, name, getattr(kernel, name).py_func)
    monkeypatch.setattr(kernel, "glide", counted)
    model.simulate(drive, values)
    moves = np.count_nonzero(np.abs(np.diff(short.phi_rad)) > 1e-9)
    # Before it slides, a disk with presliding displacement moves, too: in a quarter of the rows in which it moves.
    share = 0.7 if any(effect.id == "presliding" for effect in model.chosen) else 0.8
    assert sum(slid) > max(share * moves, 0.9 * len(slid))

    monkeypatch.setattr(kernel, "glide", lambda *_: False)
    monkeypatch.setattr(kernel, "_nothing_to_do", lambda *_: False)
    long = model.simulate(drive, values)
    for name in ("phi_rad", "xi_a", "xi_b"):
        np.testing.assert_allclose(getattr(short, name), getattr(long, name), rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(short.friction_nm, long.friction_nm, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("share", [0.9, 0.99, 0.999, 0.9999])
def test_a_disk_breaks_loose_between_two_samples_at_the_least_torque_of_a_cooling_spring(share):
    # Heated again without being wound meanwhile, a spring that cools pulls less, then more again.
    log, _ = programme([(0, [(82.0, 0.2)]), (1, [(66.0, 0.25)]), (0, [(34.0, 0.25)]), (1, [(66.0, 0.25)])])
    model = ActuatorModel(reference_spec())
    drive = model.prepare_log(log, start_angle_rad=170.0 * DEG)
    last = drive.cycles.half == 3
    top = int(np.flatnonzero(last)[np.argmax(drive.temp_b_c[last])])
    # With this friction the disk just holds: 0.01 % less let it go for less than a sample's time.
    friction = {"tau_c_mnm": share * 1.17658}
    rows = np.concatenate([np.arange(top + 1), np.arange(top + 40, len(drive), 40)])
    every, few = model.simulate(drive, friction).angle_rad, model.simulate(drive.at(rows), friction).angle_rad
    assert np.ptp(every[top + 40 :]) > 10.0 * DEG
    np.testing.assert_allclose(few, every[rows], rtol=0.0, atol=1e-9)
