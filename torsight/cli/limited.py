"""One experiment of a campaign with a time limit: a run in a separate process, which can be killed."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

from torsight.core.errors import NoResultError

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


def end_all() -> None:
    """End every run that this process has started."""
    for process in tuple(running):
        end(process)


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
