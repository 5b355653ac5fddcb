"""The first reading of a marker."""

from __future__ import annotations

import numpy as np

from tests.tracker.test_track import SLOW
from tracker.detect.dots import find_and_refuse
from tracker.follow.marker import Marker


def test_a_reading_of_texture_ends_near_its_start_or_is_none() -> None:
    rng = np.random.default_rng(4)
    dot = find_and_refuse(next(SLOW.pictures()))[0][0]
    texture = rng.normal(110.0, 12.0, (240, 320)).clip(0.0, 255.0).astype(np.uint8)
    marker, found = Marker(dot), 0
    for x, y in rng.uniform((20.0, 20.0), (300.0, 220.0), (300, 2)).tolist():
        reading = marker.read(texture, x, y)
        found += reading is not None
        assert reading is None or np.hypot(reading["x"] - x, reading["y"] - y) < dot.radius_px
    assert found < 300
