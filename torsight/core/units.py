"""Units: conversions between internal units (SI, radians, °C) and those of files (degrees, mN·m, mm, GPa, MPa).

Also the types of arrays by their elements.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

DEG: Final = math.pi / 180.0
"""Radians per degree: ``angle_rad = angle_deg * DEG``."""
_KILO: Final = 1e3
"""Ratio of successive SI prefixes."""
MNM: Final = 1.0 / _KILO
"""N·m per mN·m."""
MM: Final = 1.0 / _KILO
"""Metres per millimetre."""
GPA: Final = _KILO**3
"""Pascals per gigapascal."""
MPA: Final = _KILO**2
"""Pascals per megapascal."""
PPM: Final = 1.0 / _KILO**2
"""Parts per million as a plain ratio."""

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]
