"""Numbers by which frames are judged, shared by the plain and the compiled way of following."""

from __future__ import annotations

import math
from typing import Final

KEPT: Final = 4
"""Readings that are kept of each marker, to predict from."""
RATE: Final = 0.1
"""Share of the new in averages of shape, light and misses."""
LIGHT_RATE: Final = 0.1
STALE: Final = 15
"""Frames for which a lost marker is still carried on along its last motion."""
GAUGE_RATE: Final = 0.03
NEVER: Final = 0.3
"""A residual above this share of the step is not of a dot."""
ALWAYS: Final = 0.015
"""A residual below this share of the step hides nothing."""
LEAST_STEP: Final = 4.0
"""Grey levels below which there is no dot to be seen."""
DARK: Final = 0.4
"""Share of the usual brightness of the picture below which the light is off."""
SPARSE: Final = 16
"""Every so many pixels along x and y are looked at for the brightness."""
SHARP_PX: Final = 1.5
"""Speed, or smear, per frame up to which a marker shows its shape."""
SLACK_UNKNOWN: Final = 0.1
SLACK_KNOWN: Final = 0.015
"""Allowance for smear, before and after the shutter is known: share of the step, per root of the speed in px."""
CHANGE_PX: Final = 0.15
"""Change of a rim's place from which a template is rendered anew."""
MOST_STRETCH: Final = 0.45
JUMP_PX: Final = 8.0
"""How far the base may jump between two frames when both of its markers agree."""
ALONE_PX: Final = 5.0
"""The same for one marker whose partner is not seen."""
APART_PX: Final = 2.5
"""By how much the jumps of both may differ."""
TURN_RAD: Final = math.radians(2.0)
"""How far a bumped camera may turn the base."""
CLOSE: Final = 0.6
"""Distance from a base dot, in radii, below which dots cannot be told apart."""
NEAR: Final = 1.6
"""The same after a gap, and where a dot is to show which stick is above."""
OWN_RAD: Final = math.radians(1.0)
"""Turn against the base from which both dots of the moving stick cannot be the base's."""
OWN_PX: Final = 0.6
"""How far its dots may be off their circles, one against the other, and still both be its own."""
VOTES: Final = 2
MOST_VOTES: Final = 20
"""Votes from which it counts as known which stick is above, and most that are kept."""
AXIS_STEP_RAD: Final = math.radians(3.0)
"""How far the stick has to turn before another frame tells something new of the axis."""
AXIS_ENOUGH: Final = 12
"""Frames that are taken in of each ten degrees."""
SHAKE_PX: Final = 12.0
"""Most that the picture is taken to shift while only the moving stick tells it."""
