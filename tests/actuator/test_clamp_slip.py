"""A spring's end that slips in its clamp leaves a rig that is wound by so much less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.drive import Drive, prepare_log
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import reference_spec
from torsight.core.units import DEG, Floats

HALVES = [(0, [(82.0, 0.2)]), (1, [(80.0, 0.2)]), (0, [(58.0, 0.25)]), (1, [(84.0, 0.3)])]
SLIP_DEG = 8.0


@pytest.fixture(scope="module")
def drive() -> Drive:
    log, _ = programme(HALVES)
    return prepare_log(log, start_angle_rad=170.0 * DEG)


def angle_deg(drive: Drive, slip_deg: float, at_s: float) -> Floats:
    model = ActuatorModel(reference_spec(), ("clamp_slip",))
    return model.simulate(drive, {"clamp_slip_deg": slip_deg, "clamp_slip_time_s": at_s}).angle_rad / DEG


@pytest.mark.parametrize(("slip_deg", "turned_deg"), [(SLIP_DEG, 0.5 * SLIP_DEG), (-SLIP_DEG, -0.5 * SLIP_DEG)])
def test_a_slip_before_the_record_is_a_rig_wound_by_less_whose_zero_has_turned(drive, slip_deg, turned_deg):
    spec = reference_spec()
    theta_p_deg = spec.values["theta_p_deg"]
    less = replace(spec, values={**spec.values, "theta_p_deg": theta_p_deg - SLIP_DEG})
    turned = replace(drive, start_angle_rad=drive.start_angle_rad - turned_deg * DEG)
    expected = ActuatorModel(less).simulate(turned).angle_rad / DEG + turned_deg
    np.testing.assert_allclose(angle_deg(drive, slip_deg, -1e6), expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("slip_deg", "held"), [(SLIP_DEG, True), (-SLIP_DEG, False)])
def test_friction_holds_a_disk_at_rest_where_the_end_of_the_spring_that_pulls_slips(drive, slip_deg, held):
    plain = ActuatorModel(reference_spec()).simulate(drive).angle_rad / DEG
    # B has cooled, and A pulls as far as friction lets it: it pulls less where its own end slips, else it moves on.
    second = np.flatnonzero(drive.cycles.half == 1)
    at_s = float(drive.time_s[second[-len(second) // 10]])
    found = angle_deg(drive, slip_deg, at_s)
    before = drive.time_s <= drive.time_s[second[-1]]
    moved = (found - plain)[before]
    assert np.max(moved) < 1e-6
    assert (np.min(moved) > -1e-6) == held
    assert np.min(moved) > -0.5 * SLIP_DEG
    # From then on it comes to stand further off by about half of the slip.
    ends = [np.flatnonzero(drive.cycles.half == number)[-1] for number in (2, 3)]
    np.testing.assert_allclose(np.mean((found - plain)[ends]), 0.5 * slip_deg, atol=0.25 * SLIP_DEG)
