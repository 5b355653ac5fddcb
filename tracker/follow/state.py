"""The state of the tracker: records that compiled and plain code share, and the arrays that hold them."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracker.appearance.disc import SHAPE
from tracker.appearance.lucas_kanade import Look, unused_look
from tracker.appearance.motion_blur import EXPOSURE
from tracker.follow.rotation_axis import AXIS

KEPT: Final = 2
"""Readings in each marker's history: a speed needs two."""

MARKER: Final = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("lost", "i8"),
        ("below", "i8"),
        ("count", "i8"),
        ("history", "f8", (KEPT, 3)),
        ("light", "f8"),
        ("step", "f8"),
        ("residual", "f8", (2,)),
        ("slope", "f8", (2,)),
        ("change", "f8", (3,)),
        ("first_radius", "f8"),
        ("shape", SHAPE),
    ]
)
"""A marker. x, y: its position, predicted while it is not seen, px. lost: frames since it was read. below: whether it
went below the base and has not been seen since. history: (time_s, x, y) of the last ``count`` readings minus the
picture's shift, the newest last. light, step: running means, grey levels. residual: logarithm of the fit's residual
over the step, running mean and mean deviation. slope: gradient of the light. change: radius and stretch minus those of
``shape``, running means."""

STICK: Final = np.dtype(
    [
        ("length", "f8"),
        ("shortest", "f8"),
        ("longest", "f8"),
        ("size", "f8"),
        ("start_rad", "f8"),
        ("still", "i8"),
        ("axis", AXIS),
    ]
)
"""A stick: distance of its markers in the picture, px, when last seen, and its bounds at the scale of the start; the
picture's scale over that of the start; direction of the stick at the start (y down), or, once it is known to be the
base, when it was last seen with the moving stick elsewhere; whether it is known not to turn; the axis about which it
turns."""

RIG: Final = np.dtype(
    [
        ("moving", "i8"),
        ("above", "i8"),
        ("shift", "f8", (2,)),
        ("shift_now", "f8", (2,)),
        ("unknown", "i8"),
        ("last", "f8", (2, 2)),
        ("step", "f8", (2, 2)),
        ("off", "f8", (2,)),
        ("zero", "f8", (2, 2)),
        ("anchor", "f8", (2,)),
        ("anchored", "i8"),
        ("offset", "f8", (2,)),
        ("offset_known", "i8"),
        ("exposure", EXPOSURE),
    ]
)
"""Both sticks and the camera. moving: index of the stick that moves, −1 while it is not known. above: votes that the
moving stick lies above the base. shift, shift_now: shift of the picture since the start, px, up to the last frame and
measured in this frame; unknown: frames since it was last measured. last: the base's markers in the last frame, px;
step: their motion when they were last seen; off: running means of the squared errors of predicting them at rest, and
going on by the same step. zero: the base's markers at the start. anchor: while the moving stick is not seen (anchored),
the shift when it was last seen. offset: displacement of the moving stick's circles from where the base's shift puts
them, px. exposure: that of the pictures."""


class Scene(NamedTuple):
    """Input of the compiled frame step: the whole state, and the readings of the present frame.

    Inner and outer marker of n sticks, the sticks, the rig (1,), the markers' readings, and their looks (always four,
    see :mod:`tracker.appearance.lucas_kanade`).
    """

    markers: Any
    sticks: Any
    rig: Any
    readings: NDArray[np.void]
    looks: tuple[Look, ...]

    def with_looks(self) -> Scene:
        """Return the same scene with empty looks, for the present windows of its markers.

        Always of four markers: a tuple of another length would be compiled anew.
        """
        looks = [unused_look(float(window_px)) for window_px in self.markers["shape"]["window"]]
        return self._replace(looks=(*looks, *looks[:1] * (4 - len(looks))))


def state_type(sticks: int) -> np.dtype[np.void]:
    """Return the type of the record that holds the whole state, for a number of sticks."""
    return np.dtype([("markers", MARKER, (2 * sticks,)), ("sticks", STICK, (sticks,)), ("rig", RIG, (1,))])
