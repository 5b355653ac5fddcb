"""``torsight board``: a calibration board, or a pair of tags for the sticks, to print at true scale."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from torsight.cli.answer import Answer
from torsight.cli.console import say
from torsight.core.errors import ConfigError
from torsight.core.files.storage import write_text

if TYPE_CHECKING:
    from calibration.boards.printing import Drawing


def board(
    description: Annotated[
        Path | None,
        typer.Argument(metavar="BOARD.toml", help="The board; without it one that fits the page is made up."),
    ] = None,
    *,
    out: Annotated[Path, typer.Option(help="File to write: .svg or .pdf at true scale (a .png comes with it).")],
    page: Annotated[str, typer.Option(help="Page: a5, a4, a3, a2, letter or tabloid.")] = "a4",
    kind: Annotated[str, typer.Option(help="Without BOARD.toml: charuco or chessboard.")] = "charuco",
    dpi: Annotated[float, typer.Option(help="Pixels per inch of the .png.", min=30.0, max=2400.0)] = 300.0,
    tags: Annotated[bool, typer.Option("--tags", help="A pair of tags for the sticks instead of a board.")] = False,
    family: Annotated[str, typer.Option(help="With --tags: OpenCV's dictionary.")] = "4X4_50",
    base_id: Annotated[int, typer.Option(help="With --tags: number of the base stick's tag.")] = 0,
    moving_id: Annotated[int, typer.Option(help="With --tags: number of the moving stick's tag.")] = 1,
    side_mm: Annotated[
        float, typer.Option(help="With --tags: side of the black squares, mm.", min=3.0, max=500.0)
    ] = 20.0,
) -> Answer:
    """Make a board to print for 'torsight calibrate', with a bar to check the printer's scale.

    Without a BOARD.toml one is written beside the board: measure a square on the print and put its true size there.
    With --tags a pair of tags is made, one for each stick, and beside it the file for 'torsight track --markers'.

    Example: torsight board board.toml --out board.pdf

    Example: torsight board --tags --side-mm 25 --out tags.pdf
    """
    import tomli_w

    from calibration.boards.board_file import KINDS, read_board
    from calibration.boards.printing import PAGES_MM, draw_board, usual_board

    for name, value, allowed in (("--page", page, tuple(PAGES_MM)), ("--kind", kind, KINDS)):
        if value not in allowed:
            raise ConfigError(f"{name} is not known", where="torsight board", value=value, limit=", ".join(allowed))
    if tags:
        return _tags(description, out, page, dpi, family=family, ids=(base_id, moving_id), side_mm=side_mm)
    chosen = read_board(description) if description else usual_board(kind, page=page)
    toml = tomli_w.dumps(chosen.content()) if description is None else ""
    made = _write(out, draw_board(chosen, page=page), dpi=dpi, toml=toml)
    say(f"Board           {chosen.describe()}, squares of {chosen.square_mm:g} mm, page {page}")
    for path in made:
        say(f"                {path}")
    say("Print at 100 %, measure the bar of 100 mm and a square, glue it on something flat and stiff.")
    return Answer(chosen.content(), files=tuple(made))


def _tags(
    description: Path | None, out: Path, page: str, dpi: float, *, family: str, ids: tuple[int, int], side_mm: float
) -> Answer:
    """Write a pair of tags."""
    import tomli_w

    from calibration.boards.printed_tags import draw_tags, tag_pair

    if description is not None:
        raise ConfigError(
            "--tags makes tags, and no board is described for them",
            where="torsight board",
            value=str(description),
            do="leave away either --tags or the board's file",
        )
    pair = tag_pair(family, base_id=ids[0], moving_id=ids[1], side_mm=side_mm)
    made = _write(out, draw_tags(pair, page=page), dpi=dpi, toml=tomli_w.dumps(pair.content()))
    say(
        f"Tags            {pair.family}, numbers {ids[0]} (base) and {ids[1]} (moving), black squares of {side_mm:g} mm"
    )
    for path in made:
        say(f"                {path}")
    say(
        "Print at 100 %, measure a black square and put its true side into the .toml; cut along the ticks: the white "
        "border belongs to the tag."
    )
    return Answer(pair.content(), files=tuple(made))


def _write(out: Path, drawing: Drawing, *, dpi: float, toml: str) -> list[Path]:
    """Write a page, its picture, and what describes it; return the files."""
    from calibration.boards.printing import write_board

    write_board(out, drawing, dpi=dpi)
    made = [out]
    if out.suffix.lower() != ".png":
        made.append(out.with_suffix(".png"))
        write_board(made[-1], drawing, dpi=dpi)
    if toml:
        made.append(out.with_suffix(".toml"))
        write_text(made[-1], toml)
    return made
