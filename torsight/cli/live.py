"""``torsight live``: a rig on the bench, seen in Rerun while it moves."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from torsight.viewer.live.feed import Feed
    from torsight.viewer.live.session import Outcome


def live(
    source: Annotated[
        str, typer.Argument(metavar="SOURCE", help="Number of a camera, stream on this computer, or film.")
    ],
    *,
    temperature: Annotated[Path, typer.Option(metavar="TEMPS.csv", help="Temperature log, followed as it grows.")],
    actuator: Annotated[
        Path | None, typer.Option(metavar="ACTUATOR.toml", help="Shows the model's angle, residual and friction.")
    ] = None,
    camera: Annotated[Path | None, typer.Option(metavar="CAMERA.toml", help="Calibrated camera.")] = None,
    markers: Annotated[
        Path | None, typer.Option(metavar="MARKERS.toml", help="Marker positions in the first frame.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the record; one named by the time of day otherwise.")
    ] = None,
    speed: Annotated[float, typer.Option(help="How much faster than its own pace a film plays.")] = 1.0,
    grows: Annotated[bool, typer.Option("--grows", help="The film is still being written: wait for more.")] = False,
    fps: Annotated[float | None, typer.Option(help="Frame rate of pictures.")] = None,
    offset_s: Annotated[
        float | None, typer.Option(help="Log's time less film's time; taken from when rows arrive otherwise.")
    ] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Show it in a browser on this computer.")] = False,
    viewer: Annotated[bool, typer.Option(help="Open the viewer's window.")] = True,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port for viewers; 0 takes a free one.")] = 9876,
    web_port: Annotated[int, typer.Option(min=0, max=65535, help="Port for the browser; 0 takes a free one.")] = 9090,
) -> None:
    """Track while it happens: record to disk, show in Rerun; Ctrl-C ends it with everything kept.

    Example: torsight live 0 --temperature temps.csv --actuator actuator.toml
    """
    from datetime import datetime

    from torsight.actuator.spec import read_actuator
    from torsight.cli.console import say
    from torsight.core.camera import read_camera
    from torsight.viewer.live.feed import Feed
    from torsight.viewer.live.model import ModelWatch
    from torsight.viewer.live.session import Session
    from torsight.viewer.live.sources import open_pictures
    from torsight.viewer.program import free_port
    from tracker.hints import read_markers

    folder = out or Path(f"live-{datetime.now().astimezone():%Y%m%d-%H%M%S}")
    hints = None if markers is None else read_markers(markers)
    lens = None if camera is None else read_camera(camera)
    spec = None if actuator is None else read_actuator(actuator)
    pictures = open_pictures(source, speed=speed, fps=fps, grows=grows)
    stop = threading.Event()
    feed = Feed(port or free_port())
    model = None if spec is None else ModelWatch(spec)
    try:
        session = Session(
            pictures,
            log=temperature,
            folder=folder,
            hints=hints,
            camera=lens,
            feed=feed,
            model=model,
            offset_s=offset_s,
            say=say,
        )
        if not temperature.exists():
            say(f"waiting for {temperature}: it is followed as soon as it is there")
        with (
            _screens(feed, browser_port=(web_port or free_port()) if serve else None, window=viewer),
            _ended_by(stop),
        ):
            outcome = session.run(stop)
    finally:
        if model is not None:
            model.close()
        feed.close()
    for line in summary(outcome, folder):
        say(line)


def summary(outcome: Outcome, folder: Path) -> list[str]:
    """Return the lines that end a live record."""
    from torsight.core.wording import estimate

    share = 100.0 * outcome.measured / max(outcome.frames, 1)
    lines = [
        "",
        f"Frames            {outcome.frames}, {share:.1f} % of them measured, {outcome.dropped} dropped",
        f"Temperature rows  {outcome.log_rows}",
    ]
    if outcome.measured:
        span = outcome.high_deg - outcome.low_deg
        lines.append(f"Range of motion   {span:.1f}° (from {outcome.low_deg:.1f}° to {outcome.high_deg:.1f}°)")
    if outcome.friction is not None:
        lines.append(f"Friction torque   {estimate(outcome.friction)}, plain model")
    times = outcome.latency
    lines.append(f"Latency           median {times['median_ms']:.1f} ms, 99 % under {times['p99_ms']:.1f} ms")
    if outcome.left_out:
        lines.append(f"Not shown         {outcome.left_out} entries that the viewer could not take in time")
    lines.append(f"Record            {folder}")
    return lines


def _ended_by(stop: threading.Event) -> AbstractContextManager[None]:
    """Let Ctrl-C and a request to end set ``stop``, while the block lasts."""
    import contextlib
    import signal

    @contextlib.contextmanager
    def block() -> Iterator[None]:
        kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        for number in kept:
            signal.signal(number, lambda *_: stop.set())
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    return block()


def _screens(feed: Feed, *, browser_port: int | None, window: bool) -> AbstractContextManager[None]:
    """Start the viewer's window, or its page for a browser, while the block lasts; a window stays open after it."""
    import contextlib
    from urllib.parse import quote

    from torsight.cli.console import say
    from torsight.viewer.program import Viewer, free_port

    screens: list[Viewer] = []

    def start() -> None:
        # A viewer that finds nothing to connect to does not try again.
        if not feed.wait_until_open():
            return
        if browser_port is not None:
            arguments = ["--serve-web", "--web-viewer-port", str(browser_port), feed.address]
            screens.append(Viewer(arguments, port=free_port()))
            say(f"In a browser      http://127.0.0.1:{browser_port}?url={quote(feed.address, safe='')}")
        elif window:
            screens.append(Viewer(["--connect", feed.address], port=free_port()))
        say(f"For any viewer    rerun {feed.address}")

    @contextlib.contextmanager
    def block() -> Iterator[None]:
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

    return block()
