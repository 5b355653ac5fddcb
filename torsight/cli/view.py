"""``torsight view``: the recording of a finished run in Rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from torsight.core.errors import InputError, OutputError


def view(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished run, or a recording.rrd.")],
    *,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the viewer; 0 takes a free one.")] = 0,
) -> None:
    """Open the recording of a finished run in Rerun; it listens on this computer only.

    Example: torsight view results
    """
    from torsight.viewer.program import Viewer, free_port

    recording = folder / "recording.rrd" if folder.is_dir() else folder
    if not recording.is_file():
        raise InputError(
            "no recording here", where=str(recording), do="make it with 'torsight run', and name its output folder"
        )
    viewer = Viewer([str(recording)], port=port or free_port())
    try:
        code = viewer.wait()
        reason = viewer.why_ended()
    except KeyboardInterrupt:
        return
    finally:
        viewer.end()
    if code != 0:
        raise OutputError(
            f"the viewer could not open ({reason})",
            where=str(recording),
            do="it needs a screen; on a computer without one copy the file to one that has, and open it there",
        )
