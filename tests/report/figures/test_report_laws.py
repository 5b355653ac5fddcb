"""Measured laws: from the discovery's object to files, and from the files to the page."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from made_up_run import made_up_law, rewrite, write_made_up_run
from report_words import figures_of, words_of

from torsight.core.errors import InputError
from torsight.discovery.measured_law import read_laws
from torsight.report.figures.law_plots import write_laws
from torsight.report.plots.panels import Band, Line, Ribbon


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
