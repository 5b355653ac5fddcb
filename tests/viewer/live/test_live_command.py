"""``torsight live`` and ``torsight view`` as programs: what they listen to, how they end, what a kill leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest
from live_rig import FPS, log_text, write_film

from tests.command_line import leave
from tests.made_up_run import write_made_up_run
from torsight.cli import run
from torsight.cli.answer import Answer
from torsight.cli.experiment_file import read_experiment
from torsight.cli.view import recording_of
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.viewer import program

FRAMES = 90
ROOT = Path(__file__).parents[3]
PROGRAM = [sys.executable, "-m", "torsight.cli.main"]
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}
"""127.0.0.1 and ::1 as the system writes them."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    write_film(folder / "film.mkv", FRAMES)
    (folder / "temps.csv").write_text(log_text(FRAMES / FPS), encoding="utf-8")
    return folder


def start(rig: Path, *options: str) -> subprocess.Popen[str]:
    """Start the command on a computer without a display."""
    surroundings = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    words = ["live", str(rig / "film.mkv"), "--temperature", str(rig / "temps.csv"), *options]
    return subprocess.Popen(
        [*PROGRAM, *words],
        cwd=ROOT,
        env=surroundings | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def rows_of(path: Path) -> int:
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def wait_for_rows(path: Path, rows: int) -> None:
    end = time.monotonic() + 120.0
    while rows_of(path) < rows:
        assert time.monotonic() < end, f"{path} has {rows_of(path)} rows"
        time.sleep(0.02)


def family(process: int) -> list[int]:
    """Return a process and all that it started, to the last; threads and processes may end meanwhile."""
    found = [process]
    for task in threads(process):
        with suppress(FileNotFoundError, ProcessLookupError):
            found += [one for child in (task / "children").read_text().split() for one in family(int(child))]
    return found


def threads(process: int) -> list[Path]:
    with suppress(FileNotFoundError, ProcessLookupError):
        return list(Path(f"/proc/{process}/task").iterdir())
    return []


def listening(processes: list[int]) -> set[tuple[str, int]]:
    """Return addresses and ports at which processes listen."""
    own = set()
    for process in processes:
        with suppress(FileNotFoundError, ProcessLookupError):
            for handle in Path(f"/proc/{process}/fd").iterdir():
                with suppress(OSError):
                    own.add(str(handle.readlink()))
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in own:
                address, port = fields[1].split(":")
                found.add((address, int(port, 16)))
    return found


def test_it_ends_by_itself_with_a_browsers_page_served_to_this_computer_only(rig: Path, tmp_path: Path) -> None:
    if not Path("/proc/net/tcp").exists():
        pytest.skip("this system does not list its sockets in /proc/net/tcp")
    ports = program.free_port(), program.free_port()
    options = ("--serve", "--port", str(ports[0]), "--web-port", str(ports[1]), "--speed", "0.5", "--json")
    running = start(rig, "--out", str(tmp_path / "live"), *options)
    page, heard = b"", set()
    try:
        end = time.monotonic() + 120.0
        while running.poll() is None and time.monotonic() < end and not page:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{ports[1]}", timeout=1.0) as answer:
                    page = answer.read()
            except OSError:
                time.sleep(0.05)
            else:
                heard = listening(family(running.pid))
        said, told = running.communicate(timeout=120)
    finally:
        running.kill()
        running.communicate()
    assert running.returncode == 0, told
    assert "Traceback" not in told
    assert b"<html" in page.lower()
    assert {port for _, port in heard} >= set(ports)
    assert {address for address, _ in heard} <= LOOPBACK
    assert f"http://127.0.0.1:{ports[1]}?url=" in told
    answer = json.loads(said)
    assert answer["result"]["frames"] == FRAMES
    assert {"angle.csv", "markers.csv", "temps.csv", "track.json", "experiment.toml"} <= set(answer["files"])


def test_ctrl_c_ends_it_with_a_summary_and_whole_files(rig: Path, tmp_path: Path) -> None:
    out = tmp_path / "live"
    running = start(rig, "--out", str(out), "--port", "0", "--speed", "0.5")
    wait_for_rows(out / "angle.csv", 30)
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=120)
    assert running.returncode == 0, told
    assert "Traceback" not in told
    for words in ("No display here", "Range of motion", "Latency", "torsight run"):
        assert words in told
    table = pd.read_csv(out / "angle.csv")
    live = json.loads((out / "live.json").read_text(encoding="utf-8"))
    assert 30 <= len(table) == len(pd.read_csv(out / "markers.csv")) == live["frames"] < FRAMES
    track = json.loads((out / "track.json").read_text(encoding="utf-8"))
    assert track["frames"]["total"] == len(table)
    assert len(pd.read_csv(out / "events.csv")) == len(track["events"])


