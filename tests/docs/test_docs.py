"""Every command in the pages is run, in order, on a small film and record; the pages build without a warning.

What takes minutes (``run``, ``demo``, ``discover``, …) is parsed here, so that no option is misspelt, and runs in the
tests that stand beside it in :data:`ELSEWHERE`.
"""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.record_files import write_record
from tests.tracker.films import Rig, write_film
from torsight.cli.main import COMMANDS, app, main
from torsight.cli.reference import command_reference
from torsight.synthetic import make_record

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
WRITTEN = ("commands.md", "effects_library.md")
"""Pages that are written from the code when the site is built."""
PAGES = sorted(path for path in [*DOCS.glob("*.md"), ROOT / "README.md"] if path.name not in WRITTEN)
ELSEWHERE = {
    "demo": "tests/cli/test_run.py",
    "run": "tests/cli/test_run.py",
    "discover": "tests/cli/test_run.py",
    "view": "tests/viewer/test_live_parts.py",
    "live": "tests/viewer/test_live_session.py",
    "batch": "tests/examples/test_examples.py",
    "calibrate": "tests/calibration/test_calibrate_command.py",
    "characterise": "tests/actuator/test_paper_and_commands.py",
    "paper": "tests/actuator/test_paper_and_commands.py",
    "render": "tests/synthetic/test_render_command.py",
}
TUTORIALS = ("start.md", "running.md", "scripts.md", "python.md", "effects.md", "engine.md", "physics.md")
SCENE = {
    "seed": 3,
    "protocol": {"time_factor": 0.2, "half_cycle": [{"spring": "a", "peak_c": 82.0}, {"spring": "b", "peak_c": 80.0}]},
}
EXPERIMENT = """
[video]
path = "film.mp4"
[temperature]
path = "temps.csv"
[actuator]
file = "actuator.toml"
"""


def blocks(page: Path) -> list[str]:
    """Return the command lines of a page's console blocks."""
    return lines_of(page.read_text(encoding="utf-8"))


def lines_of(text: str) -> list[str]:
    return [
        line[2:]
        for block in re.findall(r"```console\n(.*?)```", text, flags=re.DOTALL)
        for line in block.splitlines()
        if line.startswith("$ ")
    ]


def mentioned(page: Path) -> list[str]:
    """Return the commands that a page names in its text."""
    found = re.findall(r"`(torsight [a-z][^`]*)`", page.read_text(encoding="utf-8"))
    return [" ".join(words.split()) for words in found if "COMMAND" not in words]


def parse(command: str, *, whole: bool) -> None:
    """Refuse a command that does not exist, and where it is given whole, arguments that it does not take."""
    words = shlex.split(command)[1:]
    group: Any = typer.main.get_command(app)
    assert words[0] in group.commands, command
    if whole and len(words) > 1:
        group.commands[words[0]].make_context(words[0], words[1:])


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a small film, and a record of another rig apart on its log and its angles."""
    folder = tmp_path_factory.mktemp("docs")
    rig = Rig(lambda t: 60.0 - 40.0 * t, frames=30, texture=0.0)
    write_film(rig, folder / "film.mp4", codec="libx264", crf=12)
    write_record(make_record(SCENE), folder, offset_s=5.0)
    # Pages may be run by different workers: what one leaves, the next one finds here.
    (folder / "results").mkdir()
    for name in ("angle.csv", "merged.csv"):
        shutil.copy(folder / name, folder / "results")
    (folder / "experiment.toml").write_text(EXPERIMENT)
    return folder


@pytest.mark.parametrize("page", TUTORIALS)
def test_the_commands_of_a_page_run(page: str, world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(world)
    for command in blocks(DOCS / page):
        words = shlex.split(command)
        if words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        elif words[0] == "python" and words[1] == "-m":
            assert (ROOT / words[-1]).exists()
        elif words[0] == "python":
            monkeypatch.setattr(sys, "argv", words[1:])
            runpy.run_path(str(ROOT / words[1]), run_name="__main__")
        elif words[1] in ELSEWHERE:
            assert (ROOT / ELSEWHERE[words[1]]).exists()
            parse(command, whole=True)
        else:
            _run(words, world)


def _run(words: list[str], world: Path) -> None:
    with pytest.raises(SystemExit) as end:
        main(words[1:])
    assert end.value.code == 0, " ".join(words)
    if words[1] == "track":
        # The small film lasts a second: the record's own angles stand in for those of a whole one.
        shutil.copy(world / "angle.csv", world / "results")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_named_can_be_given(page: Path) -> None:
    for command in blocks(page):
        if command.startswith("torsight"):
            parse(command.partition("#")[0], whole=True)
    for command in mentioned(page):
        parse(command, whole=" -" in command)


def test_every_page_with_commands_is_run() -> None:
    assert {page.name for page in PAGES if blocks(page)} - {"README.md"} == set(TUTORIALS)


def test_the_reference_holds_every_command_with_an_example_that_can_be_given() -> None:
    examples = lines_of(command_reference())
    assert [command.split()[1] for command in examples] == list(COMMANDS)
    for command in examples:
        parse(command, whole=True)


def test_every_page_is_linked_and_every_link_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([\w./-]+\.(?:md|png|py|toml))\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists() or target in WRITTEN, f"{page.name}: {target}"


def test_the_pages_build_without_a_warning_and_fetch_nothing(tmp_path: Path) -> None:
    import subprocess

    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(tmp_path / "trees")]
    done = subprocess.run(
        [*command, str(DOCS), str(tmp_path / "site")], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r"""(?:src|<link[^>]*href)=["']https?://[^"']+""", text), page.name
    assert "<math" in (tmp_path / "site" / "physics.html").read_text(encoding="utf-8")
