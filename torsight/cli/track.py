"""``torsight track``: from a film to the angle of the actuator, and how reliable it is.

With an angle in less than nine tenths of the frames there is a warning. Below a half, or where other dots may equally
be the markers, there is no result.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.options import CameraFile, Fps
from torsight.core.errors import NoResultError
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import read_json, write_json, write_table
from torsight.core.optics.camera import Camera, read_camera, require_second, require_size
from torsight.core.progress import Progress, silent
from torsight.core.tracks import LEAST_SURE, USUAL_SHARE, MarkerTracks, StickAngles, angle_columns, marker_columns

if TYPE_CHECKING:
    from tracker.detect.marker_file import MarkerHints
    from tracker.frames.source import Source
    from tracker.track import TrackResult

TRACK_PICTURE: Final = "track.png"
FILES: Final = ("angle.csv", "markers.csv", "track.json", TRACK_PICTURE)
"""Files that the command writes."""
_PAIR_REMARK: Final = (
    "The camera file is of a stereo pair, and one film was given: it is taken for the left camera's and tracked "
    "with that lens alone, without positions in space; name the right film after it to use both."
)


def track(
    video: Annotated[str, Argument(metavar="VIDEO", help="Film, or folder or glob of pictures.")],
    video_right: Annotated[str | None, Argument(metavar="[VIDEO_RIGHT]", help="Right film of a stereo pair.")] = None,
    *,
    out: Annotated[Path, Option(help="Folder for angle.csv, markers.csv, track.json and track.png.")],
    camera: CameraFile = None,
    markers: Annotated[
        Path | None, Option(metavar="MARKERS.toml", help="The markers: positions in the first frame, or tags.")
    ] = None,
    timestamps: Annotated[
        Path | None, Option(metavar="T.csv", help="Table frame, time_s with the time of every frame.")
    ] = None,
    fps: Fps = None,
    resume: Annotated[bool, Option("--resume", help="Continue an interrupted track.")] = False,
) -> Answer:
    """Follow the markers through a film: every frame's angle.

    Ends with exit code 4 where less than half of the frames have an angle, where no markers are found, where nothing
    shows which dots they are, or where the film shows that they are exchanged in the marker file; the files are still
    written.

    Example: torsight track film.mp4 --out out
    """
    with progress_bar() as progress:
        angles = track_to_folder(
            video,
            right=video_right,
            camera=camera,
            markers=markers,
            timestamps=timestamps,
            fps=fps,
            out=out,
            resume=resume,
            progress=progress,
        )
    say(f"{int(angles.valid.sum())} of {len(angles)} frames have an angle; see {out / 'angle.csv'}")
    content = read_json(out / "track.json")
    code = NoResultError.exit_code if is_no_result(content) else 0
    return Answer(content, files=tuple(out / name for name in FILES), exit_code=code)


def track_to_folder(
    video: str | Path,
    *,
    right: str | Path | None = None,
    camera: Path | None = None,
    markers: Path | Mapping[str, Any] | None = None,
    timestamps: Path | None = None,
    fps: float | None = None,
    out: Path,
    resume: bool = False,
    progress: Progress = silent,
) -> StickAngles:
    """Track a film (or a stereo pair) and write ``angle.csv``, ``markers.csv``, ``track.json`` and ``track.png``.

    The options are those of :func:`track`; ``markers`` may also be the content of ``MARKERS.toml``. Returns the angles
    of ``angle.csv``.
    """
    from torsight.core.files.lock import only_writer
    from torsight.markers.track_picture import keep_pictures, write_track_picture
    from tracker.angle.orient import orient
    from tracker.checkpoint import drop
    from tracker.detect.marker_file import in_second_film, read_markers
    from tracker.quality.account import account
    from tracker.quality.track_warnings import doubts, doubts_of_length, doubts_of_tilt, doubts_of_turns

    inputs = [Path(video), None if right is None else Path(right), camera, timestamps]
    require_apart([out / name for name in FILES], inputs)
    lens = None if camera is None else read_camera(camera)
    hints = None if markers is None else read_markers(markers)
    right_hints = None if right is None else in_second_film(hints)
    where = "--camera" if camera is None else str(camera)
    remarks = []
    if right is not None:
        require_second(lens, where=where)
    elif lens is not None and lens.right is not None:
        say(f"{where}: {_PAIR_REMARK}")
        remarks.append(_PAIR_REMARK)
    source, second = _sources(video, right, lens, fps=fps, timestamps=timestamps)
    with only_writer(out):
        keep_pictures(source)
        kept = [out / ".track", out / ".track-right"]
        result = _tracked(source, hints, kept=kept[0], left=source, resume=resume, progress=progress)
        other = None
        if second is not None and lens is not None:
            from tracker.angle.stereo import orient_pair

            other = _tracked(second, right_hints, kept=kept[1], left=source, resume=resume, progress=progress)
            known_mm = {} if hints is None else hints.length_mm
            orientation = orient_pair(result.tracks, other.tracks, lens, known_mm=known_mm)
        else:
            orientation = orient(result.tracks, lens, pixel_aspect=source.pixel_aspect)
        write_table(
            out / "markers.csv", marker_columns(orientation.with_errors(result.tracks), orientation.position_mm)
        )
        write_table(out / "angle.csv", angle_columns(orientation.angles))
        found = doubts_of_length(result, orientation) + doubts(result)
        minor = doubts_of_turns(orientation.angles) + doubts_of_tilt(orientation)
        doubtful = [(str(video), doubt) for doubt in found]
        doubtful += [] if other is None else [(str(right), doubt) for doubt in doubts(other)]
        warnings = [doubt if film == str(video) else f"Right film: {doubt}" for film, doubt in doubtful]
        content = account(
            result, orientation, doubts=warnings, minor=minor, remarks=remarks, pictures=source.pictures, right=other
        )
        write_json(out / "track.json", content)
        for film, doubt in [*doubtful, *((str(video), doubt) for doubt in minor)]:
            say(f"warning: {film}: {doubt}")
        lacking = unsure_markers(content, where=str(video)) or few_angles(content, where=str(video))
        if lacking is not None:
            say(f"{'torsight' if is_no_result(content) else 'warning'}: {lacking}")
        write_track_picture(out / TRACK_PICTURE, source, result, orientation.angles)
        for folder in kept:
            drop(folder)
    return orientation.angles


def _tracked(
    source: Source, hints: MarkerHints | None, *, kept: Path, left: Source, resume: bool, progress: Progress
) -> TrackResult:
    """Follow the markers; where that fails, write tables without an angle, and a picture of all candidates.

    The picture gives the reasons for rejecting them. ``kept`` is the folder of the checkpoints, among the outputs;
    ``left`` is the film whose frames the tables list.
    """
    from tracker.track import track_film

    try:
        return track_film(source, markers=hints, out=kept, resume=resume, progress=progress)
    except NoResultError as error:
        from torsight.markers.preview import write_preview
        from tracker.detect.candidates import look
        from tracker.detect.given_positions import first_frame

        out, frame = kept.parent, first_frame(source)
        if frame.luma is not None:
            write_preview(
                out / TRACK_PICTURE,
                frame.luma,
                look(frame.luma),
                title=f"{Path(source.name).name}, frame {frame.index}: no result",
                message=str(error),
                given_px=None if hints is None or "tag" in hints.kinds else hints.position_px,
            )
        _write_nothing(out, left, str(error))
        do = f"{error.do}; {out / TRACK_PICTURE} shows what was considered in the first frame"
        raise NoResultError(error.what, where=error.where, value=error.value, limit=error.limit, do=do) from error


def _sources(
    video: str | Path, right: str | Path | None, lens: Camera | None, *, fps: float | None, timestamps: Path | None
) -> tuple[Source, Source | None]:
    """Open one film or two, and refuse films of another size than the camera's before anything is tracked."""
    from tracker.frames.source import open_source

    source = open_source(video, fps=fps, timestamps=timestamps)
    second = None if right is None else open_source(right, fps=fps, timestamps=timestamps)
    if lens is not None:
        require_size(lens, source.size_px, film="the film" if right is None else "the left film")
    if second is not None and lens is not None and lens.right is not None:
        require_size(lens, second.size_px, film="the right film", right=lens.right)
    return source, second


