"""How far something hidden in a record shows at all, whatever discovery makes of it.

An effect may move the angle by degrees and still leave nothing: the characterised values, within what is known of them,
and what else is hidden take it up. So the rig is run once more with each of those a little off, and what no such change
imitates is what shows. The rig alone is asked, neither the model under test nor its engine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROW_SIGMA_DEG = 1.0
"""What a row at four per second tells of a value, against the value's prior: errors of 0.1° that last 25 s."""


def shown_deg(change_deg: Array, imitations_deg: Sequence[Array]) -> float:
    """Return what is left of a change, root mean square, once imitations have taken up what they can.

    Parameters
    ----------
    change_deg : (n,) float64
        What the hidden piece changes in the angle, evenly over the record's time.
    imitations_deg : sequence of (n,) float64
        What each value changes per standard deviation of what is known of it.
    """
    columns = np.column_stack(imitations_deg)
    normal = columns.T @ columns / ROW_SIGMA_DEG**2 + np.eye(columns.shape[1])
    taken = columns @ np.linalg.solve(normal, columns.T @ change_deg / ROW_SIGMA_DEG**2)
    return float(np.sqrt(np.mean((change_deg - taken) ** 2)))
