"""A folder of results has one writer at a time, and a lock that no killed process holds."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from torsight.core.errors import OutputError
from torsight.core.files.lock import only_writer

HOLD = """
import sys, time
from pathlib import Path
from torsight.core.files.lock import only_writer
with only_writer(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_the_folder_is_left_as_it_was(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with only_writer(folder), only_writer(folder, patience_s=0.0):
        assert [item.name for item in folder.iterdir()] == [".lock"]
    assert not folder.exists()
    with only_writer(folder):
        (folder / "made").touch()
    assert [item.name for item in folder.iterdir()] == ["made"]


def test_a_second_process_is_refused_until_the_first_is_killed(tmp_path: Path) -> None:
    first = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        with pytest.raises(OutputError, match=r"is being filled by another torsight.*one at a time"):
            only_writer(tmp_path, patience_s=0.3).__enter__()
    finally:
        first.kill()
        first.wait()
        first.stdout.close()
    assert (tmp_path / ".lock").exists()
    with only_writer(tmp_path, patience_s=1.0):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="cannot be written"):
        only_writer(tmp_path / "out").__enter__()
