"""Scenes that several tests of the synthetic rig share."""

from __future__ import annotations

from typing import Any

import pytest

from torsight.synthetic.rig.rig_values import REFERENCE, RigValues, rig_values


@pytest.fixture(scope="session")
def reference_values() -> RigValues:
    """Return the reference rig of the quasi-static model."""
    return rig_values({name: value for table in REFERENCE.values() for name, value in table.items()})


@pytest.fixture
def small_scene() -> dict[str, Any]:
    """Return a film of two seconds that is quick to draw."""
    return {
        "seed": 3,
        "motion": {"kind": "sweep", "sweep_deg": 40.0, "period_s": 4.0, "duration_s": 1.0},
        "film": {"fps": 20.0, "codec": "ffv1"},
        "camera": {
            "width_px": 320,
            "height_px": 240,
            "focal_px": 800.0,
            "tilt_deg": 12.0,
            "roll_deg": 5.0,
            "distortion": [-0.1, 0.02, 0.001, -0.001, 0.0],
            "axis_px": [7.0, -4.0],
        },
    }
