"""A campaign: one row per experiment whatever becomes of it, nothing done twice, here or on a cluster."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.cli.bad_inputs import make_world
from tests.command_line import leave
from tests.core.test_lock import HOLD
from tests.made_up_run import write_made_up_run
from torsight.cli import campaign, workers
from torsight.cli.campaign import RESULT_COLUMNS, find_experiments, is_current, run_task, tasks
from torsight.cli.experiment_file import read_experiment
from torsight.cli.run import provenance_of
from torsight.core.errors import InputError, NoResultError
from torsight.core.files import lock
from torsight.core.files.storage import is_running, write_json


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with ``rigs/`` (one, two, broken) and ``out/``, where one and two are done already."""
    made = tmp_path_factory.mktemp("campaign")
    make_world(made / "rigs" / "one")
    for name in ("two", "broken"):
        shutil.copytree(made / "rigs" / "one", made / "rigs" / name)
    (made / "rigs" / "broken" / "temps.csv").write_text("time_s,temp_a_c\n0,1\n")
    for name in ("one", "two"):
        folder = made / "out" / name
        write_made_up_run(folder, half_cycles=2, rate_hz=2.0)
        experiment = read_experiment(made / "rigs" / name / "experiment.toml")
        write_json(folder / "provenance.json", provenance_of(experiment, folder))
        (folder / "report.html").write_text("a report")
    return made


@pytest.fixture
def made(template: Path, tmp_path: Path) -> Path:
    """Return the campaign's folder, to be changed."""
    return Path(shutil.copytree(template, tmp_path, dirs_exist_ok=True))


