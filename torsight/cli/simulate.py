"""``torsight simulate``: the plain model's angles for a temperature log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import say
from torsight.cli.options import Columns, Units, said
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import write_table
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG, MNM, Floats

if TYPE_CHECKING:
    from torsight.actuator.simulation import Simulation


def simulate(
    actuator: Annotated[Path, Argument(metavar="ACTUATOR.toml", help="Characterised values of the rig.")],
    temperature: Annotated[Path, Argument(metavar="TEMPS.csv", help="Temperatures of both springs.")],
    *,
    start_angle: Annotated[float, Option(metavar="DEG", help="Measured angle at the first row, degrees.")],
    out: Annotated[Path, Option(metavar="FILE.csv", help="Table to write (.csv or .parquet).")],
    columns: Columns = None,
    units: Units = None,
) -> Answer:
    """Give the plain model's angles for a temperature log.

    There is an angle at every instant of the log.

    Example: torsight simulate actuator.toml temps.csv --start-angle 177.6 --out angles.csv
    """
    from torsight.actuator.fitted import FittedModel
    from torsight.actuator.model import ActuatorModel
    from torsight.actuator.record.logs import read_log
    from torsight.actuator.spec import read_actuator

    require_apart([out], [actuator, temperature])
    model = ActuatorModel(read_actuator(actuator))
    log = read_log(temperature, **said(columns, units), tell=lambda words: say(f"note: {words}"))
    plain = FittedModel(model, model.nominal())
    found = plain.predict(log, start_angle_rad=start_angle * DEG, where=str(temperature))
    return write_angles_of(out, log, found.simulation, angle_rad=found.angle_rad)


def write_angles_of(
    out: Path, log: TemperatureLog, simulation: Simulation, *, angle_rad: Floats, sigma_rad: Floats | None = None
) -> Answer:
    """Write the angles at a log's instants, NaN as empty fields, and the log's further columns.

    Returns the number of rows, the range and the file.
    """
    columns = {
        "time_s": log.time_s,
        "angle_deg": angle_rad / DEG,
        **({} if sigma_rad is None else {"angle_sigma_deg": sigma_rad / DEG}),
        "xi_a": simulation.xi_a,
        "xi_b": simulation.xi_b,
        "friction_mnm": simulation.friction_nm / MNM,
    }
    # A merged table is a log, too: its angle is not the model's.
    write_table(out, {**columns, **{name: kept for name, kept in log.extra.items() if name not in columns}})
    known_deg = angle_rad[np.isfinite(angle_rad)] / DEG
    extremes = {"angle_min_deg": known_deg.min(), "angle_max_deg": known_deg.max()} if len(known_deg) else {}
    if sigma_rad is not None and np.isfinite(sigma_rad).any():
        extremes["angle_sigma_median_deg"] = np.nanmedian(sigma_rad) / DEG
        extremes["angle_sigma_max_deg"] = np.nanmax(sigma_rad) / DEG
    return Answer({"rows": len(angle_rad), "rows_with_angle": len(known_deg), **extremes}, files=(out,))
