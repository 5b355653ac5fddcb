"""The record on disk while it is made: whole lines at least twice a second, so that a killed program loses no more.

Once it has ended, its tables are written whole, with ``track.json`` and the experiment file that describe it.
"""

from __future__ import annotations

import math
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomli_w

from torsight.core.errors import ConfigError
from torsight.core.files.storage import not_written, read_table, write_json, write_table, write_text
from torsight.core.files.tables import marker_values, write_angles
from torsight.core.optics.camera import Camera
from torsight.core.progress import THOUGHT_S
from torsight.core.tracks import MarkerTracks, StickAngles, marker_columns, mean_sigma, round_covariance
from torsight.core.units import DEG
from torsight.core.words.wording import estimate, fixed, number
from torsight.viewer.live.measure.tracking import LiveTracker, Seen
from tracker.angle.orient import orient
from tracker.angle.plane import Orientation


@dataclass(slots=True)
class Outcome:
    """Statistics of a live record.

    Some frames are ``measured``, some ``dropped`` because too many waited; pictures that the source itself ``missed``
    have no frames, and entries that the viewer did not take in time are ``left_out``. Further values are the range of
    the angle, the model's last estimate of ``tau_c_mnm`` and the number of half-cycles that it has found. Latencies,
    ms, are the times from a frame to its recorded angle, and to its angle logged for the viewers; ``served_first``: the
    system allowed the measuring threads to run before others.
    """

    frames: int = 0
    measured: int = 0
    dropped: int = 0
    missed: int = 0
    left_out: int = 0
    log_rows: int = 0
    low_deg: float = math.inf
    high_deg: float = -math.inf
    friction: dict[str, Any] | None = None
    half_cycles: int = 0
    latency: dict[str, Any] = field(default_factory=dict)
    latency_logged: dict[str, Any] = field(default_factory=dict)
    served_first: bool = False

    @property
    def lost(self) -> str:
        """What the source lost, as the end of a list; empty where it lost nothing."""
        return f", {self.missed} lost by the source" if self.missed else ""

    def settle(self, angles: StickAngles) -> None:
        """Take the finished record's angles, which are also known for the frames before the moving stick was."""
        known_deg = angles.angle_rad[angles.valid] / DEG
        self.measured = len(known_deg)
        if len(known_deg):
            self.low_deg, self.high_deg = float(known_deg.min()), float(known_deg.max())

    def count(self, angle_rad: float, *, dropped: bool, missed: int) -> None:
        """Count one frame; its angle is NaN where it is not known."""
        self.frames += 1
        self.dropped += dropped
        self.missed += missed
        if math.isfinite(angle_rad):
            degrees = angle_rad / DEG
            self.measured += 1
            self.low_deg, self.high_deg = min(self.low_deg, degrees), max(self.high_deg, degrees)


def standing(
    outcome: Outcome,
    *,
    angle_deg: float,
    model_deg: tuple[float, float],
    temperatures: Mapping[str, float],
    latency_ms: float,
    trouble: str,
    markers: str = "",
) -> str:
    """Return the current state of the measurement, in Markdown.

    The values are the last angle of camera and model, measured minus modelled, and the springs' temperatures, °C; NaN
    where not known. ``trouble`` is the reason why the model has no result, ``markers`` a note that the choice of the
    markers is open; both are empty otherwise.
    """
    plain_deg, residual_deg = model_deg
    open_ = [("Markers", markers)] if markers else []
    rows = [
        ("Angle", degrees(angle_deg) or "not known yet"),
        *open_,
        ("Temperatures", "  ".join(f"{name} {value:.1f} °C" for name, value in temperatures.items()) or "none yet"),
        ("Range of motion", degrees(outcome.high_deg - outcome.low_deg) or "none yet"),
        ("Frames", f"{outcome.frames}, {outcome.measured} measured, {outcome.dropped} dropped{outcome.lost}"),
        ("Latency", f"median {number(latency_ms, 2)} ms"),
    ]
    if math.isfinite(plain_deg):
        rows.append(("Plain model", f"{degrees(plain_deg)}, residual {degrees(residual_deg) or 'not known'}"))
        rows.append(("Half-cycles", f"{outcome.half_cycles}"))
    if outcome.friction is not None:
        rows.append(("Friction torque", f"{estimate(outcome.friction)}, plain model"))
    if trouble:
        rows.append(("Model", trouble))
    return "\n".join(["### Live", "", *(f"- **{name}** {words}" for name, words in rows), ""])


def degrees(angle_deg: float) -> str:
    """Return an angle in words; empty where it is not known."""
    return f"{fixed(angle_deg, 1)}°" if math.isfinite(angle_deg) else ""


FLUSH_S: Final = 0.25 * THOUGHT_S
"""Interval at which lines are written: a process that is killed loses less than the last second."""
ANGLE: Final = ("frame", "time_s", "angle_deg", "angle_sigma_deg", "valid", "branch_certain")
EVENTS: Final = ("time_s", "frame", "kind", "text")


