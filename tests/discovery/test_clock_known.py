"""Clocks that were put together beforehand: an offset within what that left open is no effect that is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.core.errors import InputError
from torsight.core.files.storage import write_json
from torsight.core.files.tables import read_merged
from torsight.core.records import SyncedTable
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.fitting import Fitter
from torsight.discovery.inference.noise import Scales, Stretches, information
from torsight.discovery.model_fit import fit_model
from torsight.discovery.settings import Settings
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from


def rig_record(effects: dict[str, Any], ramps_s: Sequence[float] = (300.0, 300.0)) -> SyncedTable:
    """Return a record of half-cycles of a rig with these effects, A and B in turn."""
    half_cycles = [
        {"spring": "ab"[k % 2], "peak_c": 75.0, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": 250.0}
        for k, ramp_s in enumerate(ramps_s)
    ]
    scene = {"motion": {"kind": "rig"}, "protocol": {"half_cycle": half_cycles}, "effects": effects}
    return make_record(scene, seed=5, sigma_deg=0.15).table


def test_clocks_that_are_off_within_what_sync_left_open_lack_no_effect() -> None:
    model = ActuatorModel(actuator_from(declared_from({}, where="test").to_toml(), where="test"))
    table = rig_record({}, ramps_s=(300.0, 100.0, 100.0, 300.0))
    late = {
        name: np.interp(table.time_s - 2.0, table.time_s, getattr(table, name)) for name in ("temp_a_c", "temp_b_c")
    }
    clean, taken_as_exact, left_open = (
        fit_model(model, model.prepare(replace(table, **changes)))
        for changes in ({}, late, {**late, "clock_sigma_s": 1.0})
    )
    assert taken_as_exact.rmse_deg > 1.5 * clean.rmse_deg
    assert left_open.rmse_deg < 1.1 * clean.rmse_deg
    assert left_open.estimates["clock_offset_s"].value > 0.5
    # No value of the model makes up for it.
    off = abs(left_open.values["tau_c_mnm"] - clean.values["tau_c_mnm"])
    assert off < clean.estimates["tau_c_mnm"].sigma


def test_a_late_sensor_is_not_taken_for_clocks_that_are_known_to_agree() -> None:
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    drive = ActuatorModel(spec).prepare(rig_record({"sensor_lag": {"lag_s": 3.0}}))
    free, known = (ActuatorProblem(replace(drive, clock_sigma_s=sigma_s), spec) for sigma_s in (None, 0.05))
    assert "clock_offset" in [candidate.id for candidate in free.candidates]
    assert "clock_offset" not in [candidate.id for candidate in known.candidates]
    fitters = [Fitter(p, information(Stretches.of(p), Scales(0.1, 0.1, 4.0), p.sigma)) for p in (free, known)]
    plain, left_open = (fitter.base() for fitter in fitters)
    fits = [fitters[0].extend(plain, "clock_offset"), left_open]
    # More than half of the lag; the start of either spring, free within 10°, takes up a part of the rest.
    offset_s = [abs(fit.values["clock_offset_s"]) for fit in fits]
    assert offset_s[0] > 1.5
    assert offset_s[1] < 0.5 * offset_s[0]
    assert fits[1].cost > fits[0].cost + Settings().apart


def merged(folder: Path) -> Path:
    """Return a table of two rows."""
    path = folder / "merged.csv"
    path.write_text(
        "time_s,angle_deg,angle_sigma_deg,temp_a_c,temp_b_c\n0,1,0.1,23,23\n1,1,0.1,24,23\n", encoding="utf-8"
    )
    return path


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, None),
        ({"method": "motion against temperature: 4 of 4 strokes", "offset_s": {"ci95": [5.0400360, 8.9599640]}}, 1.0),
        # A film whose clock counts from 1970.
        ({"method": "motion", "offset_s": {"ci95": [-1e5, 1e5], "ci95_at_first_frame": [5.040036, 8.959964]}}, 1.0),
        ({"method": "given offset", "offset_s": {"ci95": [7.0, 7.0]}}, None),
        ({"method": "shared event: 6 of 6 changes", "offset_s": {"ci95": [6.8040036, 7.1959964]}}, 0.1),
        ({"method": "shared event: 6 of 6 changes", "offset_s": {"ci95": [7.0, 7.001]}}, 0.05),
    ],
)
def test_how_well_the_clocks_are_known_stands_beside_the_table(
    content: dict[str, Any] | None, expected: float | None, tmp_path: Path
) -> None:
    if content is not None:
        write_json(tmp_path / "sync.json", content)
    found = read_merged(merged(tmp_path)).clock_sigma_s
    assert found is None if expected is None else np.isclose(found or 0.0, expected)


def test_a_sync_file_without_its_interval_is_named(tmp_path: Path) -> None:
    write_json(tmp_path / "sync.json", {"method": "shared event: 6 of 6", "offset_s": 7.0})
    with pytest.raises(InputError, match="no interval"):
        read_merged(merged(tmp_path))
