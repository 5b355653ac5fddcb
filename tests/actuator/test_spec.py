"""ACTUATOR.toml: what is read, and what is refused with key, value and range."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from, read_actuator, reference_spec
from torsight.actuator.springs import Rig, values_of_b
from torsight.core.errors import ConfigError
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG

GOOD = {
    "geometry": {"wire_diameter_mm": 0.5, "mean_diameter_mm": 6.8, "active_coils": 3},
    "material": {
        "E_A_gpa": 60, "E_M_gpa": 20, "E_S_gpa": 5, "A_s_c": 36, "A_f_c": 54, "M_s_c": 42, "M_f_c": 28,
        "C_A_mpa_per_k": 32, "C_M_mpa_per_k": 32, "theta_cr_deg": 180,
    },
    "assembly": {"theta_p_deg": 1080},
    "friction": {"tau_c_mnm": 0.79},
    "uncertainty": {"E_A_gpa": 1.8, "A_s_c": 0.4},
}  # fmt: skip


def test_a_start_at_the_bound_is_told_as_beyond_it() -> None:
    log = TemperatureLog(np.arange(3.0), np.full(3, 23.0), np.full(3, 23.0))
    told = "found −9.42478 rad = −540°; allowed more than −540° and less than 540°"
    with pytest.raises(ConfigError, match=told):
        ActuatorModel(reference_spec()).prepare_log(log, start_angle_rad=-540.0 * DEG)


def changed(table: str, **keys):
    content: dict[str, dict] = {table: {}, **{name: dict(entries) for name, entries in GOOD.items()}}
    for key, value in keys.items():
        if value is None:
            content[table].pop(key, None)
        else:
            content[table][key] = value
    return content


def test_reads_values_and_priors():
    spec = actuator_from(GOOD, where="a.toml")
    free = {p.name: p for p in spec.parameters() if not p.fixed}
    assert set(free) == {"E_A_gpa", "A_s_c", "tau_c_mnm", "zero_deg"}
    assert free["tau_c_mnm"].sigma is None
    assert free["A_s_c"].sigma == 0.4
    assert Rig.from_values(spec.values).wire_length_m == pytest.approx(64.1e-3, abs=0.05e-3)


def test_wire_length_in_place_of_coils():
    content = changed("geometry", mean_diameter_mm=None, active_coils=None, wire_length_mm=64.1)
    assert Rig.from_values(actuator_from(content, where="a").values).wire_length_m == pytest.approx(64.1e-3)


def test_spring_b_differs_in_one_of_the_values_that_determine_its_length() -> None:
    spec = actuator_from({**GOOD, "spring_b": {"mean_diameter_mm": 7.0}}, where="a.toml")
    assert Rig.from_values(values_of_b(spec.values)).wire_length_m == pytest.approx(3 * math.pi * 7.0e-3)
    by_length = changed("geometry", mean_diameter_mm=None, active_coils=None, wire_length_mm=64.1)
    with pytest.raises(ConfigError, match=r"\[spring_b\].*active_coils"):
        actuator_from({**by_length, "spring_b": {"mean_diameter_mm": 7.0}}, where="a.toml")


def test_constants_of_the_paper():
    rig = Rig.from_values(reference_spec().values)
    length = 3 * math.pi * 6.8e-3
    assert rig.stress_per_torque == pytest.approx(32 / (math.pi * 0.5e-3**3))
    assert rig.k_austenite == pytest.approx(60e9 * (0.5e-3 / (2 * length)) * math.pi * 0.5e-3**3 / 32)
    assert rig.stiffness(0.25) == pytest.approx(rig.k_austenite + 0.25 * (rig.k_martensite - rig.k_austenite))


@pytest.mark.parametrize(
    ("table", "keys", "told"),
    [
        ("material", {"A_f_c": 30}, ("A_s_c", "A_f_c", "36", "30")),
        ("material", {"M_f_c": 45}, ("M_f_c", "M_s_c")),
        ("material", {"E_M_gpa": -20}, ("E_M_gpa", "-20", "1 to 500")),
        ("material", {"E_A_gpa": 60e9}, ("E_A_gpa", "6e+10", "GPa")),
        ("material", {"A_s_c": 309.15}, ("A_s_c", "309.15", "°C", "kelvin")),
        ("material", {"C_A_mpa_per_k": 32e6}, ("C_A_mpa_per_k", "MPa/K")),
        ("material", {"theta_cr_deg": 3.14}, ("theta_cr_deg", "degrees")),
        ("material", {"E_S_gpa": 25}, ("E_S_gpa", "E_M_gpa")),
        ("material", {"E_A_gpa": "sixty"}, ("E_A_gpa", "sixty")),
        ("material", {"E_A_gpa": None}, ("E_A_gpa", "add it")),
        ("material", {"E_A_gpa": math.nan}, ("E_A_gpa", "finite")),
        ("assembly", {"theta_p_deg": 90}, ("theta_cr_deg", "theta_p_deg")),
        ("geometry", {"wire_length_mm": 64.1}, ("wire_length_mm", "mean_diameter_mm")),
        ("friction", {"tau_c_mnm": -0.1}, ("tau_c_mnm",)),
        ("friction", {"tau_c_nmm": 0.1}, ("tau_c_nmm", "tau_c_mnm")),
        ("uncertainty", {"E_X_gpa": 1.0}, ("E_X_gpa",)),
        ("uncertainty", {"E_A_gpa": -1.0}, ("E_A_gpa", "standard deviation")),
        ("uncertainty", {"zero_deg": 1.0}, ("zero_deg", "no value")),
        ("spring_b", {"uncertainty": {"A_s_c": 0.4}}, ("[spring_b.uncertainty]", "A_s_c", "no value")),
        ("spring_b", {"wire_length_mm": 64.1, "mean_diameter_mm": 6.8}, ("[spring_b]", "both determine")),
    ],
)
def test_refusals_name_key_value_and_range(table, keys, told):
    with pytest.raises(ConfigError) as caught:
        actuator_from(changed(table, **keys), where="a.toml")
    message = str(caught.value)
    assert "a.toml" in message
    for word in told:
        assert word in message


def test_missing_table(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("[geometry]\nwire_diameter_mm = 0.5\nwire_length_mm = 64\n")
    with pytest.raises(ConfigError, match="material"):
        read_actuator(path)


@pytest.mark.parametrize("member", ["values", "uncertainty"])
def test_a_name_that_is_not_known_is_refused_where_a_spec_is_made(member: str) -> None:
    spec = reference_spec()
    wrong = {**getattr(spec, member), "tau_c_nmm": 0.1}
    with pytest.raises(ConfigError, match="did you mean 'tau_c_mnm'"):
        replace(spec, **{member: wrong})


@pytest.mark.parametrize("start", [0.0, 0.05])
def test_friction_may_begin_at_little_with_a_wide_prior(start: float) -> None:
    content = {**GOOD, "friction": {"tau_c_mnm": start}, "uncertainty": {"tau_c_mnm": 0.3}}
    spec = actuator_from(content, where="a.toml")
    assert spec.uncertainty["tau_c_mnm"] == 0.3


@pytest.mark.parametrize(("name", "sigma"), [("E_A_gpa", 1.8e9), ("A_s_c", 40.0), ("tau_c_mnm", 300.0)])
def test_an_uncertainty_in_another_unit_is_refused_where_a_spec_is_made(name: str, sigma: float) -> None:
    with pytest.raises(ConfigError, match=f"'{name}' is out of range.*in the value's unit"):
        replace(reference_spec(), uncertainty={name: sigma})
