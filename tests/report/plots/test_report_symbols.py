"""Symbols as in the paper, and every effect's equation as a picture."""

from __future__ import annotations

import importlib
import re
from xml.etree import ElementTree as ET

import pytest

from torsight.actuator.effects import Effect, load_effects
from torsight.actuator.quantities import OF_THE_ACTUATOR, plain_symbol, with_title
from torsight.actuator.spec import reference_spec
from torsight.report.plots.formulas import equation, equation_picture, symbol, with_symbols

ALWAYS_FITTED = ("start", "form", "remainder")
"""Families of what every discovery fits beside the characterised values."""


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
        ("<b>_deg", "<b>", "&lt;b&gt;"),
    ],
)
def test_a_name_becomes_its_symbol_or_its_words(name: str, plain: str, page: str) -> None:
    assert plain_symbol(name) == plain
    assert symbol(name) == page


@pytest.mark.parametrize("effect", load_effects().values(), ids=lambda effect: effect.id)
def test_every_value_of_an_effect_has_a_title_and_the_symbol_of_its_equation(effect: Effect) -> None:
    module = importlib.import_module(f"torsight.actuator.effects.{effect.id}")
    text = re.sub(r"[{}]", "", module.__doc__ or "")
    for one in (*effect.parameters, *effect.derived):
        assert one.title
        assert re.search(rf"(?<![^\W\d_]){re.escape(one.symbol)}(?!\w)", text), (one.name, one.symbol)
        assert with_title(one.name).endswith(f" {one.symbol}")


def test_a_symbol_of_what_is_always_fitted_means_nothing_else() -> None:
    always = [one for effect in load_effects().values() if effect.family in ALWAYS_FITTED for one in effect.parameters]
    found = [one.symbol for one in OF_THE_ACTUATOR.values()] + [one.symbol for one in always]
    assert len(set(found)) == len(found)
    others = {
        one.symbol
        for effect in load_effects().values()
        if effect.family not in ALWAYS_FITTED
        for one in (*effect.parameters, *effect.derived)
    }
    assert not others & set(found)


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
