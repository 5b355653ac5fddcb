"""``torsight live``: track a rig while it moves, and show it in Rerun."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import say
from torsight.cli.ends import asks, handled
from torsight.cli.options import CameraFile, Columns, Fps, Serve, Units, WebPort, said
from torsight.core.errors import InputError
from torsight.core.files.storage import read_json
from torsight.core.optics.camera import read_camera
from torsight.core.words.wording import estimate

if TYPE_CHECKING:
    from torsight.viewer.live.record import Outcome
    from torsight.viewer.live.screen import Feed

FILES: Final = ("angle.csv", "markers.csv", "temps.csv", "events.csv", "track.json", "live.json", "experiment.toml")
"""Files of a live record."""

WINDOW_MEMORY: Final = "1GB"
"""Memory of the window; the oldest data are dropped first."""


def live(
    source: Annotated[str, Argument(metavar="SOURCE", help="Number of a camera, stream on this computer, or film.")],
    *,
    temperature: Annotated[Path, Option(metavar="TEMPS.csv", help="Temperature log, followed as it grows.")],
    actuator: Annotated[
        Path | None, Option(metavar="ACTUATOR.toml", help="Shows the model's angle, residual and friction.")
    ] = None,
    camera: CameraFile = None,
    markers: Annotated[Path | None, Option(metavar="MARKERS.toml", help="Marker positions in the first frame.")] = None,
    out: Annotated[Path | None, Option(help="Folder for the record; by default one named after date and time.")] = None,
    speed: Annotated[float, Option(help="How much faster than its own pace a film plays.")] = 1.0,
    grows: Annotated[bool, Option("--grows", help="The film is still being written: wait for more.")] = False,
    fps: Fps = None,
    offset_s: Annotated[
        float | None, Option(help="Log's time minus film's time; by default from the arrival of rows.")
    ] = None,
    columns: Columns = None,
    units: Units = None,
    serve: Serve = False,
    viewer: Annotated[bool, Option(help="Open the viewer's window.")] = True,
    port: Annotated[
        int | None, Option(min=0, max=65535, help="Port for viewers; 9876 where it is free, 0 takes any.")
    ] = None,
    web_port: WebPort = None,
) -> Answer:
    """Track a camera or a growing film and show it in Rerun.

    The record is written to disk; Ctrl-C ends it and keeps it.

    Example: torsight live 0 --temperature temps.csv --actuator actuator.toml
    """
    from sync.log.column_names import chosen_columns
    from torsight.actuator.spec import read_actuator
    from torsight.viewer.live.frames.sources import film_of, open_pictures
    from torsight.viewer.live.live_session import Session
    from torsight.viewer.live.measure.growing_log import WatchedLog
    from torsight.viewer.live.measure.model_watch import ModelWatch
    from torsight.viewer.live.record import write_experiment
    from torsight.viewer.live.screen import Feed
    from torsight.viewer.program import chosen_port
    from tracker.detect.marker_file import read_markers

    named = said(columns, units)
    folder = out or Path(f"live-{datetime.now().astimezone():%Y%m%d-%H%M%S}")
    hints = None if markers is None else read_markers(markers)
    lens = None if camera is None else read_camera(camera)
    spec = None if actuator is None else read_actuator(actuator)
    if temperature.is_dir():
        raise InputError("is a folder", where=str(temperature), limit="a log", do="name the file that is written")
    ports = chosen_port(port, 9876, option="--port"), chosen_port(web_port, 9090, option="--web-port")
    pictures = open_pictures(source, speed=speed, fps=fps, grows=grows)
    stop = threading.Event()
    # After Ctrl-C and other requests to end, the record is completed.
    ended = handled(asks(), lambda *_: stop.set())
    model = contextlib.nullcontext() if spec is None else contextlib.closing(ModelWatch(spec))
    with ended, model as watch, contextlib.closing(Feed(ports[0])) as feed:
        session = Session(
            pictures,
            WatchedLog(temperature, offset_s, chosen_columns(**named)),
            folder=folder,
            hints=hints,
            camera=lens,
            feed=feed,
            model=watch,
            say=say,
        )
        write_experiment(folder, film=film_of(pictures), actuator=actuator, offset_s=offset_s, **named)
        if not temperature.exists():
            say(f"waiting for {temperature}: it is followed as soon as it exists")
        with _screens(feed, browser_port=ports[1] if serve else None, window=viewer):
            outcome = session.run(stop)
    say(*summary(outcome, folder))
    files = [folder / name for name in FILES]
    return Answer(read_json(folder / "live.json"), files=[path for path in files if path.exists()])


def summary(outcome: Outcome, folder: Path) -> list[str]:
    """Return the summary of a live record, line by line."""
    share = 100.0 * outcome.measured / max(outcome.frames, 1)
    lines = [
        "",
        f"Frames            {outcome.frames}, {share:.1f} % of them measured, {outcome.dropped} dropped{outcome.lost}",
        f"Temperature rows  {outcome.log_rows or 'none: the log did not exist, or stayed empty'}",
    ]
    if outcome.measured:
        span = outcome.high_deg - outcome.low_deg
        lines.append(f"Range of motion   {span:.1f}° (from {outcome.low_deg:.1f}° to {outcome.high_deg:.1f}°)")
    if outcome.friction is not None:
        lines.append(f"Friction torque   {estimate(outcome.friction)}, plain model")
    for name, times in (("recorded", outcome.latency), ("logged", outcome.latency_logged)):
        if times.get("frames"):
            words = f"median {times['median_ms']:.1f} ms, 99 % under {times['p99_ms']:.1f} ms until the angle is {name}"
            lines.append(f"Latency           {words}")
    if outcome.left_out:
        lines.append(f"Not shown         {outcome.left_out} entries that the viewer could not take in time")
    to_report = f"to the report: torsight run {folder / 'experiment.toml'}"
    after = to_report if outcome.log_rows else "without temperatures there is no report"
    lines.append(f"Record            {folder}; {after}")
    return lines


@contextlib.contextmanager
def _screens(feed: Feed, *, browser_port: int | None, window: bool) -> Iterator[None]:
    """Start the viewer's window, or its page for a browser, while the block lasts; a window stays open afterwards."""
    from torsight.viewer.program import Viewer, browser_address, free_port, has_display

    screens: list[Viewer] = []

    def start() -> None:
        # A viewer that finds nothing to connect to does not try again.
        if not feed.wait_until_open():
            say("the view cannot be served; the record continues without it")
            return
        if browser_port is not None:
            arguments = ["--serve-web", "--web-viewer-port", str(browser_port), feed.address]
            screens.append(Viewer(arguments, port=free_port()))
            say(f"In a browser      {browser_address(browser_port, feed.address)}")
        elif window and has_display():
            arguments = ["--connect", feed.address, "--memory-limit", WINDOW_MEMORY]
            screens.append(Viewer(arguments, port=free_port(), stays=True))
        elif window:
            say("No display here   --serve shows the view in a browser, --no-viewer suppresses this line")
        say(f"For any viewer    rerun {feed.address}")

    starter = threading.Thread(target=start, daemon=True)
    starter.start()
    try:
        yield
    finally:
        starter.join(timeout=1.0)
        for screen in screens:
            if not screen.running:
                say(f"The viewer ended  {screen.why_ended()}")
            if browser_port is not None or not screen.running:
                screen.end()
