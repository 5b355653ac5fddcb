"""``torsight markers``: the four markers of a film, picked on a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import command, say
from torsight.core.errors import NoResultError
from torsight.core.files.paths import require_apart
from torsight.core.tracks import MARKERS

if TYPE_CHECKING:
    from tracker.frames.source import Source

_OUT: Final = Path("markers.toml")


def markers(
    video: Annotated[str, Argument(metavar="VIDEO", help="Film, or folder or glob of pictures.")],
    *,
    out: Annotated[Path | None, Option(metavar="MARKERS.toml", help="File to write; markers.toml otherwise.")] = None,
    preview: Annotated[
        Path | None,
        Option(
            metavar="PICTURE.png",
            help="No page: draw the first frame with a grid and what was found; with --out, write that as well.",
        ),
    ] = None,
    port: Annotated[int, Option(min=0, max=65535, help="Port of the page; 0 takes any that is free.")] = 0,
    wait: Annotated[float, Option(min=1.0, help="Seconds to wait for a browser to open the page.")] = 120.0,
    no_open: Annotated[bool, Option("--no-open", help="Print the page's address, open no browser.")] = False,
) -> Answer:
    """Pick the four markers on a page in the browser.

    They are checked, and written to markers.toml. The page is served to this computer only; closing it ends the
    command. Markers that are found automatically are already shown; others take four clicks. The check follows the
    markers through the first seconds of the film.

    Example: torsight markers film.mp4 --out markers.toml
    """
    from tracker.frames.source import open_source

    require_apart([path for path in (out or _OUT, preview) if path is not None], [Path(video)])
    source = open_source(video)
    if preview is not None:
        return _preview(source, preview, out=out)
    return _page(source, out or _OUT, port=port, wait_s=wait, no_open=no_open)


def _page(source: Source, out: Path, *, port: int, wait_s: float, no_open: bool) -> Answer:
    import webbrowser

    from torsight.markers.server import Server, pick
    from torsight.markers.session import Session
    from torsight.viewer.program import has_display

    def tell(address: str) -> None:
        say(f"In a browser  {address}  (Ctrl-C ends it)")
        # Without a display only text browsers remain, which cannot show the page.
        if not no_open and has_display():
            webbrowser.open(address)

    with Server(port=port) as server:
        content = pick(server, Session(source, out=out), patience_s=wait_s, tell=tell)
    say(f"wrote {out}; next: {command('track', source.name, '--markers', out, '--out', 'results')}")
    return Answer(content, files=(out,))


def _preview(source: Source, picture: Path, *, out: Path | None) -> Answer:
    from torsight.markers.beginning import Beginning, name_tags
    from torsight.markers.picks import content_of, lengths_of, read_earlier, write_markers
    from torsight.markers.preview import write_preview
    from torsight.markers.session import NAMING_S, find_markers, first_picture
    from tracker.detect.given_positions import LOOKED_AT
    from tracker.detect.moving_part import SHARPER, motion_blur

    first, index = first_picture(source)
    seen, named = find_markers(source, first)
    name = Path(source.name).name
    write_preview(picture, first, seen, title=f"{name}, frame {index}", named_px=named)
    say(f"wrote {picture}")
    result: dict[str, Any] = {
        "candidates": [
            {"number": one.number, "x_px": one.x_px, "y_px": one.y_px, "radius_px": one.radius_px, "dot": one.is_dot,
             "taken": one.taken, "reason": one.reason}
            for one in seen.candidates
        ],
        "moving_known": named is not None,
    }  # fmt: skip
    found = named if named is not None or seen.sticks_px is None else seen.sticks_px.reshape(4, 2)
    if found is None:
        content = name_tags(source, seconds=NAMING_S)
    else:
        content = content_of({"points": dict(zip(MARKERS, found.tolist(), strict=True))}, {})
    if content is None:
        blur = motion_blur(Beginning(source, seconds=NAMING_S), index, LOOKED_AT[-1])
        lacking = NoResultError(
            f"the markers were not found: {seen.reason}",
            where=source.name,
            value=blur or None,
            do=f"{SHARPER}, or " * bool(blur)
            + f"look at {picture}, and pick them without --preview or write their positions to a file by hand",
        )
        say(f"torsight: {lacking}")
        return Answer(result, files=(picture,), exit_code=lacking.exit_code)
    if found is not None and named is None:
        say("which stick moves is not seen in the first seconds: check whether base and moving are right")
    for key, value in content.items():
        say(f"{key} = {value!r}".replace("'", '"'))
    if out is None:
        return Answer({**result, **content}, files=(picture,))
    content |= lengths_of(read_earlier(out)[0], kind=content["kind"])
    write_markers(out, content, film=name, size_px=(first.shape[1], first.shape[0]))
    say(f"wrote {out}")
    return Answer({**result, **content}, files=(picture, out))
