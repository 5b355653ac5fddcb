"""The page as a whole: right numbers, from any subset of files, self-contained, well-formed."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from made_up_run import curves, discovery, parameter, rewrite, write_made_up_run
from report_words import words_of

from torsight.core.errors import InputError
from torsight.report import write_report
from torsight.report.figures.residuals import driver_columns, slope

ACTUATOR = """
[material]
E_A_gpa = 60
A_s_c = 36
A_f_c = 54
C_A_mpa_per_k = 32
[friction]
tau_c_mnm = 0.8
[uncertainty]
E_A_gpa = 1.8
A_s_c = 0.4
A_f_c = 0.4
"""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_made_up_run(tmp_path, rate_hz=5.0)
    actuator = tmp_path / "actuator.toml"
    actuator.write_text(ACTUATOR, encoding="utf-8")
    rewrite(tmp_path, "provenance", configuration={"actuator": {"file": str(actuator)}})
    return tmp_path


text_of = words_of


def test_the_picture_of_the_track_is_in_the_page_itself(run: Path) -> None:
    cv2.imwrite(str(run / "track.png"), np.arange(256, dtype=np.uint8).reshape(16, 16))
    (found,) = re.findall(r'src="data:image/webp;base64,([^"]+)"', text_of(run))
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(found), np.uint8), cv2.IMREAD_GRAYSCALE)
    shown = cv2.imread(str(run / "track.png"), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert shown is not None
    # A lossy copy: the same picture to the eye, four grey levels rms.
    assert picture.shape == shown.shape
    assert np.sqrt(np.mean((picture.astype(float) - shown) ** 2)) < 4.0
    # A record that begins with angles has no film: a picture that lies there is of something else.
    (run / "track.json").unlink()
    assert "data:image/webp" not in text_of(run)


def test_it_says_the_numbers_of_the_results(run: Path) -> None:
    text = text_of(run)
    angle = pd.read_csv(run / "angle.csv")["angle_deg"]
    for words in (
        "The model lacks an effect: sensor lag.",
        f"{angle.max() - angle.min():.1f}",
        "0.793",
        "0.771 to 0.815",
        "33.4 → 0.44",
        "0.060",
        "4.020 s",
        "0.996",
        "moving_outer is covered",
        "lower CRF",
        "12.31 s",
        "9f9f9f9f9f9f9f9f",
        "The angle is not known in 15 of 2000 frames.",
    ):
        assert words in text, words


def test_the_pull_is_the_distance_in_standard_deviations_of_the_characterisation(run: Path) -> None:
    text = text_of(run)
    # (38.9 − 36) / 0.4 = 7.25 and (36.2 − 36) / 0.4 = 0.5
    begins = '<tr><th scope="row"><span class="symbol"><i>A</i><sub>s</sub></span>'
    row = re.search(f"{begins}.*?</tr>", text, flags=re.DOTALL)
    assert row is not None
    assert re.search(r'class="figure far">\+7\.2', row.group())
    assert re.search(r'class="figure">\+0\.5', row.group())
    assert "36.00 ± 0.40" in row.group()


def test_what_the_model_file_carries_comes_before_the_actuator_file(run: Path) -> None:
    actuator = {"material": {"A_s_c": 37.9}, "uncertainty": {"A_s_c": 0.5}}
    (run / "model.json").write_text(json.dumps({"schema": 1, "actuator": actuator}), encoding="utf-8")
    assert "37.90 ± 0.50" in text_of(run)


def test_the_plain_fit_of_the_discovery_comes_before_the_one_of_the_fit(run: Path) -> None:
    rewrite(run, "discovery", plain_parameters={"A_s_c": parameter(33.3, 0.1, "°C")})
    text = text_of(run)
    assert "33.30 (33.10 to 33.50)" in text
    assert "38.90 (" not in text


def test_where_every_half_cycle_was_left_out_once_nothing_is_shaded(run: Path) -> None:
    table = pd.read_csv(run / "curves.csv")
    table["held_out"] = 1
    table.to_csv(run / "curves.csv", index=False)
    text = text_of(run)
    assert "Each half-cycle was held out of the fit once" in text
    assert not re.search(r"held-out half-cycle\b", text)


def test_a_fit_that_leaves_more_than_the_noise_is_no_news_once_a_discovery_has_answered(run: Path) -> None:
    words = "This record is not explained: the residual is 15.0 times the noise floor. The error is 4°"
    rewrite(run, "fit", residual={"variance_ratio": 225.0}, attention=[words], notes=[words, "a note"])
    text = text_of(run)
    assert "The error is 4°" not in text
    assert "A note." in text
    (run / "discovery.json").unlink()
    text = text_of(run)
    assert "the residual is 15.0 times the noise floor. The plain model was fitted" in text
    assert "The error is 4°." in text


@pytest.mark.parametrize(
    ("kept", "there", "absent"),
    [
        ("angle.csv", "The motion was measured", "The residual"),
        ("merged.csv", "Temperatures against time", "Parameters"),
        ("markers.csv", "Where the markers went", "The motion</h2>"),
        ("track.json", "moving_outer is covered", "The motion</h2>"),
        ("sync.json", "The two clocks", "Parameters"),
        ("fit.json", "The plain model was fitted", "What was missing"),
        ("discovery.json", "The model lacks an effect: sensor lag", "The motion</h2>"),
        ("curves.csv", "What is left", "Parameters"),
        ("provenance.json", "torsight run", "Parameters"),
    ],
)
def test_any_single_file_makes_a_page_of_its_sections(run: Path, kept: str, there: str, absent: str) -> None:
    for file in run.iterdir():
        if file.name != kept:
            file.unlink()
    text = text_of(run)
    assert there in text
    assert absent not in text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"verdict": "none", "effects": []}, "This record shows nothing that the model lacks."),
        (
            {"verdict": "ambiguous", "alternatives": [["clock_offset"], ["viscous_friction", "fatigue"]]},
            "this record cannot tell which: sensor lag, clock offset or viscous friction with fatigue.",
        ),
        (
            {"verdict": "ambiguous", "alternatives": [["fatigue", "sensor_lag"]]},
            "this record cannot tell which: sensor lag alone or fatigue with sensor lag.",
        ),
        (
            {"verdict": "unknown", "effects": []},
            "It depends on the rate of the temperature, the direction and the driven spring&#39;s temperature.",
        ),
        ({"verdict": "none", "effects": [], "evidence": {"gains": {}}}, "there was nothing to search for"),
        ({"verdict": "none", "effects": [], "evidence": {"gains": {"fatigue": 1.0}}}, "Every known effect"),
        # Two candidates whose log evidence differs by 5: e⁵ = 148.
        (
            {"evidence": {"gains": {"fatigue": 1.0, "sensor_lag": 40.0, "clock_offset": 35.0}}},
            "Next comes clock offset: alone it makes the record 148 times less probable.",
        ),
        ({"held_out": [], "after": None, "before": None}, "No half-cycle could be held out"),
        ({"effects": [discovery()["effects"][0] | {"probability": 0.71}]}, "with probability 0.71 only"),
        ({"next_experiment": {"text": "Hold spring A at 60 °C for 120 s."}}, "Hold spring A at 60 °C for 120 s."),
        ({"next_experiment": {"text": "Hold."}}, "The experiment that would distinguish them"),
        (
            {"next_experiment": {"text": "None.", "separation_gain": 0.1, "needed_gain": 5.9}},
            "The experiment that comes nearest to a decision",
        ),
        (
            {"parameters": {"A_s_c": parameter(40.0, 0.1, "°C")}},
            "The record contradicts the characterised <i>A</i><sub>s</sub> by 10.0 standard deviations.",
        ),
    ],
)
def test_every_kind_of_answer_has_its_words(run: Path, changes: dict[str, object], words: str) -> None:
    rewrite(run, "discovery", **changes)
    assert words in text_of(run)


def test_a_record_that_fixes_no_values_says_so_before_that_nothing_is_missing(run: Path) -> None:
    """Two half-cycles, each from the other: 4.69° off at a floor of 0.05°; the fit to both leaves 0.07°."""
    errors = {"rmse_train_deg": 0.07, "rmse_held_out_deg": 4.69, "r2_held_out": 0.999}
    evidence = {"over_floor_before": 1.47, "over_floor_after": 1.47}
    changes = {"verdict": "none", "effects": [], "before": errors, "after": errors, "held_out": [0, 1]}
    rewrite(run, "discovery", **changes, noise_floor_deg=0.05, evidence=evidence)
    text = text_of(run)
    doubt = "does not determine the model&#39;s values: held-out half-cycles are missed by 4.69°, 94 times"
    assert 0 < text.index(doubt) < text.index("This record shows nothing that")
    assert "each half-cycle is predicted by a fit to the other one alone" in text
    assert "The fit to all half-cycles leaves 0.070° rms." in text
    # A fit that leaves as much as half-cycles that were not seen do has nothing to explain.
    rewrite(run, "discovery", before=errors | {"rmse_held_out_deg": 0.08}, after=errors | {"rmse_held_out_deg": 0.08})
    assert "does not determine" not in text_of(run)


def test_a_record_against_what_is_known_of_the_actuator_says_so_before_a_name(run: Path) -> None:
    pulls = [{"name": "E_M_gpa", "nominal": 12.0, "value": 7.9, "sigmas": -18.2}]
    pulls += [{"name": "A_s_c", "nominal": 50.0, "value": 51.0, "sigmas": 2.0}]
    against = "The record contradicts characterised values: <i>E</i><sub>M</sub> 12 → 7.9 (-18.2 σ); check the actuator"

    def answer() -> str:
        return text_of(run).partition("<h1>")[2].partition("</h1>")[0]

    rewrite(run, "discovery", pulls=pulls)
    assert 0 < answer().index(against) < answer().index("The model lacks an effect")
    rewrite(run, "discovery", pulls=pulls[1:])
    assert "contradicts" not in answer()


def test_names_from_outside_cannot_become_markup(run: Path) -> None:
    rewrite(run, "track", advice=["<script>alert(1)</script>"], events=[{"time_s": 1.0, "text": "a < b & c"}])
    text = text_of(run)
    assert "<script" not in text
    assert "a &lt; b &amp; c" in text


def test_an_empty_or_missing_folder_or_a_damaged_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no results"):
        write_report(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        write_report(str(tmp_path / "nowhere"))
    (tmp_path / "fit.json").write_text('{"schema": 1, "parameters"', encoding="utf-8")
    with pytest.raises(InputError, match=r"fit\.json.*is not JSON"):
        write_report(tmp_path)
    (tmp_path / "fit.json").unlink()
    (tmp_path / "curves.csv").write_text("time_s,angle_deg\n0,1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"curves\.csv.*plain_deg"):
        write_report(tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_a_slope_is_that_of_the_line_and_does_not_cross_from_spring_to_spring() -> None:
    table = curves(half_cycles=2)
    rate = driver_columns(table)["temp_rate_c_s"]
    inside = (table["time_s"] > 5) & (table["time_s"] < 55)
    # 50 °C in 60 s
    assert rate[inside] == pytest.approx(50.0 / 60.0, rel=1e-9)
    active = table["active"].to_numpy()
    apart = np.concatenate([[False], active[1:] != active[:-1]])
    time_s = table["time_s"].to_numpy()
    crossing = slope(time_s, table["temp_a_c"].to_numpy(), window_s=2.0, apart=apart)
    change = int(apart.nonzero()[0][0])
    assert pd.isna(crossing[change - 5 : change + 5]).all()
