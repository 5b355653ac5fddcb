"""A film's markers from the first frame to the last."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.progress import Progress, silent
from torsight.core.tracks import MarkerTracks
from tracker.follow import Follower
from tracker.hints import MarkerHints
from tracker.rows import CODE, ROW
from tracker.source import FrameSource
from tracker.start import Start, find_start


@dataclass(frozen=True, slots=True, eq=False)
class TrackResult:
    """The markers of one film.

    Attributes
    ----------
    tracks : MarkerTracks
        Positions, order of :data:`torsight.core.tracks.MARKERS`.
    rows : (n,) structured
        What was noted of every frame, same order of markers (see :mod:`tracker.rows`).
    events : list of dict
        What happened, in the order of time.
    report : dict
        For ``track.json``.
    """

    tracks: MarkerTracks
    rows: NDArray[np.void]
    events: list[dict[str, Any]] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)


def track_film(
    source: FrameSource,
    *,
    markers: MarkerHints | None = None,
    out: Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> TrackResult:
    """Follow the four markers through a film.

    Parameters
    ----------
    source : FrameSource
        See :func:`tracker.source.open_source`.
    markers : MarkerHints, optional
        Positions in the first frame; found without help otherwise.
    out : Path, optional
        Folder for checkpoints; none are written without it.
    resume : bool
        Go on from the last checkpoint in ``out``.
    progress : Progress
        Where to report.

    Raises
    ------
    ConfigError, InputError, NoResultError
        See :func:`tracker.start.find_start`.
    """
    cv2.setNumThreads(1)
    start = find_start(source, markers)
    follower = Follower(start.markers, moving=start.moving)
    rows = []
    total = source.frame_count
    for frame in source:
        if frame.index < start.frame:
            rows.append(_unseen(frame.time_s))
        else:
            rows.append(follower.step(frame))
        if frame.index % 100 == 0:
            progress("tracking", frame.index, total)
    progress("tracking", len(rows), len(rows))
    table = np.array(rows, dtype=ROW)
    return _result(table, start, follower, source)


def _unseen(time_s: float) -> NDArray[np.void]:
    row = np.zeros((), ROW)
    row["time_s"] = time_s
    row["position_px"] = row["covariance_px2"] = np.nan
    row["state"] = CODE["lost"]
    return row


def _result(table: NDArray[np.void], start: Start, follower: Follower, source: FrameSource) -> TrackResult:
    if follower.moving is None:
        from torsight.core.errors import NoResultError

        raise NoResultError(
            "no stick moves, so the moving one cannot be told from the base",
            where=str(getattr(source, "name", "film")),
            do="give the markers with --markers MARKERS.toml, or film a motion of 1 degree and more",
        )
    base = 2 * (1 - follower.moving.stick)
    order = [base, base + 1, *follower.moving.indices]
    rows = table.copy()
    for name in ("position_px", "covariance_px2", "light", "step", "residual", "state"):
        rows[name] = table[name][:, order]
    covariance = np.empty((len(rows), 4, 2, 2))
    covariance[..., 0, 0] = rows["covariance_px2"][..., 0]
    covariance[..., 0, 1] = covariance[..., 1, 0] = rows["covariance_px2"][..., 1]
    covariance[..., 1, 1] = rows["covariance_px2"][..., 2]
    tracks = MarkerTracks(
        frame=np.arange(len(rows), dtype=np.int64),
        time_s=rows["time_s"].copy(),
        position_px=rows["position_px"].copy(),
        covariance_px2=covariance,
        valid=rows["state"] == CODE["seen"],
        size_px=source.size_px,
    )
    report = {"source": source.describe(), "start_frame": start.frame, "kind": start.kind}
    return TrackResult(tracks, rows, list(source.damage.entries), report)
