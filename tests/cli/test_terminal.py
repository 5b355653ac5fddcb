"""On a terminal: bars with the time left, on standard error. In a pipe: a line now and then. Completion."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.tracker.films import Rig, write_film
from torsight.cli import console
from torsight.cli.console import Lines, progress_bar
from torsight.cli.main import main

TORSIGHT = [sys.executable, "-m", "torsight.cli.main"]
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rig = Rig(lambda t: 60.0 - 40.0 * t, frames=12, texture=0.0)
    return write_film(rig, tmp_path_factory.mktemp("terminal") / "film.mkv")


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", "COLUMNS": "100", **more}


def test_a_terminal_sees_bars_with_the_time_left(film: Path, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    command = [*TORSIGHT, "track", str(film), "--out", str(tmp_path)]
    with subprocess.Popen(command, stderr=theirs, stdout=subprocess.PIPE, env=environment()) as process:
        os.close(theirs)
        seen = b""
        # A terminal that was closed at the other end reads as an error.
        while True:
            try:
                piece = os.read(ours, 4096)
            except OSError:
                break
            if not piece:
                break
            seen += piece
        assert process.stdout is not None
        assert process.stdout.read() == b""
    os.close(ours)
    text = seen.decode()
    assert process.returncode == 0, text
    assert "tracking" in text
    # elapsed and left, h:mm:ss, or dashes while it is not known
    assert re.search(r"\d:\d\d:\d\d.{0,12}(\d:\d\d:\d\d|-:--:--)", text)


def test_a_pipe_sees_the_last_line_only(film: Path, tmp_path: Path) -> None:
    command = [*TORSIGHT, "track", str(film), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment())
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "12 of 12 frames" in done.stderr


def test_a_file_gets_a_line_of_long_work_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    clock = iter([0.0, 9.0, 11.0, 12.0, 22.0])
    lines = Lines(now=lambda: next(clock))
    for done in range(3):
        lines.report("tracking", done, 4.0)
    lines.report("discovery", 7.0, None)
    said = capsys.readouterr().err.splitlines()
    assert [line.split() for line in said] == [["11", "s", "tracking,", "25", "%"], ["22", "s", "discovery"]]


@pytest.fixture
def complete(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Return what the program answers a shell that asks with these variables."""

    def asked(instruction: str, **about: str) -> str:
        with monkeypatch.context() as patch:
            for name, value in {"_TORSIGHT_COMPLETE": instruction, **about}.items():
                patch.setenv(name, value)
            with pytest.raises(SystemExit):
                main([])
        return capsys.readouterr().out

    return asked


def test_commands_and_options_are_completed_in_every_shell(complete: Callable[..., str]) -> None:
    found = complete("complete_bash", COMP_WORDS="torsight d", COMP_CWORD="1")
    assert found.split() == ["doctor", "demo", "discover"]
    assert "--markers" in complete("complete_bash", COMP_WORDS="torsight track --m", COMP_CWORD="2")
    assert "--actuator" in complete("complete_zsh", _TYPER_COMPLETE_ARGS="torsight fit --a")
    ids = complete("complete_bash", COMP_WORDS="torsight fit --effect sensor_", COMP_CWORD="3").split()
    assert ids == ["sensor_gain", "sensor_lag", "sensor_offset"]
    fish = {"_TYPER_COMPLETE_ARGS": "torsight s", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    assert "simulate" in complete("complete_fish", **fish)


@pytest.mark.parametrize(
    ("shell", "words"), [("bash", "complete -o"), ("zsh", "#compdef torsight"), ("fish", "complete --command torsight")]
)
def test_the_script_for_each_shell_is_made(shell: str, words: str, complete: Callable[..., str]) -> None:
    assert words in complete(f"source_{shell}")


def test_completion_is_installed_for_the_shell_that_asks(tmp_path: Path) -> None:
    command = f"{' '.join(TORSIGHT)} --install-completion; true"
    home = environment(HOME=str(tmp_path))
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True, env=home)
    assert "installed" in done.stdout + done.stderr
    script = tmp_path / ".bash_completions" / "torsight.sh"
    assert "_TORSIGHT_COMPLETE=complete_bash" in script.read_text()
    assert str(script) in (tmp_path / ".bashrc").read_text()


def test_a_start_that_compiles_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(console, "PATIENCE_S", 0.01)
    names = {"__name__": "numba.at_work", "sleep": time.sleep}
    exec("def compile(): sleep(0.2)", names)  # noqa: S102 - a function of a module of numba's name
    for work, compiles in ((lambda: time.sleep(0.2), False), (names["compile"], True)):
        with progress_bar():
            work()
        assert ("compiling: the first start" in capsys.readouterr().err) == compiles
