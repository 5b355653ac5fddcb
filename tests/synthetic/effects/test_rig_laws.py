"""Laws of any shape in the rig: none is the plain rig, and each acts where it should, as much as it should."""

from __future__ import annotations

import numpy as np
import pytest

from tests.scripts import script
from torsight.core.errors import ConfigError
from torsight.core.units import DEG, MNM
from torsight.synthetic.effects.hidden import HIDDEN
from torsight.synthetic.effects.rig_laws import OUTSIDE, SLOTS, RigLaw
from torsight.synthetic.rig.moving_rig import Mechanics, RigRecord, Sensor, Setup, reading_angle, simulate_rig
from torsight.synthetic.rig.protocol import read_protocol
from torsight.synthetic.rig.rig_values import RigValues, rig_values

EXACT = Sensor(noise_c=0.0, quantum_c=0.0)
PROTOCOL = {
    "time_factor": 0.1,
    "half_cycle": [{"spring": s, "peak_c": 90.0} for s in "abab"],
}
WIDE = {"angle": (-6.0, 6.0), "temperature": (0.0, 120.0), "rate": (0.0, 1.0), "dwell": (0.0, 100.0),
        "time": (0.0, 1e4), "temp_rate": (-20.0, 20.0), "winding": (3.5, 16.0), "half_cycle": (0.0, 3.0),
        "cycle": (0.0, 1.0)}  # fmt: skip


def constant(port: str, driver: str, value: float, spring: str = "both") -> RigLaw:
    return RigLaw(port, driver, *WIDE[driver], np.full(5, value), spring)


def run(values: RigValues, *laws: RigLaw, effects: dict | None = None, protocol: dict = PROTOCOL) -> RigRecord:
    made = {name: HIDDEN[name](**keys) for name, keys in (effects or {}).items()}
    fine = Mechanics(inertia_kg_m2=1e-10, presliding_deg=0.005)
    return simulate_rig(
        values, read_protocol(protocol, where="test"), effects=made, laws=laws, setup=Setup(fine, sensor=EXACT)
    )


@pytest.fixture(scope="module")
def plain(reference_values: RigValues) -> RigRecord:
    return run(reference_values)


def test_laws_of_zero_are_the_plain_rig(reference_values: RigValues, plain: RigRecord) -> None:
    zeros = [constant(port, driver, 0.0) for port, driver in (*SLOTS, *OUTSIDE)]
    other = run(reference_values, *zeros)
    # A loading curve with a law is inverted by bisection instead of in closed form.
    assert np.abs(other.angle_rad - plain.angle_rad).max() < 1e-4 * DEG


@pytest.mark.parametrize("driver", ["angle", "temperature", "rate"])
def test_a_constant_law_of_friction_is_another_coulomb_torque(reference_values: RigValues, driver: str) -> None:
    more = rig_values({**reference_values.public, "tau_c_mnm": 1.2 * reference_values.public["tau_c_mnm"]})
    expected, found = run(more), run(reference_values, constant("friction", driver, 0.2))
    # The homing starts from what the rig's own Coulomb torque holds, which one cycle forgets; the bristle's stiffness
    # goes with that torque, too: deflections differ by 0.2 of 0.005°.
    later = expected.half_cycle >= 1
    assert np.abs(found.angle_rad - expected.angle_rad)[later].max() < 0.005 * DEG


def test_a_phase_law_that_is_so_much_warmer_everywhere_has_colder_windows(reference_values: RigValues) -> None:
    names = ("A_s_c", "A_f_c", "M_s_c", "M_f_c")
    colder = rig_values({**reference_values.public, **{name: reference_values.public[name] - 2.0 for name in names}})
    found = run(reference_values, constant("phase", "temperature", 2.0))
    assert np.abs(found.angle_rad - run(colder).angle_rad).max() < 1e-4 * DEG


def test_friction_over_rests_is_what_is_overcome_after_one(reference_values: RigValues, plain: RigRecord) -> None:
    # While it slides nothing has changed, so a jump leads back to the plain rig's motion: it only starts late.
    law = RigLaw("friction", "dwell", 0.0, 20.0, np.linspace(0.0, 0.3, 9))
    found = run(reference_values, law)
    first = plain.heat_a & (plain.half_cycle == 0)
    starts = [
        record.wire_a_c[first][np.argmax(np.abs(record.angle_rad[first] - record.angle_rad[first][0]) > DEG)]
        for record in (plain, found)
    ]
    assert starts[1] > starts[0] + 0.1
    assert np.abs(np.diff(found.angle_rad)).max() > 3.0 * np.abs(np.diff(plain.angle_rad)).max()


def test_a_constant_torque_is_the_bias_and_its_sign_is_that_of_the_angle(reference_values: RigValues) -> None:
    found = run(reference_values, constant("torque", "angle", 0.1 * MNM))
    expected = run(reference_values, effects={"torque_bias": {"bias_mnm": 0.1}})
    assert np.allclose(found.angle_rad, expected.angle_rad, atol=1e-9)


