"""The command line: every command has an example, errors are told once, exit codes are the contract's."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import leave
from torsight.cli.main import COMMANDS, command_line


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert leave(name, "--help") == 0
    assert f"Example: torsight {name}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("words", [("--help",), ()])
def test_every_command_is_listed(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert leave(*words) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)
    assert "..." not in text.partition("Commands:")[2]  # every summary fits beside the command's name
    assert len(command_line().registered_commands) == len(COMMANDS)


def test_the_package_runs_as_the_command_does() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "torsight", "sync", "--angle", "a.csv"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("torsight: torsight sync: Missing option")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        ("trak",),
        ("track",),
        ("run",),
        ("sync", "--angle", "a.csv"),
        ("discover", "m.csv", "--actuator", "a.toml", "--out", "o", "--seed", "x"),
    ],
)
def test_wrong_usage_is_2(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert leave(*words) == 2
    assert capsys.readouterr().err.strip()


def test_a_missing_file_is_one_line_and_debug_shows_the_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("run", str(tmp_path / "experiment.toml"))
    assert leave(*words) == 3
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "experiment.toml: no such file" in told
    assert leave(*words, "--debug") == 3
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "heavy"),
    [
        ("--help", ("cv2", "scipy", "pandas", "numba", "rerun", "matplotlib", "av", "jinja2")),
        ("--version", ("numpy", "torsight.cli.track")),
    ],
)
def test_start_up_stays_light(word: str, heavy: tuple[str, ...]) -> None:
    """Neither needs the heavy libraries: what they import, not how long it takes, is checked."""
    code = f"""
import sys, contextlib
from torsight.cli.main import main
with contextlib.suppress(SystemExit):
    main([{word!r}])
print([name for name in {heavy!r} if name in sys.modules], file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


def test_clocks_fits_and_discovery_start_without_what_they_rarely_need() -> None:
    """Each takes half a second to import: planning and models of one's own need them, where they are asked for."""
    code = """
import sys, sync, torsight.discovery.discover, torsight.discovery.design.programme
print([name for name in ("scipy.signal", "scipy.stats") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_input_that_the_system_keeps_from_the_user_is_refused_by_its_reader(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "actuator.toml").write_text("[geometry]\n")
    monkeypatch.setattr("os.access", lambda *_args, **_options: False)
    read = Path.read_bytes

    def refuse(path: Path) -> bytes:
        if path.suffix == ".toml":
            raise PermissionError(13, "Permission denied")
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    words = ("simulate", tmp_path / "actuator.toml", tmp_path / "t.csv", "--start-angle", "1", "--out")
    assert leave(*words, tmp_path / "a.csv") == 3
    assert "actuator.toml: cannot be read (Permission denied)" in capsys.readouterr().err
