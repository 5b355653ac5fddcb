"""A record that is small and quick to have."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.core.records import SyncedTable


@pytest.fixture(scope="session")
def half_cycle() -> SyncedTable:
    """One heating and cooling of spring A with a motion by hand: no model made it."""
    time_s = np.arange(0.0, 400.0, 1.0)
    temp_a_c = np.interp(time_s, [0.0, 40.0, 200.0, 260.0], [23.0, 23.0, 85.0, 23.0])
    angle_deg = np.interp(time_s, [0.0, 100.0, 200.0, 210.0, 250.0], [177.0, 177.0, -180.0, -180.0, -150.0])
    return SyncedTable(time_s, np.deg2rad(angle_deg), np.full(400, 1e-3), temp_a_c, np.full(400, 23.0))
