"""How far a hidden effect shows in a record at all, independent of discovery.

An effect may move the angle by degrees and still leave nothing: the characterised values, within what is known of them,
and what else is hidden take it up. So the rig is run once more with each of those a little off, and what no such change
imitates is what shows. The rig alone is asked, neither the model under test nor its engine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROW_SIGMA_DEG: Final = 1.0
"""What a row at four per second tells of a value, against the value's prior: errors of 0.1° that last 25 s."""
_STEP: Final = 0.2
"""Share of a standard deviation, or of a strength, by which the rig is off."""


def shown(
    angle_deg: Callable[[Mapping[str, float], Sequence[float]], Array], spread: Mapping[str, float], count: int
) -> list[float]:
    """Return by how much each of several hidden pieces shows, ° root mean square.

    Parameters
    ----------
    angle_deg : callable
        The angle (n,) of a rig whose values are off by so much, with such a share of each piece's strength acting.
    spread : mapping of str to float
        One standard deviation of each value that is not exact.
    count : int
        Number of pieces.
    """
    ones = np.ones(count)
    whole = angle_deg({}, ones.tolist())
    # Nobody knows the zero of the sticks, nor the strength of an effect.
    zero = np.full(len(whole), 1e3)
    values = [(angle_deg({name: _STEP * sigma}, ones.tolist()) - whole) / _STEP for name, sigma in spread.items()]
    each = np.eye(count)
    weaker = [(angle_deg({}, (ones - _STEP * each[i]).tolist()) - whole) / _STEP for i in range(count)]
    found = []
    for i in range(count):
        change = angle_deg({}, (ones - each[i]).tolist()) - whole
        found.append(left_over(change, [zero, *values, *(column for k, column in enumerate(weaker) if k != i)]))
    return found


def left_over(change_deg: Array, imitations_deg: Sequence[Array]) -> float:
    """Return what is left of a change (n,), root mean square, once imitations have taken up what they can.

    Each imitation (n,) is what a value changes per standard deviation of what is known of it.
    """
    columns = np.column_stack(imitations_deg)
    normal = columns.T @ columns / _ROW_SIGMA_DEG**2 + np.eye(columns.shape[1])
    taken = columns @ np.linalg.solve(normal, columns.T @ change_deg / _ROW_SIGMA_DEG**2)
    return float(np.sqrt(np.mean((change_deg - taken) ** 2)))
