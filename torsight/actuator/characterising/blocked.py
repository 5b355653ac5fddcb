# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
"""The blocked spring, compiled: its force, whose stress in turn shifts the transformation that causes the force."""

from __future__ import annotations

import numpy as np

from torsight.actuator.stepping.kernel_laws import ROUNDED
from torsight.actuator.stepping.kernel_roots import tightened
from torsight.core.compiled import compiled, inlined
from torsight.core.units import Floats


@inlined
def _law_less(xi: float, above_c: float, width_c: float, e_a: float, e_m: float, shift: float) -> float:
    """Return the fraction by the phase law at the stress for ξ, minus ξ; this difference falls as ξ grows."""
    place = (above_c - shift * (e_a + xi * (e_m - e_a)) * (1.0 - xi)) / width_c
    if place <= 0.0:
        return 1.0 - xi
    return -xi if place >= 1.0 else 0.5 * (np.cos(np.pi * place) + 1.0) - xi


@compiled
def blocked_modulus(temp_c: Floats, low_c: float, width_c: float, e_a: float, e_m: float, shift: float) -> Floats:
    """Return E(ξ) (1 − ξ) in GPa at temperatures (n,), with ξ consistent with the stress that it causes.

    From full martensite (13) and from full austenite (14) are the same cosine over their windows. More martensite means
    less force, less stress, and so (by the law) less martensite: one root in [0, 1], bracketed (Anderson–Björck).

    The window without stress begins at ``low_c``: A_s while heating, M_f while cooling; moduli are in GPa, and
    ``shift`` is the shift of the window, °C per GPa of E(ξ) (1 − ξ).
    """
    out = np.empty_like(temp_c)
    for k in range(temp_c.size):
        above_c = temp_c[k] - low_c
        a, fa = 0.0, _law_less(0.0, above_c, width_c, e_a, e_m, shift)
        b, fb = 1.0, _law_less(1.0, above_c, width_c, e_a, e_m, shift)
        if fa <= 0.0:
            b = 0.0
        elif fb < 0.0:
            for _ in range(80):
                x = b - fb * (b - a) / (fb - fa)
                fx = _law_less(x, above_c, width_c, e_a, e_m, shift)
                a, fa, b, fb = tightened(a, fa, b, fb, x, fx)
                if abs(fb) < ROUNDED or abs(b - a) < ROUNDED or fa == fb:
                    break
        out[k] = (e_a + b * (e_m - e_a)) * (1.0 - b)
    return out
