"""Linear algebra with one thread, whatever was asked for."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from torsight.core.parallel.threads import in_parallel, one_thread, with_help


def blas_threads() -> set[int]:
    np.linalg.svd(np.eye(3))
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_one_thread_inside_and_what_it_was_after_it() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        assert blas_threads() == {2}
        with one_thread():
            assert blas_threads() == {1}
        assert blas_threads() == {2}


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
    more = {**os.environ, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", script], env=more, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{1} True"


def test_a_command_computes_with_one_thread_even_when_more_are_asked_for() -> None:
    script = (
        "import torsight.cli.main, numpy, threadpoolctl;"
        "print({l['num_threads'] for l in threadpoolctl.threadpool_info() if l['user_api'] == 'blas'})"
    )
    more = {**os.environ, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", script], env=more, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{1}"


def shared_out(count: int) -> int:
    """Let so many items be worked out; return in how many threads that was done."""
    found = with_help(range(count), lambda item: (item, threading.get_ident()))
    assert [item for item, _ in found] == list(range(count))
    return len({thread for _, thread in found})


def test_the_only_fit_has_help_and_one_beside_another_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torsight.core.parallel.threads.WORKERS", 2)
    assert [shared_out(count) for count in (0, 1, 2, 7)] == [0, 1, 2, 2]
    together = threading.Barrier(2)

    def beside_another(_item: int) -> int:
        together.wait(60)
        threads = shared_out(4)
        together.wait(60)
        return threads

    assert in_parallel([0, 1], beside_another) == [1, 1]
    assert in_parallel([4], shared_out) == [2]


def test_an_error_in_either_half_is_the_caller_s_and_there_is_help_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torsight.core.parallel.threads.WORKERS", 2)
    for wrong in (0, 3):
        with pytest.raises(ZeroDivisionError):
            with_help(range(4), lambda item, wrong=wrong: 1 / (item - wrong))
    assert shared_out(4) == 2
