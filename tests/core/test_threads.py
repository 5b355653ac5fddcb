"""Linear algebra with one thread, whatever was asked for."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from torsight.core.parallel.threads import one_thread


def blas_threads() -> set[int]:
    np.linalg.svd(np.eye(3))
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_one_thread_inside_and_what_it_was_after_it() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        assert blas_threads() == {2}
        with one_thread():
            assert blas_threads() == {1}
        assert blas_threads() == {2}


def with_two_threads_asked_for(script: str) -> str:
    """Return what a script prints in a process that was told to compute with two threads."""
    more = {**os.environ, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", script], env=more, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_libraries_that_are_loaded_inside_have_one_thread_too_and_nothing_stays_set() -> None:
    script = (
        "import os, threadpoolctl, torsight.core.parallel.threads as t\n"
        "before = dict(os.environ)\n"
        "@t.one_thread()\n"
        "def inside():\n"
        "    import numpy\n"
        "    with t.one_thread():\n"
        "        pass\n"
        "    return {l['num_threads'] for l in threadpoolctl.threadpool_info() if l['user_api'] == 'blas'}\n"
        "print(inside(), dict(os.environ) == before)"
    )
    assert with_two_threads_asked_for(script) == "{1} True"


def test_a_command_computes_with_one_thread_even_when_more_are_asked_for() -> None:
    script = (
        "import torsight.cli.main, numpy, threadpoolctl;"
        "print({l['num_threads'] for l in threadpoolctl.threadpool_info() if l['user_api'] == 'blas'})"
    )
    assert with_two_threads_asked_for(script) == "{1}"
