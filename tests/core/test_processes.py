"""Work in copies of the process: the same results, and nothing that stays behind."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from torsight.core.parallel.processes import in_copies
from torsight.core.parallel.threads import go_on

pytestmark = pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods() or sys.platform == "darwin",
    reason="this system's processes cannot be copied",
)


@pytest.fixture(autouse=True)
def two_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torsight.core.parallel.threads.WORKERS", 2)


def test_results_come_in_order_from_two_other_processes_and_what_was_known_as_itself() -> None:
    known = {"array": np.arange(3.0), "function": lambda x: x + 1}
    local = [10]

    def work(item: int) -> tuple[int, int, object, object, object]:
        local[0] += item
        time.sleep(0.05)
        return item, os.getpid(), known["array"], known["function"], known["array"] * item

    told: list[float] = []
    found = in_copies(range(6), work, known=known, step="s", progress=lambda _step, done, _total: told.append(done))
    assert [item for item, *_ in found] == list(range(6))
    assert len({pid for _, pid, *_ in found}) == 2
    assert os.getpid() not in {pid for _, pid, *_ in found}
    assert all(array is known["array"] and function is known["function"] for _, _, array, function, _ in found)
    np.testing.assert_array_equal(found[5][4], [0.0, 5.0, 10.0])
    assert told == [0, 1, 2, 3, 4, 5, 6]
    assert local == [10]


def test_a_single_item_and_work_within_a_copy_stay_in_their_process() -> None:
    assert in_copies([7], lambda item: (item, os.getpid()), known=None) == [(7, os.getpid())]

    def outer(_item: int) -> bool:
        return set(in_copies([0, 1], lambda _: os.getpid(), known=None)) == {os.getpid()}

    assert in_copies([0, 1], outer, known=None) == [True, True]


def test_a_daemon_that_may_have_no_children_works_in_threads() -> None:
    context = multiprocessing.get_context("fork")
    with context.Pool(1) as pool:
        assert pool.apply(_squares) == [0, 1, 4]


def _squares() -> list[int]:
    return in_copies(range(3), lambda item: item * item, known=None)


def test_an_error_arrives_with_its_type() -> None:
    with pytest.raises(ZeroDivisionError):
        in_copies([2, 0], lambda item: 1 / item, known=None)


def test_what_a_killed_copy_leaves_is_done_here() -> None:
    here = os.getpid()

    def work(item: int) -> int:
        if item == 3 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return item * 2

    assert in_copies(range(8), work, known=None) == list(range(0, 16, 2))


def test_who_is_asked_to_end_does_not_wait_for_work_that_is_under_way(tmp_path: Path) -> None:
    steps, most = tmp_path / "steps", 6000
    steps.touch()

    def work(item: int) -> None:
        for _ in range(item * most):
            go_on()
            with steps.open("ab") as file:
                file.write(b".")
            time.sleep(0.01)

    def asked(_step: str, done: float, _total: float | None) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        in_copies([0, 1, 1], work, known=None, progress=asked)
    assert steps.stat().st_size < most


def test_copies_end_with_a_process_that_is_killed() -> None:
    script = (
        "import os, time\n"
        "from torsight.core.parallel.processes import in_copies\n"
        "def work(item):\n"
        # In one piece, so that the copies' lines do not mix where output is not buffered.
        "    os.write(1, b'%d\\n' % os.getpid())\n"
        "    time.sleep(600)\n"
        "in_copies([0, 1], work, known=None)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        copies = {running.stdout.readline() for _ in range(2)}
        running.kill()
        running.wait()
        # The pipe ends when nobody can write to it any more.
        assert running.stdout.read() == ""
    assert len(copies) == 2
