"""The options ``--columns`` and ``--units`` of the commands that read a temperature log."""

from __future__ import annotations

from typing import Annotated, TypedDict

import typer

Columns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="KEY=NAME,…",
        help='Columns of the log by name: "time=Time,a=Temp A (°C),b=Temp B (°C)"; also date, heat_a, heat_b.',
    ),
]
Units = Annotated[
    str | None,
    typer.Option("--units", metavar="KEY=UNIT,…", help='Units that the log does not say: "time=ms,a=°F,b=°F".'),
]


class Said(TypedDict):
    """What the options say, as the readers of logs take it."""

    columns: dict[str, str]
    units: dict[str, str]


def said(columns: str | None, units: str | None) -> Said:
    """Return what the options say.

    Raises
    ------
    ConfigError
        When one of them is no list of ``KEY=NAME``, or has a key or a unit that is not known.
    """
    from sync.log.column_names import chosen_columns, parse_entries

    found = Said(
        columns=parse_entries(columns, option="--columns"),
        units=parse_entries(units, option="--units"),
    )
    chosen_columns(**found, where="command line")
    return found
