"""How long what a series holds lasts: its integrated correlation time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from torsight.core.units import Floats


def correlation_time(pieces: Sequence[Floats]) -> float:
    """Return the integrated correlation time τ = 1 + 2 Σ ρ_k of a residual, in samples (at least 1: independent).

    The autocorrelation is pooled over the pieces (each recorded in one go) and taken about zero, since a model's error
    has no business having a mean; the sum is cut at the first window that is five times its own result (Sokal's rule,
    in Functional Integration, NATO ASI B 361 (1997) 131). Pieces of fewer than four samples do not count.
    """
    used = [piece for piece in pieces if len(piece) >= 4]
    if not used:
        return 1.0
    longest = max(len(piece) for piece in used)
    size = 1 << (2 * longest - 1).bit_length()
    power = np.zeros(size // 2 + 1)
    pairs = np.zeros(longest)
    for piece in used:
        power += np.abs(np.fft.rfft(piece, size)) ** 2
        pairs[: len(piece)] += np.arange(len(piece), 0, -1)
    product = np.fft.irfft(power, size)[:longest]
    if product[0] <= 0.0:
        return 1.0
    rho = (product / pairs) / (product[0] / pairs[0])
    tau = 1.0 + 2.0 * np.cumsum(rho[1:])
    window = np.flatnonzero(np.arange(1, longest) >= 5.0 * tau)
    return float(max(1.0, tau[window[0]] if len(window) else tau.max(initial=1.0)))
