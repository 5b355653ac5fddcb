"""Phase laws and strain analysis against their equations, written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from torsight.actuator.springs import strain_ratio
from torsight.actuator.stepping.phase import COOLING_LAWS, HEATING_LAWS

HEAT = {"start_c": 36.0, "finish_c": 54.0, "influence": 32e6}
COOL = {"start_c": 42.0, "finish_c": 28.0, "influence": 32e6}
STRESS = 320e6  # moves both windows by 10 °C


def test_liang_rogers_at_the_window_and_in_its_middle():
    temps = np.array([45.9, 46.0, 55.0, 64.0, 64.1])
    expected = np.array([0.8, 0.8, 0.4, 0.0, 0.0])
    assert HEATING_LAWS["liang_rogers"](temps, STRESS, xi_0=0.8, **HEAT) == pytest.approx(expected, abs=1e-12)
    temps = np.array([52.1, 52.0, 45.0, 38.0, 37.0])
    expected = np.array([0.2, 0.2, 0.6, 1.0, 1.0])
    assert COOLING_LAWS["liang_rogers"](temps, STRESS, xi_0=0.2, **COOL) == pytest.approx(expected, abs=1e-12)


def test_tanaka_has_one_percent_left_at_the_finish():
    heating = HEATING_LAWS["tanaka"](np.array([40.0, 46.0, 64.0]), STRESS, xi_0=0.8, **HEAT)
    assert heating == pytest.approx([0.8, 0.8, 0.008])
    cooling = COOLING_LAWS["tanaka"](np.array([60.0, 52.0, 38.0]), STRESS, xi_0=0.2, **COOL)
    assert cooling == pytest.approx([0.2, 0.2, 1.0 - 0.008])


@pytest.mark.parametrize("law", ["liang_rogers", "tanaka"])
def test_stress_shifts_a_window_by_its_influence(law):
    temps = np.linspace(30.0, 70.0, 101)
    for laws, window in ((HEATING_LAWS, HEAT), (COOLING_LAWS, COOL)):
        shifted = laws[law](temps + STRESS / 32e6, STRESS, xi_0=0.5, **window)
        assert shifted == pytest.approx(laws[law](temps, 0.0, xi_0=0.5, **window), abs=1e-12)


def test_shear_strain_is_small_beyond_a_hundred_degrees():
    angle = np.radians([100.0, 300.0, 700.0])
    d, length, compression = 0.5e-3, 3 * math.pi * 6.8e-3, 0.5e-3
    ratio = strain_ratio(angle, wire_diameter_m=d, wire_length_m=length, active_coils=3.0, compression_m=compression)
    # (4) over (7): (N0 + θ/2π) π d L_δ / L_s² · 2 L_s / (d θ)
    expected = (3.0 + angle / (2 * math.pi)) * 2 * math.pi * compression / (length * angle)
    assert ratio == pytest.approx(expected)
    assert np.all(np.diff(ratio) < 0)
    assert ratio[0] < 0.1
