"""The record of every frame while a film is tracked, before any evaluation."""

from __future__ import annotations

from typing import Final

import numpy as np

ROW: Final = np.dtype(
    [
        ("time_s", "<f8"),
        ("level", "<f4"),
        ("position_px", "<f8", (4, 2)),
        ("covariance_px2", "<f8", (4, 3)),
        ("light", "<f4", (4,)),
        ("step", "<f4", (4,)),
        ("residual", "<f4", (4,)),
        ("state", "u1", (4,)),
    ]
)
"""One frame. ``level`` is the mean grey level of the picture, 0 where it was not read; ``covariance_px2`` holds xx, xy,
yy for white noise of the size of the fit's residual."""

STATES: Final = ("seen", "hidden", "shadowed", "dark", "outside", "lost", "damaged")
"""States of a marker in a frame; ``state`` holds the index.

hidden: something lies over the marker. shadowed: the other stick is so close that its reading is not trusted. dark: the
light is off. outside: the marker left the picture. lost: it was not found. damaged: the frame was not decoded whole.
"""
CODE: Final = {name: index for index, name in enumerate(STATES)}
SEEN, HIDDEN, SHADOWED, DARK, OUTSIDE, LOST, DAMAGED = range(len(STATES))
