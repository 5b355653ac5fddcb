"""Phase laws: the completed share of a transformation at a place in its window, 0 at its start and 1 at its end.

Liang–Rogers (cosine) and Tanaka (exponential). With the initial fraction ξ0 and windows that stress shifts by σ / C
these are (13), ξ = ξ0 (1 − done), and (14), ξ = ξ0 + (1 − ξ0) done. The stepping rule ensures that a transformation
only advances while its direction is unchanged.

Tanaka's exponents are written so that 1 % remains at the end of a window: a = ln 100 / window, b = a / C.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from torsight.core.units import Floats

LN_100: Final = math.log(100.0)
PLACES: Final = np.linspace(-1.0, 2.0, 1201)
"""Places of the tables of leads (of a transformation over its law), up to a whole window beyond both ends; all tables
have this number of nodes."""


def _liang_rogers(place: Floats) -> Floats:
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(place, 0.0, 1.0)))


def _tanaka(place: Floats) -> Floats:
    return np.asarray(1.0 - np.exp(-LN_100 * np.maximum(0.0, place)))


SHARE_DONE: Final[Mapping[str, Callable[[Floats], Floats]]] = {"liang_rogers": _liang_rogers, "tanaka": _tanaka}
"""The completed share by each law as a function of the place; zero before the window."""
