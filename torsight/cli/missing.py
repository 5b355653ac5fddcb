"""``torsight missing``: find what a model of one's own lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.discover import FILES
from torsight.cli.options import Seed
from torsight.core.errors import InputError
from torsight.core.files.paths import require_apart
from torsight.core.files.provenance import require_each_once
from torsight.core.files.storage import read_json, write_json, write_table, write_text

FAILURES: Final = "model_errors.txt"
"""File for the tracebacks of a model that failed during a fit."""


def missing(
    model: Annotated[Path, Argument(metavar="MODEL.py", help="Model file: predict, parameters, output, …")],
    records: Annotated[list[Path], Argument(metavar="RECORD…", help="Tables, CSV or Parquet, of one rig.")],
    *,
    out: Annotated[Path, Option(help="Folder for the results.")],
    seed: Seed = 0,
) -> Answer:
    """Find what a model of your own lacks.

    The result is the missing effect, the error before and after, and a better model. MODEL.py defines
    predict(p, record), which gives the output for every row of a record; parameters, which the fit may change; output,
    the measured column; and, optionally, candidates (effects that may be missing), laws, initial, blocks, sigma,
    resolution, rest, drivers, time. Or it defines problem(records). A small model file:

    \b
    import numpy as np
    from torsight.discovery import candidate, parameter
    output = "level_m"
    parameters = [parameter("gain", 0.5, lower=0), parameter("offset_m", 0.0)]
    candidates = [candidate("saturation", parameter("bend", 0.1, null=0))]
    def predict(p, record):
        u = record.pump_v
        return p.offset_m + p.gain * u - p.bend * u**2

    Example: torsight missing model.py a.csv b.csv --out found
    """  # noqa: D301 - \b keeps the lines of the example apart in the help
    from torsight.discovery.own.syntax import parsed

    parsed(model)  # before the imports, which take seconds
    from torsight.core.files.lock import only_writer
    from torsight.discovery.own.answer.saved import write_model
    from torsight.discovery.own.find import find_missing
    from torsight.discovery.own.model.model_file import problem_of
    from torsight.report.own_report import write_own_report

    require_apart([out / name for name in (*FILES, FAILURES)], [model, *records])
    require_each_once(records)
    problem = problem_of(model, records)
    with only_writer(out), progress_bar() as progress:
        found = find_missing(problem, seed=seed, progress=progress)
        _drop_laws(out)
        write_json(out / "discovery.json", found.to_json())
        write_model(out / "model.json", found.model(), model_file=model)
        write_table(out / "curves.csv", found.curves())
        chosen = [law for law in found.laws if law.chosen]
        for law in chosen:
            write_table(out / law.csv_name, law.table())
        (out / FAILURES).unlink(missing_ok=True)
        if found.failures:
            write_text(out / FAILURES, "\n\n".join(found.failures) + "\n")
        write_own_report(found, out, model=model, records=records)
    say(found.summary())
    if found.failures:
        say(f"Tracebacks        {out / FAILURES}")
    say(f"Report            {out / 'report.html'}", f"Results           {out}")
    made = [*FILES, *(law.csv_name for law in chosen), *([FAILURES] if found.failures else [])]
    return Answer(found.to_json(), files=tuple(out / name for name in made))


def _drop_laws(out: Path) -> None:
    """Delete the laws of an earlier answer, which its ``discovery.json`` names."""
    try:
        named = [Path(str(law.get("file"))).name for law in read_json(out / "discovery.json").get("laws", [])]
    except (InputError, AttributeError, TypeError):
        return  # no earlier answer, or nothing of ours
    for name in named:
        if name.startswith("law_") and name.endswith(".csv"):
            (out / name).unlink(missing_ok=True)