def test_a_wire_that_is_warmer_than_its_sensor_is_a_spring_with_lower_temperatures(reference_values: RigValues) -> None:
    public = reference_values.public
    lower = rig_values({**public, **{name: public[name] - 1.5 for name in ("A_s_c", "A_f_c", "M_s_c", "M_f_c")}})
    found, expected = run(reference_values, constant("temperature", "temperature", 1.5)), run(lower)
    # The sensor's own temperature is not touched; both control alike.
    assert np.allclose(found.wire_a_c, expected.wire_a_c, atol=1e-9)
    assert np.allclose(found.angle_rad, expected.angle_rad, atol=1e-6)
    only_b = run(reference_values, constant("temperature", "temperature", 1.5, "b"))
    shift = {"unlike_springs": {"a_shift_c": -1.5, "m_shift_c": -1.5}}
    assert np.allclose(only_b.angle_rad, run(reference_values, effects=shift).angle_rad, atol=1e-6)


def test_a_rig_whose_second_spring_is_stiffer_is_the_mirror_of_one_whose_first_is(reference_values: RigValues) -> None:
    stiff = {name: 1.1 * reference_values.public[name] for name in ("E_A_gpa", "E_M_gpa", "E_S_gpa")}
    half_cycles = {order: [{"spring": s, "peak_c": 90.0} for s in order] for order in ("ababab", "bababa")}
    there, mirrored = ({**PROTOCOL, "half_cycle": halves} for halves in half_cycles.values())
    shift = {"a_shift_c": 0.0, "m_shift_c": 0.0}
    second = run(reference_values, effects={"unlike_springs": {**shift, "modulus_scale": 1.1}}, protocol=mirrored)
    first_values = rig_values({**reference_values.public, **stiff})
    first = run(first_values, effects={"unlike_springs": {**shift, "modulus_scale": 1.0 / 1.1}}, protocol=there)
    # Homing is A, then B in either: a few half-cycles later that is forgotten.
    later = first.half_cycle >= 4
    assert np.abs(first.angle_rad + second.angle_rad)[later].max() < 0.02 * DEG
    assert np.abs(first.angle_rad[later].min() + first.angle_rad[later].max()) > 1.0 * DEG


