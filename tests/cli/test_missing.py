"""``torsight missing`` and ``torsight predict`` on a model file of one's own."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command_line import leave
from tests.discovery.own_models import spring_record
from torsight.report.figures.own import is_ours
from torsight.report.plots.interactive import library
from torsight.report.write import write_page

MODEL = """
import time
import numpy as np
from torsight.discovery import candidate, parameter

output = "x_mm"
initial = ["x0_mm"]
sigma = 0.02
parameters = [
    parameter("gain", 1.0, lower=-10, upper=10),
    parameter("tau_s", 4.0, lower=0.6, upper=60),
    parameter("x0_mm", 0.0, lower=-10, upper=10),
]
candidates = [
    candidate("hardening", parameter("cubic", 0.01, lower=-0.05, upper=0.2, null=0)),
    candidate("bias", parameter("bias", 0.01, null=0)),
]


def predict(p, record):
    x, out, h = p.x0_mm, [], 0.25
    for u in record.u.tolist():
        out.append(x)
        for _ in range(2):
            first = (p.gain * u - x) / p.tau_s - p.cubic * x**3 - p.bias
            ahead = x + h * first
            x += 0.5 * h * (first + (p.gain * u - ahead) / p.tau_s - p.cubic * ahead**3 - p.bias)
    return np.array(out)
