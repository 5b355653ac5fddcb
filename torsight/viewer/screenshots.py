"""Pictures of a recording, whole and pane by pane, without a screen."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from torsight.core.errors import InputError, OutputError
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import write_bytes
from torsight.core.progress import STUCK_S, THOUGHT_S
from torsight.viewer.program import Viewer, address_of, free_port
from torsight.viewer.view_layout import TIME, WINDOW_PX

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

Answer = TypeVar("Answer")

WHOLE: Final = "whole"
"""Name of the picture of all panes together."""

PATIENCE_S: Final = 2.0 * STUCK_S
"""Time for a viewer to start, and to repeat a request that timed out in the viewer: without a graphics card it draws
slowly."""
SETTLE_S: Final = THOUGHT_S
"""Wait after the first picture: panes slide into place, and the video is decoded meanwhile.
"""


def take_pictures(recording: Path, *, time_s: float | None, size_px: tuple[int, int] = WINDOW_PX) -> dict[str, bytes]:
    """Return a recording's panes as PNG by name, and all panes together as :data:`WHOLE`; no screen is needed."""
    with viewer_without_screen(size_px) as client:
        patiently(client.open, str(recording.resolve()))
        if time_s is not None:
            patiently(client.set_time, TIME, duration=time_s, play_state="paused")
        # The first picture is drawn before the whole recording is loaded.
        patiently(client.take_screenshot)
        time.sleep(SETTLE_S)
        return pictures_of(client)


def save_pictures(
    recording: AnyPath, out: AnyPath, *, time_s: float | None = None, size_px: tuple[int, int] = WINDOW_PX
) -> list[Path]:
    """Save every pane of a recording, and all of them together, as PNG pictures; no screen is needed.

    Parameters
    ----------
    recording : Path or str
        A ``recording.rrd``, or the folder of a run that holds one; nothing is written there.
    out : Path or str
        Folder for the pictures; each has the name of its pane, and ``whole.png`` shows them all.
    time_s : float, optional
        Time of the cursor, s on the film's clock; by default the start.
    size_px : (int, int)
        Width and height of the picture of all panes.

    Returns
    -------
    list of Path
        The pictures, in the order of their names.

    Raises
    ------
    InputError
        When there is no recording.
    OutputError
        When the viewer cannot draw here (it needs a Vulkan driver, one in software will do), or a picture cannot be
        written.
    """
    path = Path(recording)
    path = path / "recording.rrd" if path.is_dir() else path
    if not path.is_file():
        raise InputError("no such recording", where=str(path), do="make it with 'torsight run'")
    made = []
    for name, content in take_pictures(path, time_s=time_s, size_px=size_px).items():
        picture = Path(out) / f"{file_name(name)}.png"
        write_bytes(picture, content)
        made.append(picture)
    return sorted(made)


def file_name(pane: str) -> str:
    """Return a pane's name as a file name: ``Residual: measured − model (°)`` gives ``residual_measured_model``."""
    return re.sub(r"[^a-z0-9]+", "_", pane.lower()).strip("_")


def pictures_of(client: ViewerClient) -> dict[str, bytes]:
    """Return a viewer's current picture, pane by pane."""
    views = {view.name: view.view_id for view in patiently(client.get_state).views}
    pictures = {WHOLE: patiently(client.take_screenshot)}
    return pictures | {name: patiently(client.take_screenshot, identifier) for name, identifier in views.items()}


def patiently(ask: Callable[..., Answer], *arguments: Any, **options: Any) -> Answer:
    """Repeat a request to a viewer that has timed out on a busy machine."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            return ask(*arguments, **options)
        except TimeoutError:
            if time.monotonic() > end:
                raise


@contextmanager
def viewer_without_screen(size_px: tuple[int, int] = WINDOW_PX) -> Iterator[ViewerClient]:
    """Give a connection to a viewer that draws without a screen; the viewer ends with the block."""
    viewer = Viewer(["--headless", "--window-size", f"{size_px[0]}x{size_px[1]}"], port=free_port(), quiet=True)
    try:
        yield _connected(viewer)
    except (RuntimeError, ConnectionError) as error:
        # Without a driver the viewer answers at first and ends when it has to draw.
        if viewer.ends():
            raise _cannot_draw(viewer.why_ended()) from error
        raise
    finally:
        viewer.end()


def _connected(viewer: Viewer) -> ViewerClient:
    from rerun.experimental import ViewerClient

    end = time.monotonic() + PATIENCE_S
    while viewer.running and time.monotonic() < end:
        try:
            client = ViewerClient.connect(address_of(viewer.port))
            client.get_state()
        except (RuntimeError, ConnectionError, OSError):
            time.sleep(0.1)
        else:
            return client
    raise _cannot_draw(f"it did not answer within {PATIENCE_S:g} s" if viewer.running else viewer.why_ended())


def _cannot_draw(reason: str) -> OutputError:
    return OutputError(
        f"the viewer cannot draw here ({reason})",
        where="pictures of a recording",
        do="install a Vulkan driver, for example mesa-vulkan-drivers",
    )
