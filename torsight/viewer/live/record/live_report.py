"""The files that describe a live record: ``track.json``, ``live.json``, and its experiment file."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from torsight.core.files.storage import write_json, write_text
from torsight.viewer.live.record.outcome import Outcome
from tracker.angle.plane import Orientation


def write_track_account(
    folder: Path,
    *,
    source: Mapping[str, Any],
    outcome: Outcome,
    orientation: Orientation | None,
    events: Sequence[Mapping[str, Any]],
) -> None:
    """Write ``track.json`` of a finished record."""
    frames: dict[str, Any] = {"total": outcome.frames, "dropped": outcome.dropped, "missed": outcome.missed}
    report: Mapping[str, Any] = {}
    if orientation is not None:
        angles, report = orientation.angles, orientation.report
        frames |= {
            "with_angle": int(angles.valid.sum()),
            "without_angle": int((~angles.valid).sum()),
            "turn_uncertain": int(np.sum(~angles.branch_certain & angles.valid)),
        }
    write_json(
        folder / "track.json",
        {
            "source": dict(source),
            "frames": frames,
            **{name: value for name, value in report.items() if name != "noise"},
            "events": list(events),
        },
    )


def write_experiment(
    folder: Path,
    *,
    film: str | None,
    actuator: Path | None,
    offset_s: float | None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> None:
    """Write ``experiment.toml`` into a record's folder, with the actuator's file beside it.

    A played film is named in it; without an actuator a comment says where to put the actuator's values.
    """
    if actuator is not None:
        shutil.copyfile(actuator, folder / "actuator.toml")
    said = {name: dict(entries) for name, entries in (("columns", columns), ("units", units)) if entries}
    content: dict[str, Any] = {
        "angle": {"file": "angle.csv", **({"film": str(Path(film).absolute())} if film else {})},
        "temperature": {"path": "temps.csv", **said},
        "actuator": {"file": "actuator.toml"},
        "output": {"dir": "results"},
        **({} if offset_s is None else {"sync": {"offset_s": offset_s}}),
    }
    head = "# A live record; 'torsight run' continues from it, to the report.\n"
    if actuator is None:
        head += (
            "# The rig's characterised values belong into actuator.toml; 'torsight init' writes some to start from.\n"
        )
    write_text(folder / "experiment.toml", head + tomli_w.dumps(content))
