"""``characterise`` and ``paper`` on a disk that is full: told, and what was there stays."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.actuator.spring_bench import write_bench
from tests.command_line import leave
from tests.full_disk import full_disk


@pytest.mark.parametrize("command", ["characterise", "paper"])
def test_nothing_is_lost(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_bench(tmp_path, rows=120)
    out = tmp_path / "out"
    out.mkdir()
    for name in ("actuator.toml", "characterisation.json", "paper.json"):
        (out / name).write_text("older")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    words = [command, *([str(tmp_path / "tests.toml")] if command == "characterise" else []), "--out", str(out)]
    with full_disk(100):
        code = leave(*words)
    told = capsys.readouterr().err
    assert code == 3, told
    assert "cannot be written (File too large)" in told
    # On a slow machine the time that has passed is told above it.
    assert len([line for line in told.splitlines() if not re.match(r" *\d+ s  ", line)]) == 1
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
