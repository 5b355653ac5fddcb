"""Workers of a campaign: its tasks run in processes of this machine (joblib), or on an existing Dask cluster.

An experiment with a time limit runs in a further process, which can be killed.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

from torsight.core.errors import ConfigError, InputError, NoResultError

Task = TypeVar("Task")
Row = TypeVar("Row")

PATIENCE = "10s"
"""Timeout for the answer of a Dask scheduler."""
_WATCH: Final = "end with the campaign"


def on_this_machine(do: Callable[[Task], Row], todo: Sequence[Task], jobs: int) -> Iterator[Row]:
    """Yield the result of ``do`` for every task as it is ready; ``jobs`` processes, -1: one per core."""
    from joblib import Parallel, delayed

    pool = Parallel(n_jobs=processes(jobs, tasks=len(todo)), return_as="generator_unordered", batch_size=1)
    yield from pool(delayed(_for)(os.getpid(), do, task) for task in todo)


def processes(jobs: int, *, tasks: int) -> int:
    """Return the number of processes for ``--jobs``: never more than there are tasks."""
    from joblib import cpu_count

    cores = cpu_count()
    most = 4 * cores  # a choice: more only take memory from each other
    if jobs != -1 and not 1 <= jobs <= most:
        raise ConfigError(
            "is no number of processes",
            where="--jobs",
            value=jobs,
            limit=f"1 to {most} on this machine's {cores} cores, or -1 for one per core",
        )
    return max(1, min(cores if jobs == -1 else jobs, tasks))


def _for(parent: int, do: Callable[[Task], Row], task: Task) -> Row:
    """Run one task in a process that ends when the campaign ends, even when the campaign is killed."""
    if os.getpid() != parent and not any(thread.name == _WATCH for thread in threading.enumerate()):
        threading.Thread(target=_end_with, args=(parent,), name=_WATCH, daemon=True).start()
    return do(task)


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.2)
    for process in tuple(running):
        end(process)
    os._exit(1)


def on_cluster(do: Callable[[Task], Row], todo: Sequence[Task], scheduler: str) -> Iterator[Row]:
    """Yield the result of ``do`` for every task as it is ready, from the Dask scheduler at an address."""
    try:
        # imported by name: the extra is optional and its types are not
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise ConfigError(
            "--scheduler needs Dask", where="torsight batch", do="install it with: pip install 'torsight[cluster]'"
        ) from error
    try:
        client = distributed.Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise InputError(
            "no Dask scheduler answers", where=scheduler, do="start one, and name it as tcp://host:port"
        ) from error
    with client:
        futures = client.map(do, todo, pure=False)
        for _future, row in distributed.as_completed(futures, with_results=True):
            yield row


COMMAND: Final = (sys.executable, "-m", "torsight.cli.main")
running: Final[set[int]] = set()
"""Process ids of the runs that have not ended."""


def run_limited(experiment: Path, *, out: Path, limit_s: float) -> None:
    """Run ``torsight run`` on an experiment; a run that takes longer than the limit, s, is ended without a result.

    Its finished stages are kept, and the next call continues after them.
    """
    words = [*COMMAND, "run", str(experiment), "--out", str(out), "--resume", "--json"]
    # A separate session, so that every process that the run starts can be ended with it.
    child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    running.add(child.pid)
    try:
        answer, errors = child.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired as error:
        raise NoResultError(
            "takes longer than it may",
            where=str(experiment),
            limit=f"{limit_s:g} s",
            do="run it alone, or give a longer --timeout; a second call continues it",
        ) from error
    finally:
        end(child.pid)
        child.communicate()
        running.discard(child.pid)
    if child.returncode != 0:
        # Without a message, the end of the traceback is the most informative part.
        raise NoResultError(_message(answer) or f"ended with {child.returncode}: {errors.strip()[-300:]}")


def end(process: int) -> None:
    """End a run and the processes that it has started, if it still runs."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)


def _message(answer: str) -> str:
    """Return the run's error message; empty where it has none."""
    try:
        return str(json.loads(answer)["error"]["message"])
    except (ValueError, KeyError, TypeError):
        return ""