def _write_nothing(out: Path, source: Source, why: str) -> None:
    """Write the tables of a film without markers, in place of those of an earlier film: every frame, no angle."""
    from tracker.frames.sample import read_timestamps

    time_s = read_timestamps(source).time_s
    count = len(time_s)
    tracks = MarkerTracks.unseen(time_s, source.size_px)
    unknown, never = np.full(count, np.nan), np.zeros(count, np.bool_)
    write_table(out / "markers.csv", marker_columns(tracks))
    angles = StickAngles(tracks.frame, time_s, unknown, unknown, never, ~never)
    write_table(out / "angle.csv", angle_columns(angles))
    frames = {"total": count, "with_angle": 0, "without_angle": count}
    write_json(out / "track.json", {"source": source.describe(), "frames": frames, "advice": [why], "events": []})


LEAST: Final = 0.5
"""Share of the frames below which a command ends with exit code 4, by the contract."""
WHY: Final = {
    "hand": "something lies over a marker",
    "sticks": "the sticks are too close to each other",
    "light": "the light is off",
    "flicker": "the light flickers",
    "glare": "light glares on the markers",
    "picture": "a marker is outside the picture",
    "marker": "a marker was not found again",
    "texture": "the texture around a marker was lost",
    "tag": "a tag was not seen",
    "unlike": "the given points are not like dots on a plain stick",
    "file": "the frame is damaged",
    "late": "the markers are not in sight yet",
    "shutter": "the markers are smeared by their motion",
    "speed": "the stick is too fast for the search",
    "focus": "the picture is out of focus",
    "interlaced": "the film is interlaced",
    "jump": "the picture jumps",
}
"""Words for the causes of :mod:`tracker.quality.gaps`."""


