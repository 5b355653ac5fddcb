"""Tracking of a film's markers from the first frame to the last."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.frozen import Frozen
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import Progress, silent
from torsight.core.tracks import LEAST_SURE, MarkerTracks
from torsight.core.words.shown import Shown
from tracker.angle.axis_of_circles import turned_round
from tracker.angle.camera_motion import unmoved
from tracker.angle.views import longest_view
from tracker.checkpoint import RowStore, source_key
from tracker.couples import Choice
from tracker.detect.dots import HUGE_PX
from tracker.detect.marker_file import STICKS, MarkerHints
from tracker.detect.moving_part import SHARPER, motion_blur
from tracker.follow.judgement import MOVED_RAD
from tracker.frames.frame import REPORT_EVERY, FrameSource
from tracker.initialise import Start, find_start
from tracker.innovation import SIGMAS
from tracker.rows import CODE
from tracker.stick_direction import square

if TYPE_CHECKING:
    from tracker.follow.follower import Follower

_DOUBTFUL_RAD = SIGMAS * MOVED_RAD
"""Range of the direction, over nine tenths of the frames, above which faint dots are accepted as markers."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TrackResult(Frozen, Shown):
    """The markers of one film.

    Attributes
    ----------
    tracks : MarkerTracks
        Positions, order of :data:`torsight.core.tracks.MARKERS`; covariances from the fits, not scaled.
    rows : (n,) structured
        Records of every frame, same order of markers (see :mod:`tracker.rows`).
    damage : list of dict
        Damage found in the source.
    report : mapping
        For ``track.json``: source and start.
    """

    tracks: MarkerTracks
    rows: NDArray[np.void]
    damage: list[dict[str, Any]] = field(default_factory=list)
    report: Mapping[str, Any] = field(default_factory=dict)

    def facts(self) -> dict[str, str]:
        """Return the facts of the tracks, and the number of damaged places in the source."""
        return {**self.tracks.facts(), "damaged places": str(len(self.damage))}

    def _columns(self) -> dict[str, Any]:
        return dict(self.tracks.to_frame())

    def _draw(self, axes: Any) -> None:
        self.tracks.plot(axes)


