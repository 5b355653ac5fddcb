"""Clocks that a shared event has put together: an offset between them is no longer an explanation at hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.cli.clock_known import clock_sigma_s
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
    free, known = (ActuatorProblem(drive, spec, clock_sigma_s=sigma_s) for sigma_s in (None, 0.05))
    assert "clock_offset" in [candidate.id for candidate in free.candidates]
    assert "clock_offset" not in [candidate.id for candidate in known.candidates]
    weights = [information(Stretches.of(p), Scales(0.1, 0.1, 4.0), p.sigma) for p in (free, known)]
    fits = [
        Fitter(free, weights[0]).extend(Fitter(free, weights[0]).base(), "clock_offset"),
        Fitter(known, weights[1]).base(),
    ]
    # More than half of the lag; the start of either spring, free within 10°, takes up a part of the rest.
    offset_s = [abs(fit.values["clock_offset_s"]) for fit in fits]
    assert offset_s[0] > 1.5
    assert offset_s[1] < 0.5 * offset_s[0]
    assert fits[1].cost > fits[0].cost + Settings().apart


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, None),
        ({"method": "motion against temperature: 4 of 4 strokes", "offset_s": {"ci95": [5.0400360, 8.9599640]}}, 1.0),
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
    found = clock_sigma_s(tmp_path / "merged.csv")
    assert found is None if expected is None else np.isclose(found or 0.0, expected)


def test_a_sync_file_without_its_interval_is_named(tmp_path: Path) -> None:
    write_json(tmp_path / "sync.json", {"method": "shared event: 6 of 6", "offset_s": 7.0})
    with pytest.raises(InputError, match="no interval"):
        clock_sigma_s(tmp_path / "merged.csv")
