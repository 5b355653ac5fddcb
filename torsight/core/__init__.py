"""Frozen objects that cross the stages, errors, storage and provenance."""

from __future__ import annotations

from typing import Final

from torsight.core.lazy import lazily

_HOMES: Final = {
    "ClockMap": "records",
    "SyncedTable": "records",
    "TemperatureLog": "records",
    "MARKERS": "tracks",
    "MarkerTracks": "tracks",
    "StickAngles": "tracks",
    "Camera": "optics.camera",
    "read_camera": "optics.camera",
    "Estimate": "parameter",
    "Parameter": "parameter",
    "ConfigError": "errors",
    "InputError": "errors",
    "NoResultError": "errors",
    "OutputError": "errors",
    "TorsightError": "errors",
    "read_angles": "files.tables",
    "read_merged": "files.tables",
    "write_angles": "files.tables",
    "write_merged": "files.tables",
    "RunResults": "files.results",
    "read_results": "files.results",
    "Progress": "progress",
    "DEG": "units",
    "GPA": "units",
    "MM": "units",
    "MNM": "units",
    "MPA": "units",
}

__getattr__, __dir__ = lazily(__name__, _HOMES)
