"""From the files of a run's folder to ``recording.rrd``, written by a process of its own.

Rerun's thread that writes files ends when the disk is full, and every later call to it may block for ever: the next
flush, the next recording, the end of the program. It therefore does not run in the process that holds the results, but
in another one that runs this module. That process takes ``{"folder", "target", "preview"}`` on standard input, the
preview as from :meth:`Preview.to_json` or null; it reports an error by :func:`torsight.viewer.encoding.report`.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.files.paths import AnyPath
from torsight.core.files.results import RunResults, column, read_results
from torsight.core.files.storage import atomic_path
from torsight.core.files.tables import marker_values
from torsight.core.progress import STUCK_S, Progress, silent
from torsight.core.series import usual_step
from torsight.core.units import DEG, Floats, Ints
from torsight.core.words.wording import variable_name
from torsight.viewer import view_layout
from torsight.viewer.encoding import report
from torsight.viewer.film_preview import MOST_FRAMES, Preview, trouble_of, write_preview
from torsight.viewer.overlay import Overlay, colour_of, overlay
from torsight.viewer.run_words import half_cycle_begins, run_events, span_s, summary_document

if TYPE_CHECKING:
    import rerun as rr

    from torsight.discovery.measured_law import MeasuredLaw

CURVES: Final = {
    "angle/measured": ("angle_deg", ("curves", "merged", "angle")),
    "angle/plain": ("plain_deg", ("curves",)),
    "angle/extended": ("extended_deg", ("curves",)),
    "residual/before": ("residual_before_deg", ("curves",)),
    "residual/after": ("residual_after_deg", ("curves",)),
    "temperature/a": ("temp_a_c", ("merged", "curves")),
    "temperature/b": ("temp_b_c", ("merged", "curves")),
}
"""The column of each curve, and the tables that may hold it, in order of preference."""

WRITER: Final = ("-P", "-m", "torsight.viewer.recording")

_END: Final = b"RRF2FOOT"
"""A recording ends with its table of contents, which these letters mark."""


def write_recording(folder: AnyPath, *, film: AnyPath | None = None, progress: Progress = silent) -> Path:
    """Write ``recording.rrd`` from the results that exist in a run's folder.

    Parameters
    ----------
    folder : str or Path
        A run's folder; the panes whose files are missing stay empty.
    film : str or Path, optional
        The film, folder or glob of pictures; without it the markers are drawn on an empty picture.
    progress : Progress
        Called with the amount of the film that is in the recording.

    Returns
    -------
    Path
        The recording, with its arrangement of panes inside.

    Raises
    ------
    InputError
        When the folder is missing or empty, or the film cannot be read.
    OutputError
        When the recording cannot be written.
    """
    folder = Path(folder)
    results = read_results(folder)
    path = folder / "recording.rrd"
    with tempfile.TemporaryDirectory(prefix="torsight-") as scratch, atomic_path(path) as temporary:
        frames, preview = results.first_of("markers", "angle"), None
        if film is not None and frames is not None:
            shrunk = Path(scratch) / "preview.mp4"
            preview = write_preview(Path(film), shrunk, frame_count=len(frames), progress=progress)
        with _whole(temporary):
            run_writer(folder, temporary, preview)
    progress("recording", 1, 1)
    return path


def run_writer(folder: Path, target: Path, preview: Preview | None, *, patience_s: float = STUCK_S) -> None:
    """Let another process write the recording, as long as the file grows."""
    task = {"folder": str(folder), "target": str(target), "preview": None if preview is None else preview.to_json()}
    # The child gets this process's import path, which may not be the default.
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}
    words = [sys.executable, *WRITER]
    with subprocess.Popen(words, env=paths, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as writer:
        try:
            answer, size = None, -1
            given: str | None = json.dumps(task)
            while answer is None:
                try:
                    answer, _ = writer.communicate(given, timeout=patience_s)
                except subprocess.TimeoutExpired as error:
                    given, before, size = None, size, target.stat().st_size if target.exists() else 0
                    if size == before:
                        raise RuntimeError("the writer stands still") from error
        finally:
            writer.kill()
    if writer.returncode != 0:
        raise RuntimeError(f"the recording was not written ({trouble_of(answer) or f'exit code {writer.returncode}'})")


def log_recording(folder: Path, target: Path, preview: Preview | None) -> None:
    """Write a recording in this process; on a full disk the call may never return, or the file lack its end."""
    import rerun as rr

    results = read_results(folder)
    # One recording per run: its name is the folder's, so that two runs opened together can be distinguished.
    stream = rr.RecordingStream(view_layout.APPLICATION, recording_id=folder.resolve().name)
    laws = laws_of(results)
    stream.save(target, default_blueprint=view_layout.blueprint(span_s(results), laws=list(laws)))
    view_layout.log_styles(stream)
    log_curves(stream, results)
    log_band(stream, results)
    log_half_cycles(stream, results)
    _log_film(stream, results, preview)
    log_laws(stream, laws)
    _log_words(stream, results)
    stream.flush()
    stream.disconnect()


@contextlib.contextmanager
def _whole(path: Path) -> Iterator[None]:
    """Refuse a recording that lacks its end: on a full disk the writer stops early, sometimes without an error."""
    full = OSError(errno.ENOSPC, "it was cut off while it was written: is the disk full?")
    try:
        yield
    except RuntimeError as error:
        if "writer" not in str(error):
            raise
        raise full from error
    with path.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - 8 * len(_END), 0))
        if _END not in file.read():
            raise full


def log_curves(stream: rr.RecordingStream, results: RunResults) -> None:
    """Log every curve that the results hold."""
    for entity, (wanted, names) in CURVES.items():
        table = results.first_of(*names, holding=wanted)
        if table is not None and np.isfinite(values := column(table, wanted)).any():
            view_layout.log_series(stream, entity, column(table, "time_s"), values)


def log_band(stream: rr.RecordingStream, results: RunResults) -> None:
    """Log the band of the residual that the measured angle's own error explains."""
    table = results.first_of("curves", "merged", "angle")
    if table is None or "angle_sigma_deg" not in table.columns:
        return
    time_s, sigma_deg = column(table, "time_s"), column(table, "angle_sigma_deg")
    known = np.isfinite(sigma_deg)
    for side, entity in view_layout.BAND.items():
        view_layout.log_series(stream, entity, time_s[known], side * sigma_deg[known])