def test_a_kill_leaves_all_but_the_last_second_and_no_process(rig: Path, tmp_path: Path) -> None:
    out = tmp_path / "live"
    running = start(rig, "--out", str(out), "--port", "0", "--speed", "0.5")
    try:
        wait_for_rows(out / "angle.csv", 40)
        rows, children = rows_of(out / "angle.csv"), family(running.pid)[1:]
    finally:
        running.kill()
        running.communicate(timeout=60)
    # Flushed every quarter of a second: what was read off the file before is there, and whole.
    for name in ("angle.csv", "markers.csv"):
        table = pd.read_csv(out / name)
        assert len(table) >= rows - FPS
        assert table["frame"].tolist() == list(range(len(table)))
        assert (out / name).read_text(encoding="utf-8").endswith("\n")
    assert pd.read_csv(out / "angle.csv")["valid"].iloc[10:].mean() > 0.9
    assert len(pd.read_csv(out / "temps.csv")) > 0
    assert len(pd.read_csv(out / "events.csv")) > 0
    end = time.monotonic() + 30.0
    while any(Path(f"/proc/{child}").exists() for child in children) and time.monotonic() < end:
        time.sleep(0.1)
    assert not [child for child in children if Path(f"/proc/{child}").exists()]
    # What is left can be looked at, and is an experiment but for the values of the rig.
    assert recording_of(out).stat().st_size > 0
    (out / "actuator.toml").write_text("", encoding="utf-8")
    experiment = read_experiment(out / "experiment.toml")
    assert experiment.angle == out / "angle.csv"
    assert experiment.video == str(rig / "film.mkv")


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        ("film.mkv --temperature .", 3, "is a folder"),
        ("flim.mkv --temperature temps.csv", 3, "flim.mkv"),
        ("temps.csv --temperature temps.csv", 3, "temps.csv"),
        ("film.mkv --temperature temps.csv --speed 0", 2, "--speed"),
        ("film.mkv --temperature temps.csv --fps -1", 2, "--fps"),
        ("film.mkv --temperature temps.csv --actuator none.toml", 3, "none.toml"),
        ("97 --temperature temps.csv", 3, "camera 97"),
        ("rtsp://10.0.0.3/x --temperature temps.csv", 2, "another computer"),
        ("film.mkv --temperature temps.csv --out taken", 2, "choose another --out folder"),
    ],
)
def test_what_cannot_be_watched_is_named(
    rig: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: str,
    code: int,
    told: str,
) -> None:
    (rig / "taken").mkdir(exist_ok=True)
    (rig / "taken" / "angle.csv").write_text("frame\n", encoding="utf-8")
    monkeypatch.chdir(rig)
    assert leave("live", *words.split()) == code
    said = capsys.readouterr().err
    assert told in said
    assert "internal error" not in said


# --- torsight view ----------------------------------------------------------------------------------------------------


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")


@pytest.mark.usefixtures("no_display")
def test_view_without_a_display_says_what_to_do(tmp_path: Path) -> None:
    from torsight.cli.view import view

    (tmp_path / "recording.rrd").write_bytes(b"anything")
    with pytest.raises(NoResultError, match=r"recording\.rrd.*no display.*--serve"):
        view(tmp_path)


@pytest.mark.usefixtures("no_display")
def test_a_run_is_done_where_its_recording_cannot_be_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "answer_of", lambda _: Answer({"verdict": "none"}))
    write_made_up_run(tmp_path)
    (tmp_path / "recording.rrd").write_bytes(b"anything")
    assert run.shown(tmp_path, view=True).exit_code == 0
    said = capsys.readouterr().err
    assert "warning: " in said
    assert "no display" in said


def test_view_of_a_folder_without_results_is_named(tmp_path: Path) -> None:
    from torsight.cli.view import view

    with pytest.raises(InputError, match=r"recording\.rrd.*no recording here.*torsight run"):
        view(tmp_path)


def test_a_port_that_is_taken_is_named_and_the_usual_one_gives_way() -> None:
    import socket

    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        with pytest.raises(ConfigError, match=rf"--port.*taken by another program.*{taken}"):
            program.chosen_port(taken, 9876, option="--port")
        assert program.chosen_port(None, taken, option="--port") != taken
    assert program.chosen_port(taken, 9876, option="--port") == taken
