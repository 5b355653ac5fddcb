"""Measured laws: from the discovery's object to files, and from the files to the page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from made_up_run import made_up_law, rewrite, write_made_up_run
from report_words import figures_of, words_of

from torsight.core.errors import InputError
from torsight.discovery.actuator.law_words import OnNodes, law_sentence
from torsight.discovery.measured_law import read_laws
from torsight.report.figures.law_plots import write_laws
from torsight.report.plots.panels import Band, Line, Ribbon

CONSTANT = "a constant is within its 95 % interval"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_made_up_run(tmp_path, rate_hz=1.0)
    law = made_up_law()
    write_laws(tmp_path, [law])
    rewrite(tmp_path, "discovery", laws=[law.to_json()])
    return tmp_path


def test_a_law_comes_back_from_its_files_as_it_was(run: Path) -> None:
    law = made_up_law()
    content = json.loads((run / "discovery.json").read_text(encoding="utf-8"))
    assert content["laws"][0]["file"] == law.csv_name == "law_friction_angle_deg.csv"
    (back,) = read_laws(run, content)
    for name in ("effect", "port", "driver", "spring", "unit", "share", "sentence"):
        assert getattr(back, name) == getattr(law, name)
    for name in ("driver_values", "value", "sigma"):
        np.testing.assert_allclose(getattr(back, name), getattr(law, name), rtol=1e-8)
    np.testing.assert_array_equal(back.covered, law.covered)
    assert list(pd.read_csv(run / law.csv_name)) == ["driver", "value", "sigma", "covered"]
    picture = cv2.imread(str(run / "law_friction_angle_deg.png"))
    assert picture is not None
    assert picture.shape[1] > 1000


def test_the_page_draws_curve_band_and_what_the_record_reached(run: Path) -> None:
    law = made_up_law()
    text = words_of(run)
    assert '<section id="laws">' in text
    assert law.sentence in text
    assert "Change of the friction torque against the angle" in text
    assert "law_friction_angle_deg.csv" in text
    (panel,) = figures_of(run)["law_friction_angle_deg"].panels
    (curve,) = [mark for mark in panel.marks if isinstance(mark, Line)]
    np.testing.assert_allclose(curve.y, law.value, rtol=1e-8)
    (ribbon,) = [mark for mark in panel.marks if isinstance(mark, Ribbon)]
    # The two-sided 95 % point of a normal variable, from tables.
    np.testing.assert_allclose(ribbon.high - ribbon.low, 2.0 * 1.959964 * law.sigma, rtol=1e-4)
    shaded = [(mark.low, mark.high) for mark in panel.marks if isinstance(mark, Band)]
    assert shaded == [(-200.0, -20.0), (20.0, 200.0)]


def test_without_laws_there_is_no_section_and_their_files_go_but_nobody_elses(run: Path) -> None:
    own = run / "law_of_the_lab.csv"
    own.write_text("a,b\n1,2\n", encoding="utf-8")
    write_laws(run, [])
    assert sorted(run.glob("law_*")) == [own]
    rewrite(run, "discovery")
    assert 'id="laws"' not in words_of(run)


def test_a_law_without_its_file_or_with_a_key_missing_is_named(run: Path) -> None:
    entry = made_up_law().to_json()
    del entry["port"]
    rewrite(run, "discovery", laws=[entry])
    with pytest.raises(InputError, match=r"discovery\.json, laws: a law has no 'port'"):
        words_of(run)
    rewrite(run, "discovery", laws=[made_up_law().to_json()])
    (run / "law_friction_angle_deg.csv").unlink()
    with pytest.raises(InputError, match=r"law_friction_angle_deg\.csv"):
        words_of(run)


def sentence(
    port: str, driver: str, places: list[float], values: list[float], sigma: list[float], **more: object
) -> str:
    """Return a law's sentence; ``shared`` is the standard deviation of an offset that all of its values have."""
    x, y, s = np.array(places), np.array(values), np.array(sigma)
    covariance = np.diag(s**2) + float(str(more.pop("shared", 0.0))) ** 2
    springs = (0, 1) * 8 if driver == "cycle" else ()
    law = replace(
        made_up_law(), port=port, driver=driver, driver_values=x, value=y, sigma=np.sqrt(np.diag(covariance)),
        covered=np.ones(len(x), np.bool_), **more,
    )  # fmt: skip
    return law_sentence(law, 0.70, OnNodes(x, y, covariance, springs=springs))


