"""``torsight view``: the recording of a finished run in Rerun, in a window, a browser or pictures."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from torsight.cli.console import progress_bar, say
from torsight.cli.ends import Ended
from torsight.cli.options import Serve, WebPort
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.storage import read_table, read_toml


def view(
    folder: Annotated[Path, Argument(metavar="DIR", help="Folder of a run or a live record, or a recording.rrd.")],
    *,
    port: Annotated[int | None, Option(min=0, max=65535, help="Port of the viewer; a free one otherwise.")] = None,
    serve: Serve = False,
    web_port: WebPort = None,
    pictures: Annotated[
        Path | None, Option(metavar="OUT", help="Save every pane as a picture into this folder; needs no screen.")
    ] = None,
    at: Annotated[
        float | None, Option(metavar="SECONDS", help="Time on the film's clock that --pictures shows.")
    ] = None,
) -> None:
    """Open the recording of a finished run in Rerun.

    The viewer listens on this computer only.

    Example: torsight view results
    """
    from torsight.viewer.program import Viewer, address_of, browser_address, chosen_port, free_port, has_display

    if pictures is None and at is not None:
        raise ConfigError("needs --pictures: it is the time that these show", where="--at", do="add --pictures OUT")
    _require_within(at, folder if folder.is_dir() else folder.parent)
    recording = recording_of(folder)
    if pictures is not None:
        from torsight.viewer import save_pictures

        for path in save_pictures(recording, pictures, time_s=at):
            say(f"Picture  {path}")
        return
    if not serve and not has_display():
        raise NoResultError(
            "there is no display to open a window on",
            where=str(recording),
            do="look at it in a browser with --serve, or copy the file to a computer with a screen and open it there",
        )
    own_port = free_port() if port is None else chosen_port(port, port, option="--port")
    arguments = [str(recording)]
    if serve:
        browser_port = chosen_port(web_port, 9090, option="--web-port")
        arguments = ["--serve-web", "--web-viewer-port", str(browser_port), str(recording)]
    viewer = Viewer(arguments, port=own_port)
    try:
        if serve:
            say(f"In a browser  {browser_address(browser_port, address_of(own_port))}  (Ctrl-C ends it)")
        code = viewer.wait()
        reason = viewer.why_ended()
    except Ended as ended:
        ended.usual = ended.number == signal.SIGINT
        raise
    finally:
        viewer.end()
    if code != 0:
        raise NoResultError(
            f"the viewer could not open ({reason})",
            where=str(recording),
            do="it needs a screen; look at it in a browser with --serve, or open the file on another computer",
        )


def _require_within(at: float | None, folder: Path) -> None:
    """Refuse a time outside the record in the recording's folder; without a record any time is accepted."""
    tables = [folder / name for name in ("angle.csv", "merged.csv") if (folder / name).is_file()]
    if at is None or not tables:
        return
    time_s = read_table(tables[0], required=("time_s",))["time_s"]
    if not time_s.min() <= at <= time_s.max():
        raise ConfigError(
            "is no time of the record",
            where="--at",
            value=f"{at:.10g} s",
            limit=f"{time_s.min():.10g} to {time_s.max():.10g} s",
        )


def recording_of(folder: Path) -> Path:
    """Return the recording of a run; for a live record or an interrupted run it is made first."""
    if folder.is_file():
        return folder
    if (folder / "recording.rrd").is_file():
        return folder / "recording.rrd"
    if not any((folder / name).is_file() for name in ("angle.csv", "merged.csv")):
        raise InputError(
            "no recording here",
            where=str(folder / "recording.rrd"),
            do="make it with 'torsight run', and name its output folder",
        )
    from torsight.viewer import write_recording

    with progress_bar() as progress:
        return write_recording(folder, film=_film_of(folder), progress=progress)


def _film_of(folder: Path) -> Path | None:
    """Return the film of a live record, if the file still exists."""
    if not (folder / "experiment.toml").is_file():
        return None
    film = read_toml(folder / "experiment.toml").get("angle", {}).get("film")
    return Path(film) if isinstance(film, str) and Path(film).exists() else None
