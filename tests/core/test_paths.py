"""Paths as people give them: every public function takes text where it takes a Path."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration import read_board
from sync import estimate_clock, find_clock, merge, read_light_events, read_temperature_log
from tests.cli.bad_inputs import ACTUATOR, BOARD, CAMERA, MARKERS
from torsight.actuator import (
    ActuatorModel,
    FittedModel,
    fit_model,
    fitted_model,
    read_actuator,
    read_log,
    read_model,
    reference_spec,
    stable_cycle,
    write_model,
)
from torsight.core import (
    StickAngles,
    SyncedTable,
    read_angles,
    read_camera,
    read_merged,
    read_results,
    write_angles,
    write_merged,
)
from torsight.core.errors import ConfigError
from torsight.discovery import discover_together, predict_with_sigma
from torsight.synthetic import read_scene
from tracker import open_source, read_markers

PACKAGES = (
    *("tracker", "sync", "calibration", "torsight.core", "torsight.actuator", "torsight.discovery"),
    *("torsight.synthetic", "torsight.viewer", "torsight.report"),
)


def public_functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", None) or dir(module):
            found = inspect.unwrap(getattr(module, name))
            if inspect.isfunction(found) and not name.startswith("_"):
                yield f"{package}.{name}", found


def test_no_public_function_wants_a_path_object() -> None:
    narrow = [
        f"{name}({parameter.name})"
        for name, function in public_functions()
        for parameter in inspect.signature(function).parameters.values()
        if "Path" in str(parameter.annotation).replace("AnyPath", "").replace("str | Path", "")
    ]
    assert narrow == []


TEMPS = "time_s,temp_a_c,temp_b_c\n" + "".join(f"{i},{20 + i},{20}\n" for i in range(30))
TEXTS = {
    "actuator.toml": (ACTUATOR, read_actuator),
    "camera.toml": (CAMERA, read_camera),
    "markers.toml": (MARKERS, read_markers),
    "board.toml": (BOARD, read_board),
    "scene.toml": ("seed = 3\n", read_scene),
    "temps.csv": (TEMPS, read_temperature_log),
    "log.csv": (TEMPS, read_log),
    "led.csv": ("time_s,on\n1.0,1\n2.0,0\n", read_light_events),
}


@pytest.mark.parametrize("name", TEXTS)
def test_files_are_read_by_the_text_of_their_path(tmp_path: Path, name: str) -> None:
    content, read = TEXTS[name]
    (tmp_path / name).write_text(content, encoding="utf-8")
    assert repr(read(str(tmp_path / name))) == repr(read(tmp_path / name))


def test_tables_and_models_go_to_the_text_of_a_path_and_back(tmp_path: Path) -> None:
    time_s = np.arange(5.0)
    ones = np.ones(5)
    angles = StickAngles(np.arange(5), time_s, 0.1 * ones, 1e-3 * ones, ones > 0, ones > 0)
    write_angles(str(tmp_path / "angle.csv"), angles)
    write_merged(str(tmp_path / "merged.csv"), SyncedTable(time_s, 0.1 * ones, 1e-3 * ones, 24 * ones, 25 * ones))
    assert len(read_angles(str(tmp_path / "angle.csv"))) == len(read_merged(str(tmp_path / "merged.csv"))) == 5
    assert read_results(str(tmp_path)).folder == tmp_path
    with pytest.raises(ValueError, match="no such file"):
        open_source(str(tmp_path / "film.mp4"), timestamps=str(tmp_path / "times.csv"))


def test_a_model_goes_to_the_text_of_a_path_and_back(tmp_path: Path, half_cycle: SyncedTable) -> None:
    model = ActuatorModel(reference_spec())
    fitted = fitted_model(model, model.nominal(), model.prepare(half_cycle))
    write_model(str(tmp_path / "model.json"), fitted)
    assert read_model(str(tmp_path / "model.json")).values == fitted.values


def wrong_objects() -> dict[str, tuple[Callable[[], object], str]]:
    model, path = ActuatorModel(reference_spec()), Path("merged.csv")
    wrong: Any = str(path)
    other: Any = model
    fitted = FittedModel(model, model.nominal())
    return {
        "model": (lambda: ActuatorModel(wrong), r"ActuatorModel, spec: is no ActuatorSpec; found 'merged.csv'"),
        "prepare": (lambda: model.prepare(wrong), r"is no SyncedTable; found 'merged.csv'; .*read_merged\(path\)"),
        "log": (lambda: model.prepare_log(other, start_angle_rad=3.0), r"no TemperatureLog; found ActuatorModel"),
        "fit": (lambda: fit_model(model, other), r"fit_model, drive: is no Drive; found ActuatorModel"),
        "fit a path": (lambda: fit_model(wrong, other), r"fit_model, model: is no ActuatorModel; found 'merged.csv'"),
        "sigma": (lambda: predict_with_sigma(wrong, wrong, start_angle_rad=3.0), r"no FittedModel; found 'merged.csv'"),
        "predict": (lambda: fitted.predict(wrong, start_angle_rad=3.0), r"no TemperatureLog; .*read_log\(path\)"),
        "together": (lambda: discover_together(other, reference_spec()), r"tables: is no Sequence; .* as a list"),
        "cycle": (lambda: stable_cycle(wrong), r"is no Rig; found 'merged.csv'; .*Rig\.from_values"),
        "clock": (lambda: estimate_clock(wrong, wrong), r"no TemperatureLog; found 'merged.csv'; .*read_log\(path\)"),
        "clock of a log": (lambda: find_clock(wrong, wrong), r"is no StickAngles; .*read_angles\(path\)"),
        "merge": (lambda: merge(wrong, wrong, wrong), r"merge, angles: is no StickAngles; found 'merged.csv'"),
        "angles": (lambda: write_angles(path, other), r"is no StickAngles; found ActuatorModel"),
        "merged": (lambda: write_merged(path, other), r"is no SyncedTable; found ActuatorModel"),
    }


@pytest.mark.parametrize("name", wrong_objects())
def test_a_path_in_the_place_of_what_it_holds_is_told(name: str) -> None:
    call, told = wrong_objects()[name]
    with pytest.raises(ConfigError, match=told):
        call()


def test_one_effect_may_be_given_by_its_name_alone() -> None:
    assert ActuatorModel(reference_spec(), "sensor_lag") == ActuatorModel(reference_spec(), ("sensor_lag",))


def test_a_value_that_is_no_number_is_refused_and_not_simulated(half_cycle: SyncedTable) -> None:
    model = ActuatorModel(reference_spec())
    values = {**model.nominal(), "tau_c_mnm": float("nan")}
    with pytest.raises(ConfigError, match=r"'tau_c_mnm': is not finite; found nan"):
        model.simulate(model.prepare(half_cycle), values)
