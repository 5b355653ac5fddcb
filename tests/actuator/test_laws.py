"""Laws at the model's ports: zero is the plain model, what they do, and that a file gives them back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.drive import prepare_log
from torsight.actuator.laws import FAMILIES, between_nodes, laws_from, laws_of
from torsight.actuator.laws.banks import counted
from torsight.actuator.laws.phase_window import BRANCH, OWN_STEPS, exponential_lead, phase_places
from torsight.actuator.model import ActuatorModel
from torsight.actuator.ports import History
from torsight.actuator.spec import reference_spec
from torsight.actuator.stepping.phase import PLACES
from torsight.core.errors import ConfigError
from torsight.core.units import DEG

HALVES = [(0, [(82.0, 0.2)]), (1, [(80.0, 0.2)]), (0, [(58.0, 0.25)]), (1, [(84.0, 0.3)])]


@pytest.fixture(scope="module")
def drive():
    log, _ = programme(HALVES)
    prepared = prepare_log(log, start_angle_rad=170.0 * DEG)
    angle_rad = ActuatorModel(reference_spec()).simulate(prepared).angle_rad
    object.__setattr__(prepared, "angle_rad", angle_rad)
    return prepared


@pytest.fixture(scope="module")
def laws(drive):
    return {law.id: law for law in laws_of(drive, 0.79)}


def simulated(drive, form, parameters):
    model = ActuatorModel(reference_spec(), laws=(form,))
    return model.simulate(drive, dict(zip(form.names, parameters, strict=True)))


def test_every_family_is_offered_where_the_record_covers_its_driver(laws):
    # Nothing warms the spring that is not driven here.
    assert set(laws) == set(FAMILIES) - {"friction_temp_passive_c"}


@pytest.mark.parametrize("name", sorted(set(FAMILIES) - {"friction_temp_passive_c"}))
def test_zero_is_the_plain_model(name, drive, laws):
    form = laws[name].free()
    plain = ActuatorModel(reference_spec()).simulate(drive).angle_rad
    np.testing.assert_allclose(simulated(drive, form, np.zeros(len(form.names))).angle_rad, plain, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("family", ["friction_angle_deg", "friction_temp_active_c", "friction_temp_rate_c_s"])
def test_a_constant_law_of_friction_is_more_friction(family, drive, laws):
    form = laws[family].free()
    more = ActuatorModel(reference_spec()).simulate(drive, {"tau_c_mnm": 0.79 * 1.2}).angle_rad
    found = simulated(drive, form, np.full(len(form.names), 0.2)).angle_rad
    np.testing.assert_allclose(found, more, rtol=0.0, atol=1e-9)


def test_friction_over_the_rate_of_the_temperature_where_it_falls_leaves_the_first_heating_alone(drive, laws):
    law = laws["friction_temp_rate_c_s"]
    found = simulated(drive, law.free(), np.where(law.nodes < -0.02, 0.3, 0.0)).angle_rad
    plain = ActuatorModel(reference_spec()).simulate(drive).angle_rad
    heating = np.arange(len(plain)) < np.argmax(drive.temp_a_c)
    np.testing.assert_allclose(found[heating], plain[heating], rtol=0.0, atol=1e-9)
    assert np.max(np.abs(found - plain)) > 1.0 * DEG


def test_friction_over_the_speed_that_rises_in_proportion_is_viscous(drive, laws):
    law = laws["friction_angle_rate_deg_s"]
    form = law.free()
    viscous = ActuatorModel(reference_spec(), ("viscous_friction",))
    expected = viscous.simulate(drive, {"viscous_mnm_s_per_rad": 8.0}).angle_rad
    found = simulated(drive, form, 8.0 * DEG * law.nodes / 0.79).angle_rad
    # Beyond the last node its value holds; nothing moves faster but in jumps.
    assert np.median(np.abs(found - expected)) < 0.01 * DEG


def test_a_clock_that_is_ahead_by_one_value_is_the_clock_offset_and_holds_for_no_later_record(drive, laws):
    form = laws["clock_time_s"].free()
    shifted = ActuatorModel(reference_spec(), ("clock_offset",))
    expected = shifted.simulate(drive, {"clock_offset_s": 3.0, "clock_drift_ppm": 0.0}).angle_rad
    ahead = np.full(len(form.names), 3.0)
    np.testing.assert_allclose(simulated(drive, form, ahead).angle_rad, expected, rtol=0.0, atol=1e-9)
    plain = ActuatorModel(reference_spec()).simulate(drive).angle_rad
    model, values = ActuatorModel(reference_spec(), laws=(form,)), dict(zip(form.names, ahead, strict=True))
    later = model.simulate(drive, values, history=History(after_record=True)).angle_rad
    np.testing.assert_allclose(later, plain, rtol=0.0, atol=1e-9)


def test_a_wire_does_not_warm_up_by_the_jump_of_its_rate_when_heating_ends(drive, laws):
    law = laws["temperature_temp_rate_c_s"]
    found = simulated(drive, law.free(), np.where(law.nodes < 0.0, 1.5, 0.0))
    plain = ActuatorModel(reference_spec()).simulate(drive)
    for warm, log in ((found.temp_a_c, plain.temp_a_c), (found.temp_b_c, plain.temp_b_c)):
        falls = np.diff(log) < -0.05
        assert np.diff(warm)[falls].max() <= 0.0
    # Once the log has fallen by as much, the wire is as much warmer as the law says.
    assert (found.temp_a_c - plain.temp_a_c).max() == pytest.approx(1.5, abs=1e-6)


@pytest.mark.parametrize(("name", "moved"), [("a", (1.0, 0.0)), ("b", (0.0, 1.0)), ("", (1.0, 1.0))])
def test_a_sensor_that_drifts_leaves_the_other_wires_temperature(name, moved, drive, laws):
    law = laws["_".join(filter(None, ("temperature", name, "time_s")))]
    drift_c = 2.0 * (law.nodes - law.nodes[0]) / np.ptp(law.nodes)
    found, plain = simulated(drive, law.free(), drift_c), ActuatorModel(reference_spec()).simulate(drive)
    expected_c = 2.0 * (drive.time_s - drive.time_s[0]) / np.ptp(drive.time_s)
    for share, warm_c, log_c in zip(
        moved, (found.temp_a_c, found.temp_b_c), (plain.temp_a_c, plain.temp_b_c), strict=True
    ):
        np.testing.assert_allclose(warm_c - log_c, share * expected_c, rtol=0.0, atol=0.02)


def test_spring_b_with_other_values_is_another_rig_for_b_alone(drive, laws):
    form = laws["values_spring"].free()
    shift = np.array([1.5, 1.5, 1.5, 1.5, 0.0, 0.0, 0.0, 0.0])
    plain = ActuatorModel(reference_spec()).simulate(drive).angle_rad
    found = simulated(drive, form, shift).angle_rad
    first = drive.cycles.half == 0
    np.testing.assert_allclose(found[first], plain[first], rtol=0.0, atol=1e-9)
    # Half-cycle 1 heats B: it begins to move 1.5 °C later, at the same rate, so by as much time.
    second = drive.cycles.half == 1
    begins = [drive.temp_b_c[second][np.abs(a[second] - a[second][0]) > 1.0 * DEG][0] for a in (plain, found)]
    assert begins[1] - begins[0] == pytest.approx(1.5, abs=0.1)


def test_cold_springs_that_have_relaxed_before_the_record_are_weaker_martensite(drive, laws):
    form, spec = laws["winding_time_s"].free(), reference_spec()
    found = simulated(drive, form, np.full(len(form.names), -0.05))
    weaker = {name: 0.95 * spec.values[name] for name in ("E_M_gpa", "E_S_gpa")}
    expected = ActuatorModel(spec).simulate(drive, {**spec.values, **weaker})
    # Until the first spring has begun to recover; what it recovers goes by its own stiffness.
    first = (drive.cycles.half == 0) & (expected.xi_a == 1.0)
    assert np.count_nonzero(first) > 10
    for name in ("torque_a_nm", "torque_b_nm"):
        np.testing.assert_allclose(getattr(found, name)[first], getattr(expected, name)[first], rtol=1e-9)


def test_a_file_gives_a_law_back(drive, laws):
    law = laws["torque_angle_deg"]
    form = law.form(law.kernels[-1], 0.05)
    (again,) = laws_from(json.loads(json.dumps([form.to_json()])), where="model.json")
    parameters = np.random.default_rng(2).standard_normal(len(form.names))
    np.testing.assert_array_equal(form.basis, again.basis)
    np.testing.assert_allclose(
        simulated(drive, form, parameters).angle_rad, simulated(drive, again, parameters).angle_rad, atol=1e-12
    )


@pytest.mark.parametrize(
    ("key", "value"),
    [("id", "no_such_law"), ("nodes", [3.0, 1.0]), ("nodes", "three"), ("basis", [[float("nan")]]), ("scale", "wide")],
)
def test_a_damaged_law_is_named(key, value, laws):
    law = laws["phase_cycle"]
    entry = {**law.form(law.kernels[0], 0.01).to_json(), key: value}
    with pytest.raises(ConfigError, match=r"law|choices|known|number|one of"):
        laws_from([entry], where="model.json, key laws")


def test_a_wave_with_few_nodes_a_period_is_a_wave_between_them():
    # Five waves per turn over a turn and a third, as many nodes as a law over the angle has.
    nodes, angle_deg = np.linspace(-230.0, 236.0, 37), np.linspace(-200.0, 206.0, 3001)

    def wave(at_deg):
        return np.sin(5.0 * np.deg2rad(at_deg))

    def off(law):
        return np.max(np.abs(np.interp(angle_deg, *between_nodes(law, nodes, wave(nodes))) - wave(angle_deg)))

    assert off("friction_angle_deg") < 0.05
    assert off("friction_temp_active_c") > 0.1


@pytest.mark.parametrize("family", ["phase_cycle", "phase_half_cycle", "friction_cycle"])
def test_beyond_the_record_a_law_over_counts_goes_on_for_a_while_and_then_stays(family):
    nodes, known = np.arange(30.0), slice(1, 5)
    for kernel in FAMILIES[family].kernels(nodes):
        np.testing.assert_allclose(kernel.matrix[0], 0.0, atol=1e-12)
        if not kernel.smooth:
            continue
        # It has risen by one from each count to the next.
        weights = np.linalg.solve(kernel.matrix[known, known], nodes[known])
        changes = np.diff((kernel.matrix[:, known] @ weights)[4:])
        if kernel.name == "from one to the next":
            np.testing.assert_allclose(changes, 0.0, atol=1e-9)
            continue
        assert 0.5 < changes[0] < 1.0
        assert (np.diff(changes) < 0.0).all()
        assert 0.0 < changes[-1] < 0.02


def test_what_friction_held_at_the_start_is_no_edge_where_friction_depends_on_the_temperature(drive, laws):
    """Friction that falls a little as the wire warms lets it slip before anything transforms, and not for the rest."""
    law = laws["friction_temp_active_c"]
    form = law.free()
    friction = -0.001 * (law.nodes - law.nodes[0]) + 0.8 * (1.0 + np.tanh((law.nodes - 50.0) / 8.0))
    values = dict(zip(form.names, friction.tolist(), strict=True))
    model = ActuatorModel(reference_spec(), ("home_torque",), laws=(form,))
    angles = [model.angle_rad(drive, {**model.nominal(), **values, "home_hold": hold}) for hold in (1.0, 0.999)]
    np.testing.assert_allclose(*angles, atol=0.2 * DEG)


def test_a_transformation_that_runs_ahead_of_the_cosine_as_the_exponential_does_is_tanakas(drive, laws):
    lead = exponential_lead(phase_places(OWN_STEPS))
    found = simulated(drive, laws["phase_temp_active_c"].free(), np.tile(lead, 2)).angle_rad
    effect = ActuatorModel(reference_spec(), ("exponential_law",)).simulate(drive, {"exponential_share": 1.0}).angle_rad
    tanaka, plain = (
        ActuatorModel(reference_spec(), phase_law=one).simulate(drive).angle_rad for one in ("tanaka", "liang_rogers")
    )
    assert np.sqrt(np.mean((found - tanaka) ** 2)) < 0.4 * DEG
    assert np.sqrt(np.mean((effect - tanaka) ** 2)) < 0.1 * DEG
    assert np.sqrt(np.mean((plain - tanaka) ** 2)) > 40.0 * DEG


def test_a_lead_on_heating_is_none_on_cooling(drive, laws):
    law = laws["phase_temp_active_c"]
    lead = np.where(law.nodes < BRANCH, 0.05 * np.sin(np.pi * np.clip(phase_places(law.nodes), 0.0, 1.0)), 0.0)
    found = simulated(drive, law.free(), lead)
    plain = ActuatorModel(reference_spec()).simulate(drive)
    ahead = plain.xi_a - found.xi_a
    heats = (drive.cycles.active == 0) & (np.gradient(drive.temp_a_c) > 0.0) & (drive.cycles.half == 0)
    cools = (drive.cycles.half == 0) & ~heats
    assert ahead[heats].max() > 0.05
    assert np.abs(ahead[cools]).max() < 0.01


def test_a_place_never_goes_back_while_its_temperature_goes_on(drive, laws):
    law = laws["phase_temp_active_c"]
    model = ActuatorModel(reference_spec())
    ports = model.ports(drive, model.nominal())
    steep = FAMILIES[law.id].apply(ports, lambda steps: np.where(steps > 5.0, -0.5, 0.5))
    for moved in steep.moved_places():
        assert (np.diff(PLACES + moved) > 0.0).all()


def test_a_loading_curve_that_would_fall_where_no_spring_was_wound_is_as_before_where_springs_were(drive):
    model = ActuatorModel(reference_spec())
    ports = model.ports(drive, model.nominal())
    falling = FAMILIES["loading_winding_deg"].apply(ports, lambda wound: np.where(np.abs(wound) > 300.0, -wound, 0.0))
    reached = np.abs(ports.phi_grid_rad() / DEG) < 290.0
    for added_nm in falling.loading_nm:
        np.testing.assert_allclose(added_nm[reached], 0.0, atol=1e-12)
        assert np.ptp(added_nm) > 1e-5


def test_a_badly_mounted_sensor_of_one_wire_is_a_usual_form_and_unlike_springs_are_none(laws):
    law = laws["temperature_b_temp_active_c"]
    room = np.flatnonzero(law.nodes == law.covered[0])
    for kernel in law.kernels:
        assert kernel.matrix[room, room] == pytest.approx(0.0, abs=1e-9)
    cooler = next(kernel for kernel in law.kernels if kernel.name == "proportional")
    excess = law.nodes - law.covered[0]
    assert cooler.matrix * np.mean(excess**2) == pytest.approx(np.outer(excess, excess))


def test_beyond_the_record_a_law_is_as_uncertain_as_its_prior(laws):
    law = laws["friction_temp_active_c"]
    assert 0 < np.count_nonzero(law.reached) < len(law.nodes)
    for kernel in law.kernels:
        basis = law.form(kernel, 2.0).basis
        np.testing.assert_allclose(basis @ basis.T, 4.0 * kernel.matrix, atol=0.02 * np.abs(kernel.matrix).max())
        # The coefficients of which the record says nothing change nothing that it has reached.
        beyond = ~np.abs(basis[law.reached]).any(axis=0)
        assert beyond.any() or np.linalg.matrix_rank(kernel.matrix) < np.count_nonzero(law.reached)


@pytest.mark.parametrize("loss", [0.003, 0.01, 0.05])
def test_a_slope_over_the_half_cycles_allows_wear_in_proportion_to_what_is_left(loss):
    count = np.arange(12.0)
    wear, seen = (1.0 - loss) ** count - 1.0, count < 8.0
    prior = counted(count)[0].matrix * wear[7] ** 2 / counted(count)[0].matrix[7, 7]
    across = prior[np.ix_(~seen, seen)]
    gain = across @ np.linalg.inv(prior[np.ix_(seen, seen)] + 1e-8 * np.eye(8))
    sigma = np.sqrt(np.diag(prior[np.ix_(~seen, ~seen)] - gain @ across.T))
    assert np.all(np.abs(wear[~seen] - gain @ wear[seen]) < 2.0 * sigma)
    assert np.all(sigma < 0.04 * np.abs(wear[~seen]))
