"""From the files of a run's folder to ``recording.rrd``.

The recording is made in memory and written by this program: Rerun's own thread that writes files ends when the disk is
full, and every later call to it may block for ever.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rerun as rr

from torsight.core.files.paths import AnyPath
from torsight.core.files.results import RunResults, column, read_results
from torsight.core.files.storage import atomic_path
from torsight.core.files.tables import marker_values
from torsight.core.progress import Progress, silent
from torsight.core.series import usual_step
from torsight.core.units import DEG, Floats, Ints
from torsight.core.words.wording import variable_name
from torsight.viewer import view_layout
from torsight.viewer.film_preview import MOST_FRAMES, Preview, write_preview
from torsight.viewer.overlay import Overlay, colour_of, overlay
from torsight.viewer.run_words import half_cycle_begins, run_events, span_s, summary_document

if TYPE_CHECKING:
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
        temporary.write_bytes(recorded(results, preview))
    progress("recording", 1, 1)
    return path


def recorded(results: RunResults, preview: Preview | None) -> bytes:
    """Return the recording of a run's results."""
    # One recording per run: its name is the folder's, so that two runs opened together can be distinguished.
    stream = rr.RecordingStream(view_layout.APPLICATION, recording_id=results.folder.resolve().name)
    memory = stream.memory_recording()
    laws = laws_of(results)
    stream.send_blueprint(view_layout.blueprint(span_s(results), laws=list(laws)))
    view_layout.log_styles(stream)
    log_curves(stream, results)
    log_band(stream, results)
    log_half_cycles(stream, results)
    _log_film(stream, results, preview)
    log_laws(stream, laws)
    _log_words(stream, results)
    return bytes(memory.drain_as_bytes())


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
    record = f", {law.record}" if law.record else ""
    return f"Law: {law.gives}{unit} against {variable_name(law.driver)}{spring}{record}"


def log_laws(stream: rr.RecordingStream, laws: Mapping[str, MeasuredLaw]) -> None:
    """Log every law as bars over its driver; bars at values that the record does not cover are a separate entity."""
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
    document = rr.TextDocument(summary_document(results), media_type=rr.MediaType.MARKDOWN)
    stream.log("summary", document, static=True)
    events = run_events(results)
    if events:
        stream.send_columns(
            "events",
            indexes=[rr.TimeColumn(view_layout.TIME, duration=[event.time_s for event in events])],
            columns=rr.TextLog.columns(text=[event.text for event in events], level=[event.level for event in events]),
        )
