"""Where what stands in the arrays of :mod:`tracker.swift`."""

from __future__ import annotations

from typing import Final

# Of a marker: place, frames lost, readings kept, (time, x, y) of four readings, misses of four ways to predict, gauge
# (light, step, residual, its spread, patch, its spread), slopes of the light, change of shape (3), radius now and in
# the first frame.
AT_X, AT_Y, LOST, COUNT, HISTORY = 0, 1, 2, 3, 4
MISSES, GAUGE, SLOPE, CHANGE = 16, 20, 26, 28
OWN_RADIUS, FIRST_RADIUS = 31, 32
MARKER_FIELDS: Final = 33

# What is common: shift of the picture, places of the base at the start, its directions at the start and now, lengths of
# both sticks, brightness, votes for the moving stick being above.
SHIFT, ZERO, REFERENCE, LAST, LENGTH = 0, 2, 6, 7, 8
BRIGHTNESS, ABOVE = 10, 11
# The shutter (share, whether known, fast readings, how often to look), which stick moves.
SHARE, SHUTTER_KNOWN, FAST, EVERY, MOVING = 12, 13, 14, 15, 16
# Offset of the circles (whether known, x, y), axis (whether known, six values, direction at which it was learned last).
OFFSET, AXIS, AXIS_LAST = 17, 20, 27
# Shortest and longest that either stick has been in the picture.
RANGE: Final = 28
COMMON_FIELDS: Final = 32

# What the caller of the kernel has to look at: either moving marker for the shutter, and the axis.
LOOK_INNER, LOOK_OUTER, LOOK_AXIS = 1, 2, 4
UNUSUAL: Final = -1
