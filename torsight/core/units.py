"""What numbers are in: conversions between the inside (SI, radians, °C) and the edges (degrees, mN·m, mm, GPa, MPa).

And the types of arrays, by what they hold.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

DEG: Final = math.pi / 180.0
"""Radians per degree: ``angle_rad = angle_deg * DEG``."""
MNM: Final = 1e-3
"""N·m per mN·m."""
MM: Final = 1e-3
"""Metres per millimetre."""
GPA: Final = 1e9
"""Pascals per gigapascal."""
MPA: Final = 1e6
"""Pascals per megapascal."""
PPM: Final = 1e-6
"""Parts per million as a plain ratio."""

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]