"""


def test_a_model_that_fails_names_file_and_record_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pd.DataFrame(spring_record(1, 2.0)).to_csv(tmp_path / "a.csv", index=False)
    for wrong, told in (("record.uu.", "line 22, in predict"), ("record.u..", "line 22: cannot be imported")):
        (tmp_path / "model.py").write_text(MODEL.replace("record.u.", wrong), encoding="utf-8")
        assert leave("missing", tmp_path / "model.py", tmp_path / "a.csv", "--out", tmp_path / "out") == 3
        words = capsys.readouterr().err
        assert f"model.py, {told}" in words
        assert words.count("model.py") == 1
        assert words.count("record 'a'") == (1 if "uu" in wrong else 0)


def test_a_setting_that_is_spelt_wrong_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pd.DataFrame(spring_record(1, 2.0)).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "model.py").write_text(MODEL.replace("sigma = 0.02", "sgma = 0.02"), encoding="utf-8")
    assert leave("missing", tmp_path / "model.py", tmp_path / "a.csv", "--out", tmp_path / "out") == 3
    told = capsys.readouterr().err
    assert "model.py, line 8: 'sgma' is no setting, and nothing reads it; " in told
    assert "did you mean 'sigma'?" in told


def test_a_record_that_is_given_twice_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.py").write_text(MODEL, encoding="utf-8")
    for name in ("a", "copy"):
        pd.DataFrame(spring_record(1, 2.0)).to_csv(tmp_path / f"{name}.csv", index=False)
    records = (tmp_path / "a.csv", tmp_path / "copy.csv")
    assert leave("missing", tmp_path / "model.py", *records, "--out", tmp_path / "out") == 2
    told = capsys.readouterr().err
    assert "copy.csv: is the same record as another one" in told
    assert str(records[0]) in told
    assert not (tmp_path / "out").exists()


def test_a_word_among_the_numbers_of_a_column_that_is_needed_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = pd.DataFrame(spring_record(1, 2.0)).assign(remark="warm")
    (tmp_path / "model.py").write_text(MODEL, encoding="utf-8")
    for name in ("u", "x_mm"):
        table.astype({name: object}).assign(**{name: table[name].where(table.index != 17, "abc")}).to_csv(
            tmp_path / "a.csv", index=False
        )
        assert leave("missing", tmp_path / "model.py", tmp_path / "a.csv", "--out", tmp_path / "out") == 3
        assert f"a, row 18, column {name}: is not a number; found 'abc'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own")
    (folder / "model.py").write_text(MODEL, encoding="utf-8")
    for name, seed, start in (("a", 1, 2.0), ("b", 2, -1.0), ("later", 9, 1.5)):
        pd.DataFrame(spring_record(seed, start)).to_csv(folder / f"{name}.csv", index=False)
    words = ("missing", folder / "model.py", folder / "a.csv", folder / "b.csv", "--out", folder / "results")
    assert leave(*words) == 0
    return folder


def test_a_model_file_and_records_give_results_and_a_report(world: Path) -> None:
    results = world / "results"
    content = json.loads((results / "discovery.json").read_text(encoding="utf-8"))
    assert (content["schema"], content["verdict"]) == (1, "identified")
    assert [effect["id"] for effect in content["effects"]] == ["hardening"]
    assert content["after"]["rmse_held_out"] < content["before"]["rmse_held_out"]
    assert content["outputs"]["x_mm"] == {"before": content["before"], "after": content["after"]}
    assert len(content["held_out"]) == content["blocks"]
    page = (results / "report.html").read_text(encoding="utf-8")
    assert "hardening is missing" in page
    drawn = {"before_after_1", "before_after_2", "candidates", "residual_u", "residual_time_s", "residual_reading_v"}
    drawn |= {"unseen_x_mm"}
    assert {path.stem for path in (results / "figures").iterdir()} == drawn
    assert all(f'<div class="plot" id="plot-{name}">' in page for name in drawn)
    assert page.count('<img class="still" src="data:image/svg+xml') == len(
        drawn
    )  # for paper, and where scripts are off
    own = page.replace(library(), "").replace("http://www.w3.org/", "")
    assert not re.search(r"https?://|url\((?!#|%23)|@import", own)
    assert not (results / "model_errors.txt").exists()


def test_the_laws_of_an_earlier_answer_go(world: Path, tmp_path: Path) -> None:
    results = shutil.copytree(world / "results", tmp_path / "results")
    content = json.loads((results / "discovery.json").read_text(encoding="utf-8"))
    content["laws"] = [{"file": "law_x_mm_u.csv"}]
    (results / "discovery.json").write_text(json.dumps(content), encoding="utf-8")
    for name in ("law_x_mm_u.csv", "law_of_mine.csv"):
        (results / name).write_text("driver\n", encoding="utf-8")
    assert leave("missing", world / "model.py", world / "a.csv", world / "b.csv", "--out", results) == 0
    assert [path.name for path in results.glob("law_*")] == ["law_of_mine.csv"]


def test_figures_show_the_residual_over_every_driver_and_those_of_an_earlier_answer_go(
    world: Path, tmp_path: Path
) -> None:
    results = shutil.copytree(world / "results", tmp_path / "results")
    means = pd.read_csv(results / "figures" / "residual_u.csv").groupby("residual")["mean"].std()
    assert means["before"] > 2.0 * means["after"]
    kept, gone = results / "figures" / "for_the_paper.svg", results / "figures" / "residual_old.svg"
    for path in (kept, gone):
        path.write_text("<svg/>", encoding="utf-8")
    write_page(results, {"figures": {}, "errors": []}, template="own_report.html", ours=is_ours)
    assert [path.name for path in (results / "figures").iterdir()] == [kept.name]


def test_its_model_predicts_another_record(world: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = world / "predicted.csv"
    assert leave("predict", world / "results" / "model.json", world / "later.csv", "--out", out, "--json") == 0
    assert json.loads(capsys.readouterr().out)["result"]["rows"] == 200
    made, later = pd.read_csv(out), pd.read_csv(world / "later.csv")
    off = (made["x_mm"] - later["x_mm"]) / made["x_mm_sigma"]
    assert 0.7 < float(np.sqrt(np.mean(off**2))) < 1.3
    later[["time_s", "x_mm"]].to_csv(world / "no_input.csv", index=False)
    assert leave("predict", world / "results" / "model.json", world / "no_input.csv", "--out", out) == 3
    assert "'no_input' has no column 'u'" in (told := capsys.readouterr().err)
    assert "correct the model, or the record" in told


def test_how_a_planned_record_begins_is_given_or_its_absence_told(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    later, model = pd.read_csv(world / "later.csv"), world / "results" / "model.json"
    later[["time_s", "u"]].to_csv(tmp_path / "planned.csv", index=False)
    words = ("predict", model, tmp_path / "planned.csv", "--out", tmp_path / "predicted.csv")
    assert leave(*words) == 0
    assert "how the record begins is not known (x0_mm)" in capsys.readouterr().err
    assert leave(*words, "--initial", "x0_mm=1.5") == 0
    assert "begins" not in capsys.readouterr().err
    made = pd.read_csv(tmp_path / "predicted.csv")
    off = (made["x_mm"] - later["x_mm"]) / made["x_mm_sigma"]
    assert 0.7 < float(np.sqrt(np.mean(off**2))) < 1.3
    for option in ("--start-angle", "--columns", "--units"):
        assert leave(*words, option, "0") == 2
        assert f"{option}: a model of one's own has no use for it" in capsys.readouterr().err
    assert leave(*words, "--initial", "x0_mm") == 2
    assert "write --initial x0=1.5" in capsys.readouterr().err
    assert leave(*words, "--initial", "gain=1.5") == 2
    assert "'gain' is no initial state; allowed x0_mm" in capsys.readouterr().err
    assert leave(*words, "--initial", "x0_mm=1.5", "--initial", "x0_mm = 2") == 2
    assert "--initial: 'x0_mm' is given twice" in capsys.readouterr().err


def test_a_model_file_that_has_changed_is_not_used(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(world, tmp_path / "w")
    (tmp_path / "w" / "model.py").write_text(MODEL + "\nMORE = 1\n", encoding="utf-8")
    words = ("predict", tmp_path / "w" / "results" / "model.json", world / "later.csv", "--out", tmp_path / "p.csv")
    assert leave(*words) == 3
    assert "has changed since the values were fitted" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1 / 0\n", "model.py, line 1: cannot be imported: ZeroDivisionError"),
        ("def f(:\n", "model.py, line 1: cannot be imported: SyntaxError"),
        (MODEL.replace("np.array(out)", "3"), "line 20, predict: a: predict gives a wrong shape"),
        ("import nowhere_to_be_found\n", "ModuleNotFoundError"),
        ("raise SystemExit(0)\n", "cannot be imported: SystemExit"),
        ("output = 'x_mm'\n", "does not define predict, parameters"),
        ("def problem(records):\n    return None\n", "gives no problem"),
        (MODEL.replace("out.append(x)", "out.append(x / 0)"), "ZeroDivisionError: float division by zero"),
        (MODEL.replace('output = "x_mm"', 'output = "y"'), "has no column 'y'"),
        (MODEL + "\nsigma = 0.0\n", "model.py: Reading, sigma: is no positive number"),
        (MODEL + "\nlaws = 'friction'\n", "model.py: laws: cannot be used; found 'friction'"),
    ],
)
def test_a_model_file_that_fails_says_where(
    text: str, words: str, world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "model.py").write_text(text, encoding="utf-8")
    assert leave("missing", tmp_path / "model.py", world / "a.csv", "--out", tmp_path / "out") == 3
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1
    assert told.count("model.py") == 1
    assert not (tmp_path / "out").exists()
    leave("--debug", "missing", tmp_path / "model.py", world / "a.csv", "--out", tmp_path / "out")
    assert "Traceback" in capsys.readouterr().err


def test_the_actuator_still_needs_its_start_angle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.json").write_text('{"schema": 1}', encoding="utf-8")
    assert leave("predict", tmp_path / "model.json", tmp_path / "t.csv", "--out", tmp_path / "p.csv") == 2
    assert "--start-angle" in capsys.readouterr().err
