"""Symbols as in the paper, and every effect's equation as a picture."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from torsight.actuator.effects import load_effects
from torsight.actuator.quantities import OF_THE_ACTUATOR, candidate_name, for_people, plain_symbol
from torsight.actuator.spec import reference_spec
from torsight.report.plots.formulas import equation, equation_picture, symbol, with_symbols


def test_every_characterised_value_has_its_symbol() -> None:
    assert {one.name for one in reference_spec().parameters()} <= set(OF_THE_ACTUATOR)


@pytest.mark.parametrize(
    ("name", "plain", "page"),
    [
        ("E_A_gpa", "E_A", "<i>E</i><sub>A</sub>"),
        ("theta_cr_deg", "θ_cr", "<i>θ</i><sub>cr</sub>"),
        ("wire_length_mm", "L", "<i>L</i>"),
        ("lag_s", "τ_T", "<i>τ</i><sub>T</sub>"),
        ("spring_b_E_A_gpa", "E_A,B", "<i>E</i><sub>A,B</sub>"),
        ("zero_deg_2", "φ_z", "<i>φ</i><sub>z</sub>"),
        ("someones_lag_s", "someones lag", "someones lag"),
        ("someones_mnm_per_rad3", "someones", "someones"),
        ("friction_angle_deg@01", *2 * ("friction over the angle, coefficient 2",)),
        ("<b>_deg", "<b>", "&lt;b&gt;"),
    ],
)
def test_a_name_becomes_its_symbol_or_its_words(name: str, plain: str, page: str) -> None:
    assert plain_symbol(name) == plain
    assert symbol(name) == page


def test_candidates_are_named_as_people_say_them() -> None:
    named = [candidate_name(name) for name in ("sensor_lag", "loading_b_winding_deg", "phase_half_cycle", "someones")]
    said = ["spring B's loading curve over the winding", "the recoverable angle over the half-cycles"]
    assert named == ["sensor lag", *said, "someones"]


def test_a_sentence_gets_symbols_and_no_markup_of_its_own() -> None:
    assert with_symbols("E_A_gpa < tau_c_mnm") == "<i>E</i><sub>A</sub> &lt; <i>τ</i><sub>c</sub>"


@pytest.mark.parametrize("effect", load_effects())
def test_the_equation_of_every_effect_can_be_set(effect: str) -> None:
    parts = equation(effect)
    assert parts
    for latex in parts:
        picture = equation_picture(latex)
        root = ET.fromstring(picture)  # noqa: S314 - our own text
        assert root.find(".//{http://www.w3.org/2000/svg}path") is not None
        assert "metadata" not in picture


def test_what_cannot_be_set_is_left_to_its_source() -> None:
    assert equation_picture(r"\nosuchcommand{x}") == ""
    assert equation("no_such_effect") == ()
    assert equation("../spec") == ()


def test_of_an_effect_those_values_are_told_that_were_made_for_people() -> None:
    # Whether the effect itself was fitted, or a law in its place that carries its name.
    values = {name: {"value": 0.3, "ci95": [0.2, 0.4], "unit": ""} for name in ("friction_sine", "amplitude")}
    assert list(for_people({"id": "position_friction", "parameters": values})) == ["amplitude"]
    assert list(for_people({"id": "of_another_library", "parameters": values})) == ["friction_sine", "amplitude"]
