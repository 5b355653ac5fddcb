"""A file that somebody writes to while a run reads it: its hash would say what is not so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.cli.bad_inputs import make_world
from torsight.cli import run
from torsight.cli.experiment_file import read_experiment
from torsight.core.errors import InputError


def test_results_of_a_file_that_grew_meanwhile_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_world(tmp_path)
    log, out = tmp_path / "temps.csv", tmp_path / "out"

    def grow() -> None:
        log.write_text(log.read_text() + "400,23,23\n")

    def stages(*_: Any, **__: Any) -> list[tuple[str, Any]]:
        return [("track", grow)]

    monkeypatch.setattr(run, "stages_of", stages)
    with pytest.raises(InputError, match=r"temps\.csv: has changed while it was read.*then run again"):
        run.run_experiment(read_experiment(tmp_path / "experiment.toml"), out=out)
    # no provenance that lies, and nothing that --resume would take for finished
    assert not out.exists()
