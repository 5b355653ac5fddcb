"""``--json``: one object on standard output and nothing else, on success and on refusal."""

from __future__ import annotations

import inspect
import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.bad_inputs import make_world
from tests.command_line import leave
from torsight.actuator import ActuatorModel, FittedModel, reference_spec, write_model
from torsight.cli.answer import Answer
from torsight.cli.main import COMMANDS
from torsight.core.law import LawForm

SILENT = ("view",)
"""Commands that show something and have no result to give."""


def answer_of(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, Any], str]:
    code = leave(*words, "--json")
    told = capsys.readouterr()
    answer = json.loads(told.out)
    assert answer["schema"] == 1
    assert answer["exit_code"] == code
    assert answer["command"] == f"torsight {words[0]}"
    return answer, told.err


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("answers") / "world"
    make_world(folder)
    return folder


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_reports_answers_scripts(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    command = getattr(import_module(f"torsight.cli.{name}"), name)
    reports = inspect.signature(command, eval_str=True).return_annotation is Answer
    assert reports == (name not in SILENT)
    leave(name, "--help")
    assert ("--json" in capsys.readouterr().out) == reports


def test_an_answer_names_the_files_and_what_they_hold(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "sim.csv"
    inputs = [str(world / name) for name in ("actuator.toml", "temps.csv")]
    answer, _ = answer_of("simulate", *inputs, "--start-angle", "178", "--out", str(out), capsys=capsys)
    assert answer["files"] == {"sim.csv": str(out)}
    assert answer["result"]["rows"] == len(out.read_text().splitlines()) - 1
    assert answer["result"]["angle_max_deg"] <= 178.0 + 1e-9
    assert answer["result"]["angle_min_deg"] < 0.0


def test_the_result_is_what_the_file_holds(world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("fit", str(world / "merged.csv"), "--actuator", str(world / "actuator.toml"), "--out", str(tmp_path))
    answer, told = answer_of(*words, capsys=capsys)
    assert answer["result"] == {
        k: v for k, v in json.loads((tmp_path / "fit.json").read_text()).items() if k != "schema"
    }
    assert "friction torque" in told


@pytest.mark.parametrize("wrong", [("per_k = 32.0", "per_k = 7.0"), ("tau_c_mnm = 0.8", "tau_c_mnm = 790.0")])
def test_a_fit_that_explains_nothing_is_no_result(
    world: Path, tmp_path: Path, wrong: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    actuator = tmp_path / "actuator.toml"
    actuator.write_text((world / "actuator.toml").read_text().replace(*wrong))
    words = ("fit", str(world / "merged.csv"), "--actuator", str(actuator), "--out", str(tmp_path))
    answer, told = answer_of(*words, capsys=capsys)
    assert answer["exit_code"] == 4
    assert answer["result"]["r2"] <= 0.0
    assert set(answer["files"]) == {"fit.json", "model.json"}
    assert all(Path(path).is_file() for path in answer["files"].values())
    assert "no better than a constant angle" in told
    assert "the model turns by 0°" in told


def test_a_fit_says_which_model_it_takes_the_place_of(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("fit", str(world / "merged.csv"), "--actuator", str(world / "actuator.toml"), "--out", str(tmp_path))
    law = LawForm("friction_temp_active_c", np.array([20.0, 80.0]), np.eye(2), "mN·m", 0.1, prior=True)
    extended = ActuatorModel(reference_spec(), ["viscous_friction", "home_torque"], laws=(law,))
    write_model(tmp_path / "model.json", FittedModel(extended, extended.nominal()))
    assert leave(*words) == 0
    told = capsys.readouterr().err
    assert f"model.json held a model with viscous_friction and the law {law.id}; it now holds this fit's" in told
    assert leave(*words) == 0
    assert "held a model" not in capsys.readouterr().err


def test_a_refusal_says_what_where_and_what_to_do(world: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answer, told = answer_of("run", str(world / "nothing.toml"), capsys=capsys)
    assert answer["exit_code"] == 3
    assert answer["error"]["what"] == "no such file"
    assert answer["error"]["where"].endswith("nothing.toml")
    assert answer["error"]["message"] in told
    assert "result" not in answer
