"""Many experiments: the same run for each, one table of results, one page of small pictures.

A campaign is a set of independent tasks: one experiment in, one folder and one row of the table out. A task that fails
gives a row with the reason; a task whose results exist and whose inputs have not changed since is not repeated.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.cli.discover import explain_together
from torsight.cli.experiment_file import Experiment, read_experiment
from torsight.cli.run import TOGETHER, UNFINISHED, provenance_of, run_experiment
from torsight.cli.workers import on_cluster, on_this_machine, run_limited
from torsight.core.errors import InputError, NoResultError, TorsightError, refused_by_system
from torsight.core.files.paths import matching
from torsight.core.files.provenance import file_hash
from torsight.core.files.storage import json_text, read_json, write_table
from torsight.core.progress import Progress, silent

RESULT_COLUMNS: Final = (
    "name", "status", "message", "frames", "valid_share", "angle_min_deg", "angle_max_deg", "angle_sigma_deg",
    "offset_s", "tau_c_mnm", "tau_c_lo_mnm", "tau_c_hi_mnm", "verdict", "effects", "rmse_before_deg",
    "rmse_after_deg", "noise_floor_deg", "folder",
)  # fmt: skip
"""Columns of ``results.csv`` and ``results.parquet``, one row per experiment."""


@dataclass(frozen=True, slots=True)
class Task:
    """One experiment file, the folder for its results, and the time limit, s (None: no limit)."""

    name: str
    experiment: Path
    folder: Path
    limit_s: float | None = None


def find_experiments(sources: Iterable[str]) -> list[Path]:
    """Return every experiment file in folders (searched to all depths) and globs, sorted, each once."""
    found: list[Path] = []
    for source in sources:
        path = Path(source)
        if path.is_dir():
            files = list(path.rglob("*experiment*.toml"))
        elif path.exists():
            files = [path]
        else:
            files = [item / "experiment.toml" if item.is_dir() else item for item in matching(path)]
        if not files:
            raise InputError(
                "holds no experiment", where=source, do="name folders with an experiment.toml, or the files themselves"
            )
        found += files
    return sorted({item.resolve() for item in found})


def tasks(experiments: Sequence[Path], out: Path, *, limit_s: float | None = None) -> list[Task]:
    """Return one task per experiment, with short, readable and unique names."""
    stems = [_name(path) for path in experiments]
    alone = {stem for stem in stems if stems.count(stem) == 1}
    names: list[str] = []
    for stem in stems:
        numbered = (f"{stem}-{number}" for number in itertools.count(1))
        names.append(stem if stem in alone else next(name for name in numbered if name not in alone.union(names)))
    return [Task(name, path, out / name, limit_s) for name, path in zip(names, experiments, strict=True)]


def _name(path: Path) -> str:
    stem = path.parent.name if path.stem == "experiment" else path.stem
    return re.sub(r"[^\w.-]+", "_", stem) or "experiment"


def run_task(task: Task) -> dict[str, Any]:
    """Run one experiment, or read its results where they are current; return the row, also of one that failed."""
    from torsight.cli.summary import result_row

    try:
        experiment = read_experiment(task.experiment)
        if not is_current(task, experiment):
            if task.limit_s is None:
                run_experiment(experiment, out=task.folder, resume=True)
            else:
                run_limited(task.experiment, out=task.folder, limit_s=task.limit_s)
        return {"name": task.name, "status": "done", "message": "", **result_row(task.folder)}
    except TorsightError as error:
        message = str(error)
    except OSError as error:
        message = str(refused_by_system(error))
    except Exception as error:  # noqa: BLE001 - a failure of one record, of whatever kind, must not stop the others
        message = f"internal error, {type(error).__name__}: {error}; run it alone with --debug"
    return {"name": task.name, "status": "failed", "message": message, "folder": str(task.folder)}


def is_current(task: Task, experiment: Experiment) -> bool:
    """Return whether the folder holds a complete run of exactly this experiment's inputs and settings."""
    path = task.folder / "provenance.json"
    if not path.exists() or not (task.folder / "report.html").exists() or (task.folder / UNFINISHED).exists():
        return False
    try:
        recorded = read_json(path)
    except InputError:
        return False
    now = provenance_of(experiment, task.folder)
    keys = ("inputs", "configuration", "versions")
    return json_text({k: recorded.get(k) for k in keys}) == json_text({k: now[k] for k in keys})


def explain_campaign(
    todo: Sequence[Task], rows: Sequence[dict[str, Any]], out: Path, *, progress: Progress
) -> list[Path]:
    """Explain the records of each rig together where their experiments ask for it; return the folders of the results.

    Raises InputError, NoResultError when the records of one rig cannot be explained together.
    """
    rigs: dict[str, list[tuple[Task, Path]]] = {}
    for task, row in zip(todo, rows, strict=True):
        if row["status"] == "done" and (experiment := read_experiment(task.experiment)).together is True:
            rigs.setdefault(file_hash(experiment.actuator), []).append((task, experiment.actuator))
    several = [records for records in rigs.values() if len(records) > 1]
    folders = [out / (TOGETHER if number == 1 else f"{TOGETHER}-{number}") for number in range(1, len(several) + 1)]
    for records, folder in zip(several, folders, strict=True):
        merged = [task.folder / "merged.csv" for task, _ in records]
        explain_together(merged, records[0][1], out=folder, progress=progress)
    return folders


def run_campaign(
    todo: Sequence[Task], *, jobs: int = -1, scheduler: str | None = None, progress: Progress = silent
) -> list[dict[str, Any]]:
    """Run every task and return the rows in the order of the tasks; ``progress`` is called after each.

    The tasks run in ``jobs`` processes on this machine (-1: one per core), or on the Dask scheduler at an address.
    """
    rows: dict[str, dict[str, Any]] = {}
    progress("experiments", 0, len(todo))
    found = on_cluster(run_task, todo, scheduler) if scheduler else on_this_machine(run_task, todo, jobs)
    for row in found:
        rows[row["name"]] = row
        progress("experiments", len(rows), len(todo))
    return [rows[task.name] for task in todo]


def write_results(rows: Sequence[dict[str, Any]], out: Path) -> None:
    """Write the table of results as CSV and Parquet."""
    text = ("name", "status", "message", "verdict", "effects", "folder")
    columns = {
        name: [row.get(name, "") for row in rows] if name in text else np.array([row.get(name) for row in rows], float)
        for name in RESULT_COLUMNS
    }
    write_table(out / "results.csv", columns)
    write_table(out / "results.parquet", columns)
    failed = [row for row in rows if row["status"] == "failed"]
    if failed and len(failed) == len(rows):
        count = f"all {len(rows)} experiments" if len(rows) > 1 else "the only experiment"
        raise NoResultError(
            f"{count} failed, the first ({failed[0]['name']}) with: {failed[0]['message']}",
            where=str(out / "results.csv"),
        )