def _contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_two_campaigns_do_not_fill_one_folder(
    made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table of either would say that the other's experiments have failed."""
    monkeypatch.setattr(lock, "only_writer", partial(lock.only_writer, patience_s=0.1))
    with subprocess.Popen([sys.executable, "-c", HOLD, str(made / "out")], stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        assert leave("batch", str(made / "rigs"), "--out", str(made / "out")) == 3
        first.kill()
    assert "out: is being filled by another torsight; allowed one at a time" in capsys.readouterr().err
    assert not (made / "out" / "results.csv").exists()


def test_a_failed_record_stops_nothing_and_nothing_is_done_twice(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = made / "out"
    before = _contents(out)
    assert leave("batch", str(made / "rigs"), "--out", str(out), "--jobs", "2") == 0
    told = capsys.readouterr().err
    assert "failed: broken: " in told
    assert "temps.csv, line 1: has no column 'temp_b_c'" in told
    assert "2 of 3 experiments done" in told
    table = pd.read_csv(out / "results.csv")
    assert tuple(table.columns) == RESULT_COLUMNS
    assert table["name"].tolist() == ["broken", "one", "two"]
    assert table["status"].tolist() == ["failed", "done", "done"]
    assert table["tau_c_mnm"].round(3).tolist()[1:] == [0.793, 0.793]
    assert table["effects"].tolist()[1:] == ["sensor_lag", "sensor_lag"]
    pd.testing.assert_frame_equal(pd.read_parquet(out / "results.parquet").drop(columns="message"), _typed(table))
    page = (out / "index.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4
    assert "broken" in page
    assert {path: (out / path).read_bytes() for path in before} == before
    first = _contents(out)
    assert leave("batch", str(made / "rigs"), "--out", str(out), "--jobs", "1") == 0
    assert _contents(out) == first


def _typed(table: pd.DataFrame) -> pd.DataFrame:
    texts = ["name", "status", "verdict", "effects", "folder"]
    return table.drop(columns="message").fillna(dict.fromkeys(texts, "")).astype(dict.fromkeys(texts, "str"))


def test_only_what_has_changed_is_done_again(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def run_experiment(_: Any, *, out: Path, resume: bool) -> Path:
        assert resume
        asked.append(out.name)
        return out

    monkeypatch.setattr("torsight.cli.campaign.run_experiment", run_experiment)
    rows = campaign.run_campaign(tasks(find_experiments([str(made / "rigs" / "*")]), made / "out"), jobs=1)
    assert asked == ["broken"]
    assert [row["status"] for row in rows] == ["failed", "done", "done"]  # nothing was left to read for "broken"
    actuator = made / "rigs" / "two" / "actuator.toml"
    actuator.write_text(actuator.read_text().replace("tau_c_mnm = 0.8", "tau_c_mnm = 0.9"))
    campaign.run_campaign(tasks(find_experiments([str(made / "rigs" / "t*")]), made / "out"), jobs=1)
    assert asked == ["broken", "two"]


@pytest.mark.parametrize("left", [".run.json", "report.html", "provenance.json"])
def test_an_unfinished_run_is_not_current(made: Path, left: str) -> None:
    (task,) = tasks([made / "rigs" / "one" / "experiment.toml"], made / "out")
    experiment = read_experiment(task.experiment)
    assert is_current(task, experiment)
    if left == ".run.json":
        (task.folder / left).write_text("{}")
    elif left == "report.html":
        (task.folder / left).unlink()
    else:
        (task.folder / left).write_text("{ damaged")
    assert not is_current(task, experiment)


def test_a_defect_of_ours_is_a_row_too(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> Path:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr("torsight.cli.campaign.run_experiment", broken)
    (task,) = tasks([made / "rigs" / "broken" / "experiment.toml"], made / "out")
    row = run_task(task)
    assert row["status"] == "failed"
    assert "internal error, ZeroDivisionError: oh" in row["message"]


@pytest.mark.parametrize("jobs", [0, -2, 100_000])
def test_no_machine_is_asked_for_more_than_it_can_bear(jobs: int, made: Path) -> None:
    assert leave("batch", str(made / "rigs"), "--out", str(made / "out"), "--jobs", str(jobs)) == 2


def test_no_more_processes_than_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joblib.cpu_count", lambda: 64)
    assert workers.processes(-1, tasks=3) == 3
    assert workers.processes(100, tasks=3) == 3
    assert workers.processes(-1, tasks=1000) == 64


CHILDREN = {
    "hangs": ("import time; time.sleep(1000)", "takes longer than it may; allowed 0.5 s"),
    "fails": ("""print('{"error": {"message": "no such film"}}'); raise SystemExit(3)""", "no such film"),
    "dies": ("import os; os.abort()", "ended with -6"),
}


@pytest.mark.parametrize("child", CHILDREN)
def test_a_record_that_takes_too_long_is_ended(child: str, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, words = CHILDREN[child]
    monkeypatch.setattr(workers, "COMMAND", (sys.executable, "-c", code))
    (task,) = tasks(
        [made / "rigs" / "broken" / "experiment.toml"], made / "out", limit_s=0.5 if child == "hangs" else 60
    )
    row = run_task(task)
    assert row["status"] == "failed"
    assert words in row["message"]
    assert workers.running == set()


def test_a_limit_ends_what_the_run_has_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "import subprocess, sys, time, pathlib;"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(1000)']);"
        f"pathlib.Path({str(tmp_path / 'child')!r}).write_text(str(child.pid)); time.sleep(1000)"
    )
    monkeypatch.setattr(workers, "COMMAND", (sys.executable, "-c", code))
    with pytest.raises(NoResultError, match="takes longer"):
        workers.run_limited(tmp_path / "experiment.toml", out=tmp_path, limit_s=3.0)
    if (tmp_path / "child").exists():  # a machine that is slow has not come so far
        process = int((tmp_path / "child").read_text())
        until = time.monotonic() + 30.0
        while _lives(process) and time.monotonic() < until:
            time.sleep(0.05)  # a killed process is gone as soon as the system comes to it
        assert not _lives(process)


def _lives(process: int) -> bool:
    try:
        return is_running(process) and Path(f"/proc/{process}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("limit", ["0", "-3", "nan", "inf"])
def test_a_limit_that_is_none(limit: str, made: Path) -> None:
    assert leave("batch", str(made / "rigs"), "--out", str(made / "out"), "--timeout", limit) == 2


def test_names_are_short_readable_and_different(tmp_path: Path) -> None:
    files = [Path("/a/rig/experiment.toml"), Path("/b/rig/experiment.toml"), Path("/c/rig-1.toml"), Path("/d/x y.toml")]
    assert [task.name for task in tasks(files, tmp_path)] == ["rig-2", "rig-3", "rig-1", "x_y"]


def test_when_all_fail_the_table_is_there_and_it_is_said(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = made / "none"
    assert leave("batch", str(made / "rigs" / "broken"), "--out", str(out), "--jobs", "1") == 4
    assert "the only experiment failed" in capsys.readouterr().err
    assert pd.read_csv(out / "results.csv")["status"].tolist() == ["failed"]


def test_the_same_on_a_cluster_that_runs_already(made: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra torsight[cluster]")
    out, here = made / "out", made / "here"
    shutil.copytree(out, here)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None
    ) as cluster:
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
        words = ("batch", str(made / "rigs"), "--out", str(out), "--scheduler", cluster.scheduler_address)
        assert leave(*words) == 0
    assert leave("batch", str(made / "rigs"), "--out", str(here), "--jobs", "1") == 0
    there = pd.read_csv(out / "results.csv").drop(columns="folder")
    pd.testing.assert_frame_equal(there, pd.read_csv(here / "results.csv").drop(columns="folder"))


def test_a_scheduler_that_does_not_answer_is_told(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs the extra torsight[cluster]")
    monkeypatch.setattr(workers, "PATIENCE", "0.5s")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        campaign.run_campaign(
            tasks(find_experiments([str(made / "rigs")]), made / "out"), scheduler="tcp://127.0.0.1:9"
        )


def test_provenance_names_the_configuration(made: Path) -> None:
    content = json.loads((made / "out" / "one" / "provenance.json").read_text())
    assert content["configuration"]["temperature"]["path"].endswith("rigs/one/temps.csv")


def test_records_of_one_actuator_file_are_explained_together(
    made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[list[Path]] = []

    def explain(merged: list[Path], _actuator: Path, *, out: Path, **_settings: Any) -> None:
        asked.append(merged)
        write_made_up_run(out, half_cycles=2, rate_hz=2.0)

    monkeypatch.setattr("torsight.cli.campaign.explain_together", explain)
    for name in ("one", "two"):
        path = made / "rigs" / name / "experiment.toml"
        path.write_text(path.read_text() + "\n[discover]\ntogether = true\n")
        done = made / "out" / name
        write_json(done / "provenance.json", provenance_of(read_experiment(path), done))
    assert leave("batch", str(made / "rigs"), "--out", str(made / "out"), "--jobs", "1") == 0
    assert asked == [[made / "out" / name / "merged.csv" for name in ("one", "two")]]
    assert f"report {made / 'out' / 'together' / 'report.html'}" in capsys.readouterr().err
