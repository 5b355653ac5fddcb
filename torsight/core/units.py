"""Conversions between the inside (SI, radians, °C) and the edges (degrees, mN·m, mm, GPa, MPa)."""

from __future__ import annotations

import math
from typing import Final

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
