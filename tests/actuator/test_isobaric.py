"""The phase laws on loops that another lab measured: strain in place of angle, three stresses predict the fourth."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from torsight.core.series import share_explained

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks" / "actuator"))
import isobaric


@pytest.mark.shared_data
def test_three_stresses_predict_the_fourth(shared_data):
    folder = shared_data / "sma_react" / "isobaric"
    loops = {stress: isobaric.read_loop(folder / f"{stress} MPa.txt") for stress in isobaric.STRESSES_MPA}
    found = isobaric.fit_loops([loop for stress, loop in loops.items() if stress != 150], law="liang_rogers")
    loop = loops[150]
    predicted = isobaric.strain(loop, found.values, law="liang_rogers")
    # A twentieth of the loop's range is what a law with sharp corners can be asked for.
    assert np.sqrt(np.mean((loop.strain_percent - predicted) ** 2)) < 0.06 * np.ptp(loop.strain_percent)
    assert share_explained(loop.strain_percent, predicted) > 0.97
    # Stress raises all temperatures, by some 7 to 13 MPa for each kelvin in NiTi.
    assert 4.0 < found.values["C_M_mpa_per_k"] < 20.0
    assert 4.0 < found.values["C_A_mpa_per_k"] < 25.0
