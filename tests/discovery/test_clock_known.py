"""Clocks that a shared event has put together: an offset between them is no longer an explanation at hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.cli.discover import _clock_sigma_s
from torsight.core.errors import InputError
from torsight.core.files.storage import write_json
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.fitting import Fitter
from torsight.discovery.inference.noise import Scales, Stretches, information
from torsight.discovery.settings import Settings
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from


def test_a_late_sensor_is_not_taken_for_clocks_that_are_known_to_agree() -> None:
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    half_cycles = [{"spring": s, "peak_c": 75.0, "ramp_s": 300.0, "heat_s": 320.0, "cool_s": 250.0} for s in "ab"]
    scene = {
        "motion": {"kind": "rig"},
        "protocol": {"half_cycle": half_cycles},
        "effects": {"sensor_lag": {"lag_s": 3.0}},
    }
    drive = ActuatorModel(spec).prepare(make_record(scene, seed=5, sigma_deg=0.15).table)
    cost, offset_s = {}, {}
    for sigma_s in (None, 0.05):
        problem = ActuatorProblem(drive, spec, clock_sigma_s=sigma_s)
        fitter = Fitter(problem, information(Stretches.of(problem), Scales(0.1, 0.1, 4.0), problem.sigma))
        fit = fitter.extend(fitter.base(), "clock_offset")
        cost[sigma_s], offset_s[sigma_s] = fit.cost, fit.values["clock_offset_s"]
    # More than half of the lag; the start of either spring, free within 10°, takes up a part of the rest.
    assert abs(offset_s[None]) > 1.5
    assert abs(offset_s[0.05]) < 0.5 * abs(offset_s[None])
    assert cost[0.05] > cost[None] + Settings().apart


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, None),
        ({"method": "motion against temperature: 4 of 4 strokes", "offset_s": {"ci95": [6.9, 7.1]}}, None),
        ({"method": "given offset", "offset_s": {"ci95": [7.0, 7.0]}}, None),
        ({"method": "shared event: 6 of 6 changes", "offset_s": {"ci95": [6.8040036, 7.1959964]}}, 0.1),
        ({"method": "shared event: 6 of 6 changes", "offset_s": {"ci95": [7.0, 7.001]}}, 0.05),
    ],
)
def test_only_a_shared_event_tells_the_clocks(
    content: dict[str, Any] | None, expected: float | None, tmp_path: Path
) -> None:
    if content is not None:
        write_json(tmp_path / "sync.json", content)
    found = _clock_sigma_s(tmp_path / "merged.csv")
    assert found is None if expected is None else np.isclose(found or 0.0, expected)


def test_a_sync_file_without_its_interval_is_named(tmp_path: Path) -> None:
    write_json(tmp_path / "sync.json", {"method": "shared event: 6 of 6", "offset_s": 7.0})
    with pytest.raises(InputError, match="no interval"):
        _clock_sigma_s(tmp_path / "merged.csv")