def test_a_law_that_is_proportional_to_the_rate_is_a_late_sensor(reference_values: RigValues) -> None:
    law = RigLaw("temperature", "temp_rate", -20.0, 20.0, np.linspace(-10.0, 10.0, 3))
    plain, found = run(reference_values), run(reference_values, law)
    middle = np.flatnonzero(plain.heat_a & (plain.half_cycle == 0))
    warmer, colder = (np.interp(-1.0, -r.angle_rad[middle], r.wire_a_c[middle]) for r in (plain, found))
    rate = np.gradient(plain.wire_a_c, plain.time_s)[middle][len(middle) // 2]
    # T = T_m + 0.5 s dT_m/dt: at one angle the sensor shows so much less.
    assert warmer - colder == pytest.approx(0.5 * rate, rel=0.05)


def test_a_constant_torque_of_one_winding_is_a_bias_the_other_way(reference_values: RigValues) -> None:
    # Where stress hardly shifts the phase, a torque within a spring and one beside it do the same.
    stressless = rig_values({**reference_values.public, "C_A_mpa_per_k": 1e6, "C_M_mpa_per_k": 1e6})
    for spring, sign in (("a", -1.0), ("b", 1.0)):
        found = run(stressless, constant("winding", "winding", 0.05 * MNM, spring))
        expected = run(stressless, effects={"torque_bias": {"bias_mnm": sign * 0.05}})
        # 0.05 mN·m are 4 MPa, and 4 MPa of 1e6 MPa/K 4e-6 K: at 26 °/K 1e-4°, and a few times that where it lets go.
        assert np.abs(found.angle_rad - expected.angle_rad).max() < 1e-3 * DEG


def test_a_line_in_the_loading_curve_is_another_second_slope(reference_values: RigValues) -> None:
    theta_cr, stop = reference_values.rig.theta_cr_rad, 16.0
    stiffer = rig_values({**reference_values.public, "E_S_gpa": 1.1 * reference_values.public["E_S_gpa"]})
    rise = 0.1 * reference_values.rig.k_stress_induced * (stop - theta_cr)
    law = RigLaw("loading", "winding", theta_cr, stop, np.linspace(0.0, rise, 9))
    found, expected = run(reference_values, law), run(stiffer)
    # Both wind along the same curve and unwind along K_M: the recoverable angle follows.
    assert np.abs(found.angle_rad - expected.angle_rad).max() < 0.02 * DEG


def test_recoverable_angle_per_cycle_is_fatigue(reference_values: RigValues) -> None:
    law = RigLaw("recoverable", "cycle", 0.0, 1.0, np.array([0.0, -0.02]))
    expected = run(reference_values, effects={"fatigue": {"loss": 0.02}})
    assert np.allclose(run(reference_values, law).angle_rad, expected.angle_rad, atol=1e-9)


def test_recoverable_angle_per_half_cycle_acts_on_either_spring(reference_values: RigValues, plain: RigRecord) -> None:
    law = RigLaw("recoverable", "half_cycle", 0.0, 3.0, np.array([0.0, -0.02, -0.02, -0.02]))
    found = run(reference_values, law)
    same, second = plain.half_cycle == 0, plain.half_cycle == 1
    assert np.allclose(found.angle_rad[same], plain.angle_rad[same], atol=1e-9)
    # B recovers 2 % less: θ_2 is K_A / (K_A + K_S) of that short of it (23).
    k_a, k_s = reference_values.rig.k_austenite, reference_values.rig.k_stress_induced
    k_m = reference_values.rig.k_martensite
    wound = 0.5 * reference_values.rig.theta_p_rad - found.angle_rad[same].min()
    recovered = (wound - reference_values.rig.theta_cr_rad) * (1.0 - k_s / k_m)
    short = plain.angle_rad[second].max() - found.angle_rad[second].max()
    assert short == pytest.approx(0.02 * recovered * k_a / (k_a + k_s), rel=0.05)


def test_the_reading_is_the_angle_and_its_laws() -> None:
    angle_rad, time_s = np.linspace(-3.0, 3.0, 50), np.linspace(0.0, 5e3, 50)
    laws = [
        RigLaw("reading", "angle", -6.0, 6.0, np.array([-0.06, 0.06])),
        RigLaw("reading", "time", 0.0, 1e4, np.array([0.0, 0.1])),
    ]
    assert np.allclose(reading_angle(angle_rad, time_s, {}, laws), 1.01 * angle_rad + 1e-5 * time_s)
    slip = {"marker_slip": HIDDEN["marker_slip"](time_s=1000.0, step_deg=2.0, lasts_s=400.0)}
    assert np.allclose(
        reading_angle(angle_rad, time_s, slip) - angle_rad, np.clip((time_s - 1e3) / 400, 0, 1) * 2 * DEG
    )


def test_a_bend_of_the_loading_curve_is_a_cubic_that_no_spring_unwinds_along(reference_values: RigValues) -> None:
    bent = {"stiffening": {"rise_mnm": 0.02, "onset_deg": 650.0, "form": "bend"}}
    theta = np.linspace(reference_values.rig.theta_cr_rad, 16.0, 4001)
    past = np.maximum(theta - 650.0 * DEG, 0.0) / (100.0 * DEG)
    law = RigLaw("loading", "winding", theta[0], theta[-1], 0.02 * MNM * past**3)
    # The law lies on 256 nodes: h²/8 of its curvature is 1e-7 N·m, 0.01° over K_M.
    found, expected = (run(reference_values, effects=bent), run(reference_values, law))
    assert np.abs(found.angle_rad - expected.angle_rad).max() < 0.03 * DEG
    assert np.abs(found.angle_rad - run(reference_values).angle_rad).max() > 0.3 * DEG


def test_part_of_a_warm_passive_spring_pulls_back_in_part(reference_values: RigValues) -> None:
    back = []
    for share in (0.0, 0.5, 1.0):
        effects = {"heat_crosstalk": {"conductance_w_per_k": 0.02, "share": share}}
        record = run(reference_values, effects=effects)
        hot = (record.half_cycle == 0) & record.heat_a
        back.append((record.angle_rad[hot][-1] - record.angle_rad[hot].min()) / DEG)
    assert back[0] < 0.1
    assert 0.2 * back[2] < back[1] < 0.8 * back[2]


@pytest.mark.parametrize("place", [("torque", "angle"), ("friction", "rate"), ("recoverable", "cycle")])
def test_drawn_laws_are_smooth_and_of_size_one(place: tuple[str, str]) -> None:
    draw_law = script("benchmarks/discovery/drawn_laws.py").draw_law
    for seed in range(5):
        law = draw_law(*place, start=0.0, stop=1.0, rng=np.random.default_rng(seed))
        assert np.abs(law.values).max() == pytest.approx(1.0)
        # A process of length 1/10 has slopes of standard deviation 10, in 256 nodes hardly 4 times that.
        assert np.abs(np.diff(law.values)).max() * (len(law.values) - 1) < 40.0
        if place == ("friction", "rate"):
            assert law.values[0] == 0.0
            assert np.all(np.diff(law.values) > 0.0)


def test_a_law_that_the_rig_does_not_have_is_refused() -> None:
    with pytest.raises(ConfigError, match="no law of the rig"):
        RigLaw("torque", "dwell", 0.0, 1.0, np.zeros(3))
