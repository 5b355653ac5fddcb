"""Over a hundred kinds of bad input end in the contract's exit code and a message that says what and where."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from tests.cli.bad_inputs import BAD as FIRST
from tests.cli.bad_inputs import make_world
from tests.cli.bad_oddities import ODD
from tests.cli.bad_units import MORE
from tests.command_line import leave

BAD = FIRST | MORE | ODD


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good") / "world"
    make_world(folder)
    return folder


def test_the_table_is_long_enough() -> None:
    assert len(BAD) >= 250


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name: str, world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = BAD[name]
    folder = tmp_path / "world"
    shutil.copytree(world, folder)
    bad.damage(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    command = re.sub(r"\{([^}]+)\}", lambda found: str(folder / found[1]), bad.command)

    code = leave(*shlex.split(command))

    told = capsys.readouterr().err
    assert code == bad.code, told
    assert bad.words in told
    assert "Traceback" not in told
    # nothing of what was there is lost, and no half-written file is left
    assert all(path.read_bytes() == content for path, content in before.items())
    assert not [path for path in folder.rglob(".*") if path.is_file() and path.name != ".run.json"]