def test_transformations_that_move_with_cycling_are_not_called_an_error_of_the_sensor() -> None:
    said = sentence("temperature", "cycle", [1, 2, 3, 4], [0.0, 0.3, 0.6, 0.9], [0.02] * 4, unit="°C")
    assert said.startswith("the shift of the transformation temperatures rises by 0.9")
    law = replace(made_up_law(), port="temperature", driver="cycle")
    assert law.gives == "shift of the transformation temperatures"


def test_a_law_over_half_cycles_that_alternates_is_no_rise() -> None:
    # Friction of 0.70 mN·m where spring A is driven, 1.12 where spring B is, the last half-cycle known badly.
    values, sigma = [0.0, 0.42, 0.001, 0.42, 0.0, 0.42], [0.0, 0.05, 0.007, 0.01, 0.007, 0.28]
    said = sentence("friction", "cycle", [1, 2, 3, 4, 5, 6], values, sigma)
    assert "rises" not in said
    assert "alternates between 0.700 and 1.12 mN·m from one half-cycle to the next" in said
    assert "half-cycles 2, 4 and 6, in which spring B is the driven one" in said


def test_a_law_that_is_monotone_within_its_sigma_rises_or_falls() -> None:
    cycles = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    said = sentence("friction", "cycle", cycles, [0.0, 0.07, 0.06, 0.14, 0.20, 0.28], [0.01] * 6)
    assert said == "friction torque rises by 40 % from half-cycle 1 to 6"
    said = sentence("phase", "cycle", cycles, [0.0, -0.06, -0.12, -0.18, -0.24, -0.31], [0.001] * 6, unit="%")
    assert said == "the recoverable angle falls by 0.31 % from half-cycle 1 to 6"
    # An offset that all values share takes nothing from a slope.
    said = sentence("reading", "time_s", cycles, [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0], [0.05] * 6, unit="°", shared=2.3)
    assert said == "the reading's error rises by 5.00° over time, between 1.00 and 6.00 s"
    said = sentence("reading", "time_s", cycles, [0.3, 0.2, 0.3, 0.2, 0.3, 0.2], [0.5] * 6, unit="°", shared=2.3)
    assert said == "the reading's error has no certain change over time, between 1.00 and 6.00 s: " + CONSTANT


def test_a_law_of_which_nothing_is_certain_is_not_told_as_a_value() -> None:
    said = sentence("friction", "temp_passive_c", [23.0, 26.0, 29.0], [-0.05, 0.0, 0.05], [0.05] * 3, shared=0.2)
    over = "over the other spring's temperature, between 23.0 and 29.0 °C: "
    assert said == f"friction torque has no certain change {over}{CONSTANT}"


def test_a_law_that_is_one_constant_depends_on_nothing() -> None:
    cycles = [1.0, 2.0, 3.0, 4.0]
    said = sentence("temperature", "time_s", cycles, [-0.56] * 4, [1e-6] * 4, unit="s", shared=0.05)
    assert said == "the lead of the temperature log's clock is −0.560 s and constant within its 95 % interval"
    said = sentence("friction", "cycle", cycles, [0.07] * 4, [0.01] * 4)
    assert said == "friction torque is 10 % higher and constant within its 95 % interval"


def test_a_law_that_rises_and_falls_is_said_by_its_highest_place() -> None:
    said = sentence(
        "temperature", "temp_active_c", [20, 40, 60, 80], [0.0, 1.0, 3.0, 1.0], [0.2] * 4, unit="°C", spring="a"
    )  # fmt: skip
    assert said == (
        "the wire's temperature less its sensor's (spring A) is highest at 60.0 °C, 3.00 °C above its lowest value at "
        "20.0 °C, between 20.0 and 80.0 °C"
    )


def test_two_laws_of_one_place_read_differently_and_hold_no_rounding() -> None:
    places = [321.0, 467.0, 613.0, 759.0]
    first = sentence("winding", "winding_deg", places, [-7.7e-13, 2e-13, 0.002, 0.975], [0.0, 0.0, 1e-4, 0.05])
    second = sentence(
        "winding", "winding_deg", places, [-7.7e-13, 2e-13, 0.002, 0.975], [0.0, 0.0, 1e-4, 0.05], number=2
    )
    assert first != second
    assert "e−1" not in first
    assert (
        first
        == "a spring's torque beside its own rises by 0.975 mN·m over the winding of the spring, between 321 and 759°"
    )
