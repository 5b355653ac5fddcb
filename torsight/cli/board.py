"""``torsight board``: a calibration board to print, at true scale."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from torsight.cli.answer import Answer
from torsight.core.errors import ConfigError


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
) -> Answer:
    """Make a board to print for 'torsight calibrate', with a bar to check the printer's scale.

    Without a BOARD.toml one is written beside the board: measure a square on the print and put its true size there.

    Example: torsight board board.toml --out board.pdf
    """
    import tomli_w

    from calibration.board import KINDS, read_board
    from calibration.printing import PAGES_MM, draw_board, usual_board, write_board
    from torsight.cli.console import say
    from torsight.core.storage import write_text

    for name, value, allowed in (("--page", page, tuple(PAGES_MM)), ("--kind", kind, KINDS)):
        if value not in allowed:
            raise ConfigError(f"{name} is not known", where="torsight board", value=value, limit=", ".join(allowed))
    chosen = read_board(description) if description else usual_board(kind, page=page)
    drawing = draw_board(chosen, page=page)
    write_board(out, drawing, dpi=dpi)
    made = [out]
    if out.suffix.lower() != ".png":
        made.append(out.with_suffix(".png"))
        write_board(made[-1], drawing, dpi=dpi)
    if description is None:
        made.append(out.with_suffix(".toml"))
        write_text(made[-1], tomli_w.dumps(chosen.content()))
    say(f"Board           {chosen.describe()}, squares of {chosen.square_mm:g} mm, page {page}")
    for path in made:
        say(f"                {path}")
    say("Print at 100 %, measure the bar of 100 mm and a square, glue it on something flat and stiff.")
    return Answer(chosen.content(), files=tuple(made))