def laws_of(results: RunResults) -> dict[str, MeasuredLaw]:
    """Return the measured laws of a run by the names that they have in the view, strongest first."""
    if not (results.discovery or {}).get("laws"):
        return {}
    from torsight.discovery.measured_law import read_laws

    return {_law_name(law): law for law in read_laws(results.folder, results.discovery or {})}


def _law_name(law: MeasuredLaw) -> str:
    unit = f" ({law.unit})" if law.unit else ""
    spring = "" if law.spring == "both" else f", spring {law.spring.upper()}"
    return f"Law: {law.gives}{unit} against {variable_name(law.driver)}{spring}"


def log_laws(stream: rr.RecordingStream, laws: Mapping[str, MeasuredLaw]) -> None:
    """Log every law as bars over its driver; bars at values that the record does not cover are a separate entity."""
    import rerun as rr

    for name, law in laws.items():
        known = np.isfinite(law.value) & np.isfinite(law.driver_values)
        step = usual_step(law.driver_values) or 1.0
        for part, rows in (("reached", known & law.covered), ("not_reached", known & ~law.covered)):
            if rows.any():
                bars = rr.BarChart(
                    law.value[rows],
                    abscissa=law.driver_values[rows],
                    widths=np.full(int(rows.sum()), step),
                    color=view_layout.LAW_COLOURS[part],
                )
                stream.log(f"{view_layout.law_entity(name)}/{part}", bars, static=True)


def log_half_cycles(stream: rr.RecordingStream, results: RunResults) -> None:
    """Log the points where half-cycles begin."""
    begins = half_cycle_begins(results)
    if begins:
        times_s, angles_deg = [one.time_s for one in begins], [one.angle_deg for one in begins]
        view_layout.log_series(stream, view_layout.HALF_CYCLE, times_s, angles_deg)


