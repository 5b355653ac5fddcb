"""Phase laws and strain analysis against their equations, written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from torsight.actuator.springs import strain_ratio
from torsight.actuator.stepping.phase import SHARE_DONE

PLACES = np.array([-0.1, 0.0, 0.5, 1.0, 1.1])


def test_liang_rogers_at_the_window_and_in_its_middle():
    assert SHARE_DONE["liang_rogers"](PLACES) == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0], abs=1e-12)


def test_tanaka_has_one_percent_left_at_the_finish():
    assert SHARE_DONE["tanaka"](PLACES[:4]) == pytest.approx([0.0, 0.0, 0.9, 0.99])


def test_shear_strain_is_small_beyond_a_hundred_degrees():
    angle = np.radians([100.0, 300.0, 700.0])
    d, length, compression = 0.5e-3, 3 * math.pi * 6.8e-3, 0.5e-3
    ratio = strain_ratio(angle, wire_diameter_m=d, wire_length_m=length, active_coils=3.0, compression_m=compression)
    # (4) over (7): (N0 + θ/2π) π d L_δ / L_s² · 2 L_s / (d θ)
    expected = (3.0 + angle / (2 * math.pi)) * 2 * math.pi * compression / (length * angle)
    assert ratio == pytest.approx(expected)
    assert np.all(np.diff(ratio) < 0)
    assert ratio[0] < 0.1
