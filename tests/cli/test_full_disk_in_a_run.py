"""A disk that fills up in a later stage of a run: told with the file's name, and what was there stays as it was."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.bad_inputs import make_world
from tests.command_line import leave
from tests.few_effects import try_few
from tests.full_disk import full_disk
from tests.plain_report import draw_no_plots

STAGES = ("track", "sync", "fit", "discover")
EXPERIMENT = """
[angle]
file = "angle.csv"
[temperature]
path = "temps.csv"
[sync]
offset_s = 0.0
[actuator]
file = "actuator.toml"
"""


@pytest.fixture(scope="module", autouse=True)
def little_is_tried() -> Iterator[None]:
    """Try two effects and one law, draw no plots: what is found does not matter here, only what is written of it."""
    with pytest.MonkeyPatch.context() as patch:
        try_few(patch)
        draw_no_plots(patch)
        yield


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a world with a finished run in ``out/``."""
    folder = tmp_path_factory.mktemp("run") / "world"
    make_world(folder)
    (folder / "experiment.toml").write_text(EXPERIMENT)
    assert leave("run", str(folder / "experiment.toml"), "--out", str(folder / "out")) == 0
    return folder


@pytest.mark.parametrize(
    ("stages", "file"),
    [(1, "merged.csv"), (2, "fit.json"), (4, "recording.rrd")],
)
def test_a_later_stage_of_a_run(stages: int, file: str, finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The stages before are finished; as large as the file is, it does not fit."""
    out = finished / "out"
    origin = json.loads((out / "provenance.json").read_text())
    state = {"key": {name: origin[name] for name in ("inputs", "configuration", "seed")}, "finished": STAGES[:stages]}
    (out / ".run.json").write_text(json.dumps(state))
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file() and path.name != ".run.json"}
    # Half of the recording: how large it becomes differs a little from one time to the next.
    with full_disk((out / file).stat().st_size // (2 if file == "recording.rrd" else 1) - 1):
        code = leave("run", str(finished / "experiment.toml"), "--out", str(out), "--resume")
    told = capsys.readouterr().err
    assert code == 3, told
    assert f"{file}: cannot be written" in told
    assert "choose another folder" in told
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file() and path.name != ".run.json"} == before


def test_discover(finished: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = Path(shutil.copytree(finished / "out", tmp_path / "out"))
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    words = ("discover", str(out / "merged.csv"), "--actuator", str(finished / "actuator.toml"), "--out", str(out))
    with full_disk(1000):
        code = leave(*words)
    told = capsys.readouterr().err
    assert code == 3, told
    assert "curves.csv: cannot be written (File too large)" in told
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
