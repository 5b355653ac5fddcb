"""Boards to cameras: lenses with uncertainty, stereo pairs, the pose of the rotation axis."""

from __future__ import annotations

from typing import Final

from torsight.core.lazy import lazily

_HOMES: Final = {
    "Board": "board",
    "read_board": "board",
    "Calibration": "stage",
    "calibrate_one": "stage",
    "calibrate_two": "stage",
    "camera_of": "stage",
    "measure_axis": "stage",
    "pose_from_tracks": "circles",
    "draw_board": "printing",
    "usual_board": "printing",
    "write_board": "printing",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