@one_thread()
def track_film(
    source: FrameSource,
    *,
    markers: MarkerHints | None = None,
    out: AnyPath | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> TrackResult:
    """Follow the four markers through a film.

    Parameters
    ----------
    source : FrameSource
        See :func:`tracker.frames.source.open_source`.
    markers : MarkerHints, optional
        Kinds and positions of the markers, see :func:`tracker.detect.marker_file.read_markers`; found automatically
        otherwise.
    out : str or Path, optional
        Folder for checkpoints; none are written without it.
    resume : bool
        Resume from the last checkpoint in ``out``, if it is of the same inputs; the result is identical, bit by bit, to
        that of an uninterrupted track.
    progress : Progress
        Called with the progress.

    Raises
    ------
    ConfigError, InputError, NoResultError
        See :func:`tracker.initialise.find_start`; also when no stick moves and none was named.
    OutputError
        When checkpoints cannot be written.
    """
    out = None if out is None else Path(out)
    start = find_start(source, markers, progress=progress)
    follower, earlier = start.follower(), None if start.earlier is None else start.earlier.follower()
    store = RowStore(out, key=_key(source, markers) if out else "")
    state = store.resume() if resume else None
    if state is None:
        store.begin()
    elif state:
        follower.restore(state)
    done = store.saved
    total = source.frame_count
    for frame in source:
        if frame.index >= done:
            now = follower if frame.index >= start.frame or earlier is None else earlier
            store.add(now.pass_over(frame) if frame.index < start.first_frame else now.step(frame))
            if store.due and frame.index >= start.frame:
                store.checkpoint(follower.to_state())
        if frame.index % REPORT_EVERY == 0:
            progress("tracking", frame.index, total)
    rows = store.rows()
    progress("tracking", len(rows), len(rows))
    return _result(rows, start, follower, source)


def _key(source: FrameSource, markers: MarkerHints | None) -> str:
    given = None
    if markers is not None:
        given = [markers.position_px.tolist(), markers.kinds, markers.family, markers.ids]
    return source_key(source.files(), settings={"markers": given, "source": source.describe()})


def _moves(table: NDArray[np.void], stick: int) -> bool:
    """Return whether a stick's direction varies by more than that of faint dots of the background would."""
    own = slice(2 * stick, 2 * stick + 2)
    inner, outer = np.moveaxis(table["position_px"][:, own], 1, 0)
    seen = (table["state"][:, own] == CODE["seen"]).all(axis=1)
    offset = (outer - inner)[seen]
    if not len(offset):
        return False
    turn = np.unwrap(np.arctan2(offset[:, 1], offset[:, 0]))
    low, high = np.percentile(turn, (5.0, 95.0))
    return bool(high - low > _DOUBTFUL_RAD)


def _nothing_moves(table: NDArray[np.void], start: Start, *, where: str) -> NoResultError:
    """Return the error that neither stick moves, with the dots or tags that were followed."""
    tags, least_deg = start.hints, round(math.degrees(_DOUBTFUL_RAD if start.doubtful else MOVED_RAD), 3)
    do = (
        "name the tag of the moving stick with --markers"
        if tags
        else "if they are not, pick the markers with 'torsight markers' and name its file with --markers"
    )
    return NoResultError(
        "no stick moves, so the moving one cannot be distinguished from the base",
        where=where,
        value=f"tags {tags.ids[0]} and {tags.ids[1]} of {tags.family} were followed"
        if tags
        else _followed(table, start),
        limit=f"a motion of {least_deg:g} degree{'' if least_deg == 1.0 else 's'} and more"
        + ("" if tags else f"; dots of 3 to {HUGE_PX:g} px radius"),
        do=f"film a motion{', or ' if tags else ' if these four dots are the markers; '}{do}",
    )


def _lost_as_it_moves(table: NDArray[np.void], start: Start, source: FrameSource) -> NoResultError | None:
    """Return the error that dots are lost as something moves, or None where they are seen or nothing moves."""
    seen = (table["state"][start.frame :] == CODE["seen"]).all(axis=1)
    blur = None if 2 * seen.sum() > len(seen) else motion_blur(source, start.frame, len(table) - 1)
    if blur is None:
        return None
    return NoResultError(
        "the dots that were taken for the markers are lost as the picture moves",
        where=source.name,
        value=f"all four in {seen.sum()} of {len(seen)} frames; {blur or 'what moves is sharp'}",
        limit="half of the frames or more",
        do="look in track.png: if the rings are on something else, pick the markers with 'torsight markers' and name "
        f"its file with --markers, else {SHARPER if blur else 'film more frames a second, or move more slowly'}",
    )


def _followed(table: NDArray[np.void], start: Start) -> str:
    """Return in words the dots that were followed as markers."""
    radii = sorted(marker.radius_px for marker in start.markers)
    steps: NDArray[np.float64] = table["step"]
    seen = np.abs(steps[table["state"] == CODE["seen"]])
    where = np.where((table["state"] == CODE["seen"])[..., None], table["position_px"], np.nan)
    last = [points[np.isfinite(points[:, 0])][-1:].ravel() for points in np.moveaxis(where, 1, 0)]
    places = ", ".join(f"[{x:.0f}, {y:.0f}]" for x, y in (point for point in last if len(point)))
    contrast = f" and {np.median(seen):.0f} grey levels of contrast" if len(seen) else ""
    return f"dots of {radii[0]:.0f} to {radii[-1]:.0f} px radius{contrast} were followed, last at {places}"


def _tags(start: Start, *, base: int) -> dict[str, Any]:
    """Return the tags that were found automatically, as entries of a marker file."""
    if start.hints is None or start.moving is not None:
        return {}
    ids = start.hints.ids
    return {"family": start.hints.family, "base_id": ids[base], "moving_id": ids[1 - base]}


def told_by_motion(
    tracks: MarkerTracks, choice: Choice, *, radius_px: float, base: int = 0
) -> tuple[list[int], dict[str, Any], float]:
    """Return the order of the markers, inner ones first, their probabilities for ``track.json``, and a variance.

    All frames decide which dot of a stick is nearer to the axis. The report has the probability that the markers are
    right, and their rivals; the variance of the angle includes these only below
    :data:`~torsight.core.tracks.LEAST_SURE`: above it, a rival of small probability would dominate a good angle's
    sigma. ``base`` is the index of the couple's stick that is the base.
    """
    # Probabilities, for base and moving stick, that the marker called the inner one is the outer one: the more
    # probable order is used, and the angle is wrong by half a turn if it is not the right one.
    exchanged = turned_round(unmoved(longest_view(tracks)).tracks, radius_px=radius_px)
    order = [i ^ int(exchanged[i // 2] > 0.5) for i in range(4)]
    base_off, moving_off = np.minimum(exchanged, 1.0 - exchanged).tolist()
    opposite = base_off * (1.0 - moving_off) + moving_off * (1.0 - base_off)
    report: dict[str, Any] = {"probability": choice.sure * (1.0 - opposite), "opposite_probability": opposite}
    if choice.rivals:
        # Which of two sticks is the base follows from the whole film, for the rivals as for those that were taken.
        couples = (choice.taken, *choice.rivals)
        if base:
            couples = tuple(replace(one, base=one.moving, moving=one.base) for one in couples)
        report["taken"], *report["rivals"] = (one.to_json() for one in couples)
        for name, turned in zip(STICKS, (exchanged > 0.5).tolist(), strict=True):
            report["taken"][name] = report["taken"][name][:: -1 if turned else 1]
    spread_rad2 = choice.spread_rad2 + math.pi**2 * opposite
    return order, report, spread_rad2 if report["probability"] < LEAST_SURE else 0.0


def _alike(start: Start, follower: Follower, *, moving: int) -> dict[str, float]:
    """Return the smallest rotation after which a moving stick with texture looks the same, degrees, if there is one."""
    if start.kinds[moving] != "texture" or start.first is None or start.first.luma is None:
        return {}
    from tracker.patches.texture_stick import TextureStick

    stick = follower.sticks[moving]
    turn_deg = stick.turn_that_looks_alike_deg(start.first.luma) if isinstance(stick, TextureStick) else math.nan
    return {} if math.isnan(turn_deg) else {"looks_alike_turned_by_deg": turn_deg}


def _ordered(table: NDArray[np.void], order: list[int], source: FrameSource) -> tuple[NDArray[np.void], MarkerTracks]:
    """Return the rows and the tracks with their markers in another order."""
    rows = table.copy()
    for name in ("position_px", "covariance_px2", "light", "step", "residual", "state"):
        rows[name] = table[name][:, order]
    tracks = MarkerTracks(
        frame=np.arange(len(rows), dtype=np.int64),
        time_s=rows["time_s"].copy(),
        position_px=rows["position_px"].copy(),
        covariance_px2=square(rows["covariance_px2"]),
        valid=rows["state"] == CODE["seen"],
        size_px=source.size_px,
    )
    return rows, tracks


def _result(table: NDArray[np.void], start: Start, follower: Follower, source: FrameSource) -> TrackResult:
    moving = follower.moving
    if moving is None or (start.doubtful and not _moves(table, moving)):
        raise _lost_as_it_moves(table, start, source) or _nothing_moves(table, start, where=source.name)
    base = 1 - moving
    rows, tracks = _ordered(table, [2 * base, 2 * base + 1, 2 * moving, 2 * moving + 1], source)
    choice: dict[str, Any] = {}
    if start.choice is not None:
        radius_px = follower.report()["radius_px"]
        order, choice, variance_rad2 = told_by_motion(tracks, start.choice, radius_px=radius_px, base=base)
        rows, tracks = _ordered(rows, order, source)
        tracks = replace(tracks, choice_rad2=variance_rad2)
    report = {
        "source": source.describe(),
        "markers": {
            "kind": start.kind if len(set(start.kinds)) == 1 else dict(zip(STICKS, start.kinds, strict=True)),
            "given": start.moving is not None,
            **_tags(start, base=base),
            "first_frame": start.first_frame,
            "faint": start.doubtful,
            **({"not_on_one_stick": dict(start.unlike)} if start.unlike else {}),
            **choice,
            **follower.report(),
            **_alike(start, follower, moving=moving),
        },
    }
    return TrackResult(tracks, rows, list(source.damage.entries), report)