def _log_film(stream: rr.RecordingStream, results: RunResults, preview: Preview | None) -> None:
    import rerun as rr

    table = results.first_of("markers", "angle")
    if table is None:
        return
    time_s = column(table, "time_s")
    if preview is not None:
        chosen = preview.frame
        video = rr.AssetVideo(path=preview.path)
        stream.log("film/picture", video, static=True)
        timestamps = np.asarray(video.read_frame_timestamps_nanos())[: len(chosen)]
        stream.send_columns(
            "film/picture", indexes=times(chosen, time_s), columns=rr.VideoFrameReference.columns_nanos(timestamps)
        )
    else:
        chosen = np.arange(0, len(table), max(1, -(-len(table) // MOST_FRAMES)))
    drawn = overlays(results, chosen, scale=1.0 if preview is None else preview.scale)
    log_overlays(stream, drawn, times(chosen, time_s))


def times(frame: Ints, time_s: Floats) -> list[rr.TimeColumn]:
    """Return both timelines for frames of the film."""
    import rerun as rr

    return [rr.TimeColumn(view_layout.TIME, duration=time_s[frame]), rr.TimeColumn(view_layout.FRAME, sequence=frame)]


def overlays(results: RunResults, frame: Ints, *, scale: float) -> list[Overlay]:
    """Return the overlay of each frame."""
    table = results.markers
    if table is None:
        return []
    position_px = marker_values(table, "x_px", "y_px")
    angle_rad = np.full(len(table), np.nan)
    if results.angle is not None:
        degrees = np.where(column(results.angle, "valid") > 0.5, column(results.angle, "angle_deg"), np.nan)
        rows = min(len(degrees), len(angle_rad))
        angle_rad[:rows] = degrees[:rows] * DEG
    return [overlay(position_px[k], float(angle_rad[k]), scale=scale) for k in frame.tolist()]


def log_overlays(stream: rr.RecordingStream, drawn: Sequence[Overlay], indexes: Sequence[Any]) -> None:
    """Log markers and sticks of many frames at once."""
    import rerun as rr

    points = np.concatenate([one.points_px for one in drawn]) if drawn else np.empty((0, 2))
    if not len(points):
        return
    counts = [len(one.points_px) for one in drawn]
    names = [name for one in drawn for name in one.names]
    columns = rr.Points2D.columns(positions=points, colors=[colour_of(name) for name in names], labels=names)
    stream.send_columns("film/markers", indexes=indexes, columns=columns.partition(counts))
    strips, colours, labels, lengths = [], [], [], []
    for one in drawn:
        lines, kinds, words = one.strokes()
        strips += lines
        colours += kinds
        labels += words
        lengths.append(len(lines))
    columns = rr.LineStrips2D.columns(strips=strips, colors=colours, labels=labels)
    stream.send_columns("film/sticks", indexes=indexes, columns=columns.partition(lengths))
    view_layout.log_sizes(stream)


def _log_words(stream: rr.RecordingStream, results: RunResults) -> None:
    import rerun as rr

    document = rr.TextDocument(summary_document(results), media_type=rr.MediaType.MARKDOWN)
    stream.log("summary", document, static=True)
    events = run_events(results)
    if events:
        stream.send_columns(
            "events",
            indexes=[rr.TimeColumn(view_layout.TIME, duration=[event.time_s for event in events])],
            columns=rr.TextLog.columns(text=[event.text for event in events], level=[event.level for event in events]),
        )


def main() -> int:
    """Write the recording and return the exit code."""
    # Ctrl-C at the terminal is for the parent, which then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    task = json.load(sys.stdin)
    preview = None if task["preview"] is None else Preview.from_json(task["preview"])
    try:
        log_recording(Path(task["folder"]), Path(task["target"]), preview)
    except OSError as error:
        report(error.strerror or f"{type(error).__name__}: {error}", errno=error.errno if error.strerror else None)
        return 1
    except Exception as error:  # noqa: BLE001 - the sender says what it means
        report(f"{type(error).__name__}: {error}", errno=None)
        return 1
    return 0


if __name__ == "__main__":
    # Exit immediately: otherwise Python would wait for Rerun's thread, which may have ended.
    os._exit(main())
