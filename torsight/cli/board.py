"""``torsight board``: a calibration board, or a pair of tags for the sticks, to print at true scale."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import say
from torsight.core.errors import ConfigError
from torsight.core.files.storage import write_text

if TYPE_CHECKING:
    from calibration.boards.printing import Drawing


def board(
    description: Annotated[
        Path | None, Argument(metavar="BOARD.toml", help="The board; by default one that fits the page.")
    ] = None,
    *,
    out: Annotated[
        Path, Option(metavar="FILE.svg", help="File to write: .svg or .pdf at true scale (a .png comes with it).")
    ],
    page: Annotated[str, Option(help="Page: a5, a4, a3, a2, letter or tabloid.")] = "a4",
    kind: Annotated[str, Option(help="Without BOARD.toml: charuco or chessboard.")] = "charuco",
    dpi: Annotated[float, Option(help="Pixels per inch of the .png.", min=30.0, max=2400.0)] = 300.0,
    tags: Annotated[bool, Option("--tags", help="A pair of tags for the sticks instead of a board.")] = False,
    family: Annotated[str, Option(help="With --tags: OpenCV's dictionary.")] = "4X4_50",
    base_id: Annotated[int, Option(help="With --tags: number of the base stick's tag.")] = 0,
    moving_id: Annotated[int, Option(help="With --tags: number of the moving stick's tag.")] = 1,
    side_mm: Annotated[float, Option(help="With --tags: side of the black squares, mm.", min=3.0, max=500.0)] = 20.0,
) -> Answer:
    """Make a board to print for 'torsight calibrate'.

    A bar beside it checks the printer's scale. Without a BOARD.toml one is written beside the board: measure a
    square on the print and put its true size there. With --tags a pair of tags is made, one for each stick,
    together with the file for 'torsight track --markers'.

    Example: torsight board board.toml --out board.pdf

    Example: torsight board --tags --side-mm 25 --out tags.pdf
    """
    import tomli_w

    from calibration.boards.board_file import KINDS, read_board
    from calibration.boards.printing import PAGES_MM, draw_board, draw_tags, tag_pair, usual_board

    for name, value, allowed in (("--page", page, tuple(PAGES_MM)), ("--kind", kind, KINDS)):
        if value not in allowed:
            raise ConfigError(f"{name} is not known", where="torsight board", value=value, limit=", ".join(allowed))
    if tags:
        if description is not None:
            raise ConfigError(
                "--tags makes tags, and no board is described for them",
                where="torsight board",
                value=str(description),
                do="leave out either --tags or the board's file",
            )
        content = tag_pair(family, base_id=base_id, moving_id=moving_id, side_mm=side_mm)
        drawing = draw_tags(content, page=page)
        numbers = f"numbers {base_id} (base) and {moving_id} (moving)"
        lines = (
            f"Tags            {content['family']}, {numbers}, black squares of {side_mm:g} mm",
            (
                "Print at 100 %, measure a black square and put its true side into the .toml; cut along the ticks: "
                "the white border belongs to the tag."
            ),
        )
    else:
        made = read_board(description) if description else usual_board(kind, page=page)
        content, drawing = made.content(), draw_board(made, page=page)
        lines = (
            f"Board           {made.describe()}, squares of {made.square_mm:g} mm, page {page}",
            "Print at 100 %, measure the bar of 100 mm and a square, glue it on something flat and stiff.",
        )
    files = _write(out, drawing, dpi=dpi, toml=tomli_w.dumps(content) if description is None else "")
    say(lines[0], *(f"                {path}" for path in files), lines[1])
    return Answer(content, files=tuple(files))


def _write(out: Path, drawing: Drawing, *, dpi: float, toml: str) -> list[Path]:
    """Write a page, its picture, and its description in TOML; return the files."""
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
