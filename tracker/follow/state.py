"""What is known while a film is followed: records that compiled and plain code share, and the arrays that hold them."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.disc import SHAPE
from tracker.appearance.lucas_kanade import Look
from tracker.appearance.motion_blur import SHARES
from tracker.follow.rotation_axis import AXIS

KEPT: Final = 4
"""Readings that are kept of each marker: a parabola takes three, the mean speed over three steps four."""

MARKER: Final = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("lost", "i8"),
        ("below", "i8"),
        ("count", "i8"),
        ("history", "f8", (KEPT, 3)),
        ("miss", "f8", (4,)),
        ("light", "f8"),
        ("step", "f8"),
        ("residual", "f8", (2,)),
        ("patch", "f8", (2,)),
        ("slope", "f8", (2,)),
        ("change", "f8", (3,)),
        ("first_radius", "f8"),
        ("shape", SHAPE),
    ]
)
"""A marker. x, y: where it is, or is taken to be while it is not seen, px. lost: frames since it was read. below:
whether it went below the base and was not seen since. history: (time_s, x, y) of the last ``count`` readings less the
shift of the camera, the newest last. miss: running mean square errors of the ways to predict it, px². light, step:
running means, grey levels. residual, patch: of the fit, logarithms of their share of the step, running mean and mean
deviation. slope: of the light. change: of radius and stretch against ``shape``, running means."""

STICK: Final = np.dtype(
    [("length", "f8"), ("shortest", "f8"), ("longest", "f8"), ("start_rad", "f8"), ("still", "i8"), ("axis", AXIS)]
)
"""A stick: distance of its markers in the picture, px, now and within which bounds so far; its direction at the start
(y down), or as it stands once it is known to be the base; whether it is known not to turn; and the axis about which it
turns."""

RIG: Final = np.dtype(
    [
        ("moving", "i8"),
        ("above", "i8"),
        ("shift", "f8", (2,)),
        ("shift_now", "f8", (2,)),
        ("unknown", "i8"),
        ("zero", "f8", (2, 2)),
        ("last_rad", "f8"),
        ("anchor", "f8", (2,)),
        ("anchored", "i8"),
        ("offset", "f8", (2,)),
        ("offset_known", "i8"),
        ("shutter_share", "f8"),
        ("shutter_cost", "f8", (len(SHARES),)),
        ("shutter_looks", "f8"),
        ("fast", "i8"),
    ]
)
"""Both sticks and the camera. moving: which stick moves, −1 while that is not known. above: votes that the moving stick
lies above the base. shift: of the picture
since the start, px, and as this frame tells it; unknown: frames since it was last told. zero: the base's markers at the
start. last_rad: direction of the base when last seen. anchor: the shift when the
moving stick was last seen, while it is not. offset: how far the moving stick's circles are off where the base says.
The rest is for :mod:`tracker.appearance.motion_blur`."""


class Scene(NamedTuple):
    """What the compiled frame step works on: all of the state, and the readings of the frame at hand.

    Inner and outer marker of n sticks, the sticks, the rig (1,), the markers' readings, and their looks (always four,
    see :mod:`tracker.appearance.lucas_kanade`).
    """

    markers: Any
    sticks: Any
    rig: Any
    readings: NDArray[np.void]
    looks: tuple[Look, ...]


def state_type(sticks: int) -> np.dtype[np.void]:
    """Return the type of one record that holds all of the state, for a number of sticks."""
    return np.dtype([("markers", MARKER, (2 * sticks,)), ("sticks", STICK, (sticks,)), ("rig", RIG, (1,))])
