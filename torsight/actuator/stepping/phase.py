"""Phase laws: the martensite fraction ξ at a temperature and a stress.

Liang–Rogers (cosine, (13) and (14)) and Tanaka (exponential). ξ0 is the fraction at which this transformation started.
Outside the window ξ holds (before it) or, for Liang–Rogers, is complete (past it). These are the laws themselves;
that a transformation only advances while its direction is unchanged belongs to the stepping rule.

Tanaka's exponents are written so that ξ falls to 1 % of its start at A_f while heating, and all but 1 % of the
austenite is gone at M_f while cooling: a = ln 100 / window, b = a / C.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Law = Callable[..., Array]

_DECAY: Final = math.log(100.0)


def liang_rogers_heating(
    temperature_c: Array, stress_pa: Array | float, *, start_c: float, finish_c: float, influence: float, xi_0: float
) -> Array:
    """Return ξ while heating (13); ``start_c`` = A_s, ``finish_c`` = A_f, ``influence`` = C_A in Pa/K."""
    share = np.clip((temperature_c - start_c - stress_pa / influence) / (finish_c - start_c), 0.0, 1.0)
    return 0.5 * xi_0 * (np.cos(np.pi * share) + 1.0)


def liang_rogers_cooling(
    temperature_c: Array, stress_pa: Array | float, *, start_c: float, finish_c: float, influence: float, xi_0: float
) -> Array:
    """Return ξ while cooling (14); ``start_c`` = M_s, ``finish_c`` = M_f, ``influence`` = C_M in Pa/K."""
    share = np.clip((temperature_c - finish_c - stress_pa / influence) / (start_c - finish_c), 0.0, 1.0)
    return 0.5 * (1.0 - xi_0) * np.cos(np.pi * share) + 0.5 * (1.0 + xi_0)


def tanaka_heating(
    temperature_c: Array, stress_pa: Array | float, *, start_c: float, finish_c: float, influence: float, xi_0: float
) -> Array:
    """Return ξ = ξ0 exp[a_A (A_s − T) + b_A σ] past the start, ξ0 before it."""
    rate = _DECAY / (finish_c - start_c)
    return xi_0 * np.exp(-rate * np.maximum(0.0, temperature_c - start_c - stress_pa / influence))


def tanaka_cooling(
    temperature_c: Array, stress_pa: Array | float, *, start_c: float, finish_c: float, influence: float, xi_0: float
) -> Array:
    """Return ξ = 1 − (1 − ξ0) exp[−a_M (M_s − T) − b_M σ] past the start, ξ0 before it."""
    rate = _DECAY / (start_c - finish_c)
    return 1.0 - (1.0 - xi_0) * np.exp(-rate * np.maximum(0.0, start_c + stress_pa / influence - temperature_c))


HEATING_LAWS: Final[dict[str, Law]] = {"liang_rogers": liang_rogers_heating, "tanaka": tanaka_heating}
COOLING_LAWS: Final[dict[str, Law]] = {"liang_rogers": liang_rogers_cooling, "tanaka": tanaka_cooling}