def few_angles(account: Mapping[str, Any], *, where: str) -> NoResultError | None:
    """Return the error of a film in which less than nine tenths of the frames have an angle, by its ``track.json``.

    :func:`is_no_result` says whether that ends a command.
    """
    share = _share(account)
    if share >= USUAL_SHARE:
        return None
    frames = account["frames"]
    why = next(iter(frames.get("causes", {})), "")
    advice = gap_words(account) or "look at track.png: it shows what was read, and where not"
    return NoResultError(
        "few frames have an angle" if share >= LEAST else "less than half of the frames have an angle",
        where=where,
        value=f"{frames['with_angle']} of {frames['total']}, {100.0 * share:.0f} %"
        + (f"; most of the others: {WHY[why]}" if why in WHY else ""),
        limit=f"{100.0 * (USUAL_SHARE if share >= LEAST else LEAST):.0f} % or more",
        do=advice,
    )


def unsure_markers(account: Mapping[str, Any], *, where: str) -> NoResultError | None:
    """Return the error where the markers may not be, or are shown not to be, the right ones, by ``track.json``."""
    sure = _sure(account)
    if sure >= LEAST_SURE:
        return None
    films = [film.get("markers") or {} for film in (account, account.get("right_film") or {})]
    if any("exchanged" in markers for markers in films):
        return NoResultError(
            "the film shows that markers are exchanged in the marker file, and the angles are wrong",
            where=where,
            do="exchange them there, as the first advice in track.json says",
        )
    if any(markers.get("rivals") for markers in films):
        what = "other dots may equally be the markers"
    elif max(float(markers.get("opposite_probability", 0.0)) for markers in films) > 0.5 * (1.0 - sure):
        what = "nothing shows which marker of a stick is the inner one"
    else:
        what = "no four dots move as markers on two sticks do"
    return NoResultError(
        what,
        where=where,
        value=f"those that were taken are the right ones with a probability of {100.0 * sure:.0f} %",
        limit=f"{100.0 * LEAST_SURE:.0f} % or more",
        do=f"pick them with 'torsight markers {where}' and name its file with --markers, or cover all other dots",
    )


def gap_words(account: Mapping[str, Any]) -> str:
    """Return the advice on frames without an angle from ``track.json``; doubts about the track come first."""
    advice = [str(words) for words in account.get("advice") or []]
    about = next((words for words in advice if "frames have no angle" in words), "")
    # A doubt about the track is listed before its gaps and is their cause: sticks exchanged, a damaged file.
    first = advice[0] if advice and about != advice[0] and about in advice[1:2] else about.partition(": ")[2]
    return (first or next(iter(advice), "")).rstrip(".")


def is_no_result(account: Mapping[str, Any]) -> bool:
    """Return whether a command ends without a result (exit code 4), because its angles are not reliable enough."""
    return _share(account) < LEAST or _sure(account) < LEAST_SURE


def _sure(account: Mapping[str, Any]) -> float:
    """Return the probability that the chosen markers of a film, or of both films, are the right ones."""
    films = (account, account.get("right_film") or {})
    markers = [film.get("markers") or {} for film in films]
    return math.prod(0.0 if "exchanged" in one else float(one.get("probability", 1.0)) for one in markers)


def _share(account: Mapping[str, Any]) -> float:
    frames = account.get("frames") or {}
    # An existing table of angles may come with another program's track.json.
    if not frames.get("total") or "with_angle" not in frames:
        return 1.0
    return float(frames["with_angle"]) / int(frames["total"])
