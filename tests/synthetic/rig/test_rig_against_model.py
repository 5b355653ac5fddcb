"""The rig and the model that is fitted are two programs: with the same values, without noise, they tell one story."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec
from torsight.core.units import DEG
from torsight.synthetic.experiment import make_record

FULL = [{"spring": "a", "peak_c": 86.0}, {"spring": "b", "peak_c": 86.0}]
PARTIAL = [
    {"spring": "a", "peak_c": 66.0, "ramp_s": 300.0},
    {"spring": "b", "peak_c": 70.0, "ramp_s": 560.0},
    {"spring": "a", "points": [[0.0, 24.0], [200.0, 62.0], [300.0, 62.0], [450.0, 82.0]]},
]
# Led down while it is switched on: to the cold, and twice in the middle of its way up.
LED = [
    {"spring": "a", "points": [[400.0, 74.0], [420.0, 74.0], [900.0, 36.0]], "heat_s": 910.0},
    {
        "spring": "b",
        "points": [[300.0, 61.0], [500.0, 50.0], [700.0, 60.0], [900.0, 45.0], [1300.0, 78.0]],
        "heat_s": 1310.0,
    },
    *FULL,
]


@pytest.mark.parametrize(
    ("half_cycles", "true"),
    [
        (FULL, {}),
        ([*FULL, *PARTIAL], {}),
        (LED, {}),
        (FULL, {"tau_c_mnm": 2.2}),
        (FULL, {"E_A_gpa": 50.0, "M_s_c": 44.0}),
    ],
)
def test_rig_and_model_agree(half_cycles: list, true: dict) -> None:
    record = make_record(
        {
            "protocol": {"half_cycle": half_cycles},
            "rig": {"as_declared": True, "true": true},
            "sensor": {"noise_c": 0.0, "quantum_c": 0.0},
            "mechanics": {"inertia_kg_m2": 1e-10, "presliding_deg": 0.005},
        },
        sigma_deg=0.0005,
    )
    model = ActuatorModel(ActuatorSpec(record.played.scene.values.public))
    drive = model.prepare(record.table)
    found = model.simulate(drive, model.nominal())
    angle_rad = np.interp(drive.time_s, record.table.time_s, record.angle_rad)
    # Both follow the same equations: left over are the friction's deflection and the finite rate (0.11 °C/s in steps
    # of 15 ms, 26 °/°C: 0.04°).
    assert np.sqrt(np.mean((found.angle_rad - angle_rad) ** 2)) < 0.04 * DEG
