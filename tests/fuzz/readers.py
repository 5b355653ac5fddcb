"""Every reader of a file that somebody else may have written, with one good file of its kind.

Used by the property tests here and by the coverage-guided run in ``benchmarks/trust/fuzz.py``.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.axis import read_circles
from calibration.boards.board_file import read_board
from sync import read_light_events, read_temperature_log
from tests.cli.bad_inputs import ACTUATOR, BOARD, CAMERA, EXPERIMENT, FROM_LEFT, MARKERS
from torsight.actuator.characterising.spring_tests import read_tests
from torsight.actuator.doubt import Alternative, Doubt
from torsight.actuator.fitted import End, FittedModel, read_model, write_model
from torsight.actuator.model import ActuatorModel
from torsight.actuator.record.logs import read_log
from torsight.actuator.spec import actuator_from, read_actuator
from torsight.cli.experiment_file import read_experiment
from torsight.cli.run import again
from torsight.core.files.results import read_results
from torsight.core.files.storage import read_json
from torsight.core.files.tables import read_angles, read_merged
from torsight.core.optics.camera import read_camera
from torsight.synthetic.scene import read_scene
from tracker.detect.marker_file import read_markers
from tracker.frames.source import read_times


@dataclass(frozen=True, slots=True)
class Reader:
    """A reader, the name of its file, and the content of a good one."""

    read: Callable[[Path], Any]
    name: str
    good: bytes


TESTS = """
[spring]
wire_diameter_mm = 0.5
wire_length_mm = 64.1
lever_mm = 26.4
[[free_recovery]]
file = "recovery.csv"
pre_deformation_deg = -118.0
[[force_angle]]
file = "small.csv"
range = "small"
[[force_angle]]
file = "small.csv"
range = "large"
from_deg = -60.0
to_deg = 0.0
[block]
file = "block.csv"
pre_deformation_deg = -85.0
[assembly]
theta_p_deg = 1080.0
[friction]
tau_c_mnm = 0.8
"""
SCENE = """
seed = 3
[actuator.material]
E_A_gpa = 61.0
[rig]
as_declared = true
[protocol]
rest_s = 12.0
[[protocol.half_cycle]]
spring = "a"
peak_c = 84.0
[effects.position_friction]
amplitude = 0.5
[film]
fps = 8.0
codec = "ffv1"
[camera]
distortion = [0.0, 0.1, 0.0, 0.0, 0.0]
[[event]]
kind = "hand"
shift_px = [1.0, 2.0]
"""
PROVENANCE = """{"schema": 1, "command": "torsight run", "versions": {"python": "3.11"}, "inputs": {"film.avi": "9f"},
"configuration": {"video": {"path": "film.avi"}, "temperature": {"path": "temps.csv"},
"actuator": {"file": "actuator.toml"}, "output": {"dir": "results"}, "discover": {"seed": 0}}, "seed": 0}"""
DISCOVERY = """{"schema": 1, "verdict": "identified", "effects": [{"id": "sensor_lag", "family": "temperature",
"parameters": {"lag_s": {"value": 4.0, "sigma": 0.1, "ci95": [3.8, 4.2], "unit": "s"}}, "probability": 0.99}],
"alternatives": [], "drivers": [{"variable": "temp_rate_c_s", "share": 0.7}], "held_out": [1],
"before": {"rmse_train_deg": 5.0, "rmse_held_out_deg": 6.0, "r2_held_out": 0.9}, "noise_floor_deg": 0.1,
"parameters": {"tau_c_mnm": {"value": 0.8, "sigma": 0.01, "ci95": [0.78, 0.82], "unit": "mN·m", "fixed": false}}}"""


def _model() -> bytes:
    model = ActuatorModel(actuator_from(tomllib.loads(ACTUATOR), where="test"), ("sensor_lag",))
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "model.json"
        late = ActuatorModel(model.spec, ("clock_offset",))
        doubt = Doubt(("tau_c_mnm",), np.array([[4e-4]]), 0.3, (Alternative(("clock_offset",), late.nominal()),))
        end = End(3.0, (0.1, 0.2))
        left = {"cycles": (1, 1), "account": {"rmse_deg": 0.3}, "end": end, "duration_s": 900.0}
        write_model(path, FittedModel(model, model.nominal(), doubt=doubt, **left))
        return path.read_bytes()


def _rows(header: str, *columns: np.ndarray) -> bytes:
    lines = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([header, *lines, ""]).encode()


_TIME_S = np.arange(0.0, 40.0, 1.0)
_TEMP_C = np.interp(_TIME_S, [0, 5, 20, 40], [23.0, 23.0, 80.0, 24.0])
_ROOM_C = np.full_like(_TIME_S, 23.0)
_ANGLE_DEG = np.interp(_TEMP_C, [45.0, 70.0], [178.0, -230.0])
_SIGMA_DEG = np.full_like(_TIME_S, 0.05)
_TEMPS = _rows("time_s,temp_a_c,temp_b_c,heat_a,heat_b", _TIME_S, _TEMP_C, _ROOM_C, _TIME_S < 20, _TIME_S < 0)
_DATED = b"made by a logger;;\ntime_s;temp_a_c;temp_b_c\n" + b"".join(
    b"2024-05-01T10:00:%02d;%d,5;23,1\n" % (second, 20 + second) for second in range(40)
)
_MARKER_COLUMNS = ",".join(
    f"{name}_{part}"
    for name in ("base_inner", "base_outer", "moving_inner", "moving_outer")
    for part in ("x_px", "y_px", "sigma_px", "valid")
)
_TURN = np.linspace(0.0, 5.0, 40)
_CIRCLES = [
    column
    for radius in (20.0, 50.0, 20.0, 50.0)
    for column in (80 + radius * np.cos(_TURN), 60 + radius * np.sin(_TURN), 0.05 + 0 * _TURN, 1 + 0 * _TURN)
]


def _as_parquet(text: bytes) -> bytes:
    import io

    import pandas as pd

    buffer = io.BytesIO()
    pd.read_csv(io.BytesIO(text)).to_parquet(buffer, index=False)
    return buffer.getvalue()


def make_neighbours(folder: Path) -> None:
    """Write the files that some of the good files name."""
    good = {name: reader.good for name, reader in READERS.items()}
    beside = {"film.avi": b"a film", "temps.csv": good["log"], "actuator.toml": ACTUATOR.encode()}
    line = np.linspace(20.0, 80.0, 40)
    beside |= {
        "recovery.csv": _rows("temp_c,angle_deg", line, np.linspace(-118.0, 0.0, 40)),
        "small.csv": _rows("angle_deg,force_n", np.linspace(-60.0, 0.0, 40), np.linspace(-0.5, 0.0, 40)),
        "block.csv": _rows("temp_c,force_n", line, np.linspace(0.0, 3.0, 40)),
    }
    for name, content in beside.items():
        (folder / name).write_bytes(content)


def _read_run(path: Path) -> object:
    return read_results(path.parent)


READERS: dict[str, Reader] = {
    "actuator": Reader(read_actuator, "a.toml", ACTUATOR.encode()),
    "board": Reader(read_board, "b.toml", BOARD.encode()),
    "camera": Reader(read_camera, "c.toml", CAMERA.encode()),
    "stereo": Reader(
        read_camera, "s.toml", (CAMERA + CAMERA.replace("[intrinsics]", "[right.intrinsics]") + FROM_LEFT).encode()
    ),
    "experiment": Reader(read_experiment, "e.toml", EXPERIMENT.encode()),
    "markers": Reader(read_markers, "m.toml", MARKERS.encode()),
    "scene": Reader(read_scene, "scene.toml", SCENE.encode()),
    "tests": Reader(read_tests, "tests.toml", TESTS.encode()),
    "temperature": Reader(read_temperature_log, "t.csv", _TEMPS),
    "dated temperature": Reader(read_temperature_log, "d.csv", _DATED),
    "log": Reader(read_log, "l.csv", _TEMPS),
    "angle": Reader(
        read_angles,
        "angles.csv",
        _rows("frame,time_s,angle_deg,angle_sigma_deg,valid", _TIME_S, _TIME_S, _ANGLE_DEG, _SIGMA_DEG, _TIME_S >= 0),
    ),
    "merged": Reader(
        read_merged,
        "merged.csv",
        _rows(
            "time_s,angle_deg,angle_sigma_deg,temp_a_c,temp_b_c,heat_a,heat_b",
            *(_TIME_S, _ANGLE_DEG, _SIGMA_DEG, _TEMP_C, _ROOM_C, _TIME_S < 20, _TIME_S < 0),
        ),
    ),
    "merged parquet": Reader(
        read_merged,
        "merged.parquet",
        _as_parquet(
            _rows(
                "time_s,angle_deg,angle_sigma_deg,temp_a_c,temp_b_c",
                *(_TIME_S, _ANGLE_DEG, _SIGMA_DEG, _TEMP_C, _ROOM_C),
            )
        ),
    ),
    "temperature parquet": Reader(read_temperature_log, "t.parquet", _as_parquet(_TEMPS)),
    "times": Reader(read_times, "times.csv", _rows("frame,time_s", _TIME_S, _TIME_S / 20.0)),
    "light": Reader(read_light_events, "light.csv", b"time_s,on\n60,1\n200,0\n"),
    "circles": Reader(
        read_circles, "markers.csv", _rows(f"frame,time_s,{_MARKER_COLUMNS}", _TIME_S, _TIME_S, *_CIRCLES)
    ),
    "model": Reader(read_model, "model.json", _model()),
    "provenance": Reader(again, "provenance.json", PROVENANCE.encode()),
    "discovery": Reader(_read_run, "discovery.json", DISCOVERY.encode()),
    "json": Reader(read_json, "fit.json", b'{"schema": 1, "rmse_deg": 0.3, "case": "a"}'),
}
