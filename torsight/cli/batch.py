"""``torsight batch``: many experiments, one table of results."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.core.errors import ConfigError
from torsight.core.files.storage import read_json
from torsight.core.words.wording import verdict_sentence


def batch(
    sources: Annotated[list[str], Argument(metavar="FOLDER_OR_GLOB…", help="Where the experiments are.")],
    *,
    out: Annotated[Path, Option(help="Folder for the results.")],
    jobs: Annotated[int, Option(help="Processes on this machine; -1 is one per core.")] = -1,
    scheduler: Annotated[
        str | None, Option(metavar="ADDRESS", help="A running Dask scheduler that does the work instead.")
    ] = None,
    timeout: Annotated[
        float | None, Option(metavar="S", help="Longest time for one experiment; one that takes longer has failed.")
    ] = None,
) -> Answer:
    """Run many experiments and make one table of their results.

    A page shows a small picture of each. A second call runs only experiments that are missing or have changed.
    Experiments of one actuator file that have ``together = true`` in their table ``[discover]`` are also explained
    together, in the folder ``together``.

    Example: torsight batch campaign/ --out results
    """
    from torsight.cli.campaign import explain_campaign, find_experiments, run_campaign, tasks, write_results
    from torsight.core.files.lock import only_writer
    from torsight.report.gallery import write_gallery

    if timeout is not None and not 0.0 < timeout < math.inf:
        raise ConfigError("is no length of time", where="--timeout", value=timeout, limit="more than 0 s")
    todo = tasks(find_experiments(sources), out, limit_s=timeout)
    # Each of two campaigns would write a table in which the other's experiments are missing.
    with only_writer(out):
        with progress_bar() as progress:
            rows = run_campaign(todo, jobs=jobs, scheduler=scheduler, progress=progress)
        page = write_gallery(rows, out)
        for row in rows:
            if row["status"] == "failed":
                say(f"failed: {row['name']}: {row['message']}")
        write_results(rows, out)
        with progress_bar() as progress:
            jointly = explain_campaign(todo, rows, out, progress=progress)
    for folder in jointly:
        say(f"together: {verdict_sentence(read_json(folder / 'discovery.json'))}; report {folder / 'report.html'}")
    done = sum(row["status"] == "done" for row in rows)
    say(f"{done} of {len(rows)} experiments done; table {out / 'results.csv'}, page {page}")
    return Answer({"experiments": rows}, files=(out / "results.csv", out / "results.parquet", page))