class LineFile:
    """A CSV that grows by whole lines; the file must not exist yet."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.path = path
        self._lines: list[str] = [",".join(columns)]
        self._flushed = -math.inf
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise _exists(path) from error
        except OSError as error:
            raise not_written(path, error) from error
        self.flush()

    def add(self, values: Sequence[float]) -> None:
        """Append one row; NaN is an empty field."""
        self.add_line(",".join("" if value != value else f"{value:.10g}" for value in values))  # noqa: PLR0124

    def add_line(self, line: str) -> None:
        """Append one line."""
        self._lines.append(line)

    def flush_due(self) -> None:
        """Flush, if the last flush was a quarter of a second ago."""
        if self._lines and time.monotonic() - self._flushed >= FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Hand all lines to the system, which keeps them even if this program is killed."""
        self._flushed = time.monotonic()
        if not self._lines:
            return
        data = ("\n".join(self._lines) + "\n").encode()
        self._lines.clear()
        try:
            while data:
                data = data[os.write(self._file, data) :]
        except OSError as error:
            raise not_written(self.path, error) from error

    def close(self) -> None:
        """Flush and close."""
        self.flush()
        os.close(self._file)


class Recorder:
    """``angle.csv``, ``markers.csv``, ``temps.csv`` and ``events.csv`` of a live record, in the columns of ``track``.

    A folder that already holds a record is refused; ``in_space`` says whether markers have positions in mm.
    """

    def __init__(self, folder: Path, *, in_space: bool) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise not_written(folder, error) from error
        for name in ("angle.csv", "markers.csv", "temps.csv", "events.csv"):
            if (folder / name).exists():
                raise _exists(folder / name)
        columns = list(
            marker_columns(MarkerTracks.unseen(np.empty(0), (0, 0)), np.empty((0, 4, 3)) if in_space else None)
        )
        self._in_space = in_space
        self._angle = LineFile(folder / "angle.csv", ANGLE)
        self._markers = LineFile(folder / "markers.csv", columns)
        self._events = LineFile(folder / "events.csv", EVENTS)
        self._temperatures: LineFile | None = None

    def frame(self, index: int, time_s: float, seen: Seen) -> None:
        """Append one frame; unknown values are NaN."""
        known = math.isfinite(seen.angle_rad)
        self._angle.add((index, time_s, seen.angle_rad / DEG, seen.sigma_rad / DEG, known, 1))
        row: list[float] = [index, time_s]
        nowhere = np.full(3, np.nan)
        for marker in range(4):
            x, y = seen.position_px[marker].tolist()
            shows = math.isfinite(x)
            sigma = float(mean_sigma(seen.covariance_px2[marker])) if shows else math.nan
            row += [x, y, sigma, shows]
            if self._in_space:
                row += (nowhere if seen.position_mm is None else seen.position_mm[marker]).tolist()
        self._markers.add(row)

    def log(self, header: str, lines: Sequence[str]) -> None:
        """Append lines of the temperature log as they were written, under its own header."""
        if self._temperatures is None:
            self._temperatures = LineFile(self.folder / "temps.csv", [header])
        for line in lines:
            self._temperatures.add_line(line)

    def event(self, time_s: float, frame: int, kind: str, text: str) -> None:
        """Append one event."""
        quoted = text.replace('"', '""')
        self._events.add_line(f'{time_s:.10g},{frame},{kind},"{quoted}"')

    def flush_due(self) -> None:
        """Hand to the system the lines that have waited for a quarter of a second."""
        for file in self._files():
            file.flush_due()

    def close(self) -> None:
        """Close the tables."""
        for file in self._files():
            file.close()

    def _files(self) -> list[LineFile]:
        files = [self._angle, self._markers, self._events]
        return files if self._temperatures is None else [*files, self._temperatures]


def finish(
    folder: Path, *, camera: Camera | None, size_px: tuple[int, int], tracker: LiveTracker, pixel_aspect: float = 1.0
) -> Orientation | None:
    """Orient a finished record as ``torsight track`` would a film, and write its tables whole.

    None where no frame arrived, or no markers were ever seen. By now ``tracker`` knows to which markers the rows belong
    that were written before the motion decided.
    """
    path = folder / "markers.csv"
    if path.read_bytes().count(b"\n") < 2:
        return None
    table = read_table(path, required=("frame", "time_s"))
    values = marker_values(table, "x_px", "y_px", "sigma_px")
    tracker.end(len(values))
    values = tracker.mended(values)
    position = values[..., :2]
    valid = np.asarray(np.isfinite(position).all(axis=2))
    if not valid.all(axis=1).any():
        return None
    tracks = MarkerTracks(
        frame=table["frame"].to_numpy(dtype=np.int64),
        time_s=table["time_s"].to_numpy(dtype=np.float64),
        position_px=position,
        covariance_px2=round_covariance(values[..., 2]),
        valid=valid,
        size_px=size_px,
    )
    tracks, report = tracker.chosen(tracks)
    orientation = orient(tracks, camera, pixel_aspect=pixel_aspect)
    write_table(path, marker_columns(orientation.with_errors(tracks), orientation.position_mm))
    write_angles(folder / "angle.csv", orientation.angles)
    return orientation.with_report(**report)


def _exists(path: Path) -> ConfigError:
    return ConfigError(
        "is there already", where=str(path), do="choose another --out folder; a record is not written over"
    )


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
