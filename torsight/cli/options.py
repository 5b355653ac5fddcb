"""Options that several commands have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypedDict

from typer import Option

ActuatorFile = Annotated[Path, Option(metavar="ACTUATOR.toml", help="Characterised values of the rig.")]
CameraFile = Annotated[Path | None, Option(metavar="CAMERA.toml", help="Calibrated camera.")]
Fps = Annotated[
    float | None, Option(metavar="HZ", help="Frames a second of pictures, or at which a slow-motion film was captured.")
]
OpenView = Annotated[bool, Option("--view", help="Open the recording in Rerun at the end.")]
Seed = Annotated[int, Option(help="Seed of every random draw.", min=0)]
Serve = Annotated[bool, Option("--serve", help="Show the recording in a browser on this computer.")]
WebPort = Annotated[
    int | None, Option(min=0, max=65535, help="Port for the browser; 9090 where it is free, 0 takes any.")
]

Columns = Annotated[
    str | None,
    Option(
        "--columns",
        metavar="KEY=NAME,…",
        help='Columns of the log by name: "time=Time,a=Temp A (°C),b=Temp B (°C)"; also date, heat_a, heat_b.',
    ),
]
Units = Annotated[
    str | None, Option("--units", metavar="KEY=UNIT,…", help='Units that the log does not state: "time=ms,a=°F,b=°F".')
]


class Said(TypedDict):
    """Values of the options ``--columns`` and ``--units``, as the readers of logs take them."""

    columns: dict[str, str]
    units: dict[str, str]


def said(columns: str | None, units: str | None) -> Said:
    """Return the columns and units that the options name."""
    from sync.log.column_names import chosen_columns, parse_entries

    found = Said(columns=parse_entries(columns, option="--columns"), units=parse_entries(units, option="--units"))
    chosen_columns(**found, where="command line")
    return found
