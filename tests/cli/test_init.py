"""The files to start from are valid, complete and never written over."""

from __future__ import annotations

from pathlib import Path

import pytest

from torsight.actuator.spec import read_actuator
from torsight.cli.experiment_file import KEYS
from torsight.cli.init import init
from torsight.core.errors import ConfigError
from torsight.core.files.storage import read_toml


def test_the_files_can_be_read_and_name_every_table(tmp_path: Path) -> None:
    init(tmp_path)
    read_actuator(tmp_path / "actuator.toml")
    text = (tmp_path / "experiment.toml").read_text()
    assert all(f"[{table}]" in text for table in KEYS)
    assert all(
        f"{key} = " in text for table, keys in KEYS.items() for key in keys if (table, key) != ("markers", "file")
    )
    assert read_toml(tmp_path / "experiment.toml")["video"]["path"] == "film.mp4"


def test_files_that_are_there_stay(tmp_path: Path) -> None:
    (tmp_path / "experiment.toml").write_text("mine")
    with pytest.raises(ConfigError, match="is there already"):
        init(tmp_path)
    assert (tmp_path / "experiment.toml").read_text() == "mine"
    assert not (tmp_path / "actuator.toml").exists()


def test_the_commands_that_it_names_can_be_copied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    init(tmp_path / "my rig")
    assert f"torsight run '{tmp_path / 'my rig' / 'experiment.toml'}'" in capsys.readouterr().err
