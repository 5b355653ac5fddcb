"""Every command of the pages is given as it stands, and ends well, in a folder that has the files that it names, small.

What stands for what: a film of the bench for a camera's number; a browser's page for the viewer's window; what was
found by itself for the clicks of a person, who knows which stick turns; a film of one quick half-cycle for the
demo's, and two effects for the library that discovery tries; the record's own angles for those of the bench's film,
which lasts a second; the first run's recording for those of the others, and reports go without their plots (tests of
the viewer and the report make both). ``make test`` is what runs this, ``make docs`` and the common test of the effects
run beside it. The three scripts that measure the figures of the filming page take hours, so their help is what is
asked for.
"""

from __future__ import annotations

import json
import os
import re
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from types import ModuleType

import pytest

from tests.browser import ask
from tests.cli.test_run import FILES
from tests.docs.docs_world import fill_in, make_world, small_scene
from tests.docs.documented import PAGES, ROOT, command_reference, commands
from tests.few_effects import try_few
from tests.plain_report import draw_no_plots
from tests.recordings import fingerprint
from torsight.cli.main import main
from torsight.cli.run import UNFINISHED
from torsight.cli.view import recording_of
from torsight.core.errors import OutputError
from torsight.core.files.storage import read_json
from torsight.core.tracks import MARKERS
from torsight.viewer import save_pictures
from torsight.viewer.program import free_port

AGAIN = """
import sys
import pytest
from tests.few_effects import try_few
from tests.plain_report import draw_no_plots
from torsight.cli.main import main
try_few(pytest.MonkeyPatch())
draw_no_plots(pytest.MonkeyPatch())
main(sys.argv[1:])
"""
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES} | {"commands.md": command_reference()}
PAGES_WITH_COMMANDS = sorted(name for name, text in TEXTS.items() if commands(text))


class World:
    """The folder, and what was done in it: a command that stands on several pages is given once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.done: set[str] = set()
        self.looked = False

    def give(self, command: str) -> None:
        """Give a command as a user at a shell would."""
        # A run's results go beside its experiment, be that said or not.
        command = re.sub(r"^(torsight run (.*)/experiment.toml) --out \2/results$", r"\1", command.strip())
        if command in self.done:
            return
        program, *words = [name for word in shlex.split(command) for name in self._spread(word)]
        {"torsight": self._torsight, "python": _python, "make": self._make, ".": _activate}[program](words)
        self.done.add(command)

    def _spread(self, word: str) -> list[str]:
        """Spread a wildcard as a shell does."""
        return sorted(path.name for path in self.folder.glob(word)) if "*" in word else [word]

    def _make(self, words: list[str]) -> None:
        assert re.search(rf"^{words[0]}:", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
        if words == ["demo"]:
            assert "torsight demo --out demo" in (ROOT / "Makefile").read_text(encoding="utf-8")
            self.give("torsight demo --out demo")

    def _torsight(self, words: list[str]) -> None:
        if words[0] == "view" and "--pictures" not in words:
            # One recording is looked at; of the others the same program would show what lies there.
            assert recording_of(self.folder / words[1]).is_file()
            if not self.looked:
                _look_at(words)
            self.looked = True
            return
        if words[0] == "markers" and "--preview" not in words:
            _pick(words)
            return
        if words[:2] == ["run", "--from"]:
            # Done again, to the last byte, by a test of its own below.
            assert read_json(self.folder / words[2])["command"]
            return
        if words[0] == "paper":
            # A test of its own gives it, and looks at what it writes (tests/actuator/test_paper_and_commands.py).
            return
        if words[:2] == ["live", "0"]:
            words = ["live", "bench.mkv", *words[2:]]
        if words[0] == "batch":
            words = [*words, "--jobs", "1"]
        tracked = _interrupted(Path(words[words.index("--out") + 1])) if "--resume" in words else 0
        with pytest.raises(SystemExit) as end:
            main(words)
        if "--pictures" in words and end.value.code:
            with pytest.raises(OutputError, match="cannot draw here"):
                save_pictures(words[1], self.folder / "drawn")
            return
        assert end.value.code == 0, " ".join(words)
        if tracked:
            assert Path(words[words.index("--out") + 1], "angle.csv").stat().st_mtime_ns == tracked
        self._afterwards(words)

    def _afterwards(self, words: list[str]) -> None:
        if words[0] == "init":
            fill_in(self.folder / words[1], self.folder)
        if words[0] == "live" and "--out" in words:
            record = self.folder / words[words.index("--out") + 1]
            for name in ("angle.csv", "temps.csv"):
                shutil.copy(self.folder / name, record)
            for name in ("markers.csv", "track.json"):
                (record / name).unlink()


def _interrupted(results: Path) -> int:
    """Leave what a run leaves that was interrupted before its discovery; return when its film had been tracked."""
    made = json.loads((results / "provenance.json").read_text(encoding="utf-8"))
    state = {"key": {name: made[name] for name in ("inputs", "configuration", "seed")}}
    (results / UNFINISHED).write_text(json.dumps(state | {"finished": ["track", "sync", "fit"]}), encoding="utf-8")
    return (results / "angle.csv").stat().st_mtime_ns


def _python(words: list[str]) -> None:
    if words[0] == "-m" or words[0].startswith("docs/"):
        # Tests are not run from a test, and what draws the pages' pictures would draw over them.
        assert (ROOT / words[-1 if words[0] == "-m" else 0]).exists()
        return
    arguments = ["--help"] if words[0].startswith("benchmarks/") else words[1:]
    beside = ROOT / Path(words[0]).parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [words[0], *arguments])
        # As for a script that Python starts: what lies beside it can be imported, whatever else has such a name.
        patch.syspath_prepend(beside)
        for name in {path.stem for path in beside.glob("*.py")}:
            # Set first, so that what the script imports goes again with the patch.
            patch.setitem(sys.modules, name, ModuleType(name))
            del sys.modules[name]
        try:
            runpy.run_path(str(ROOT / words[0]), run_name="__main__")
        except SystemExit as end:
            assert end.code in (0, None), words  # noqa: PT017 - a script may end so, or just end


def _activate(words: list[str]) -> None:
    assert words == [".venv/bin/activate"]
    assert "VENV := .venv" in (ROOT / "Makefile").read_text(encoding="utf-8")


def _pick(words: list[str]) -> None:
    """Save what was found by itself, as its page in a browser does."""
    command = [sys.executable, "-m", "torsight.cli.main", *words, "--no-open"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as picking:
        assert picking.stderr is not None
        address = next(word for word in picking.stderr.readline().split() if word.startswith("http://"))
        state = json.loads(ask(address, "state")[1])
        kind = dict.fromkeys(("base", "moving"), state["kinds"][0])
        # Which stick turns no first frame tells, but a person knows.
        points = {name: state["found"][other] for name, other in zip(MARKERS, MARKERS[2:] + MARKERS[:2], strict=True)}
        assert b"saved" in ask(address, "save", {"points": points, "kind": kind})[1]
        ask(address, "page", method="DELETE")
        assert picking.wait(timeout=60) == 0


def _look_at(words: list[str]) -> None:
    """Open the viewer's page as a browser does, then end the command by Ctrl-C."""
    port = free_port()
    with subprocess.Popen(
        [sys.executable, "-m", "torsight.cli.main", *words, "--serve", "--web-port", str(port)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        page = b""
        end = time.monotonic() + 120.0
        while not page and running.poll() is None and time.monotonic() < end:
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=5.0) as answer:
                    page = answer.read()
            except OSError:
                time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        _, told = running.communicate(timeout=60)
    assert b"<html" in page.lower(), told
    assert running.returncode == 0, told


def _stand_in(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Go to the folder; no window opens there, the demo is small, and discovery tries two effects, not all."""
    patch.chdir(folder)
    patch.delenv("DISPLAY", raising=False)
    patch.delenv("WAYLAND_DISPLAY", raising=False)
    patch.setattr("torsight.synthetic.scene.demo_scene", small_scene)
    try_few(patch)
    draw_no_plots(patch)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    """Return a folder with inputs of every kind, and with the results of a run on them."""
    folder = tmp_path_factory.mktemp("docs")
    make_world(folder)
    made = World(folder)
    with pytest.MonkeyPatch.context() as patch:
        _stand_in(patch, folder)
        made.give("torsight run experiment.toml --out results")
    # Pages may be run by different workers: what one of them leaves, the next one finds here.
    for name in ("out", "first/results"):
        shutil.copytree(folder / "results", folder / name)
    for name in ("angle.csv", "provenance.json"):
        shutil.copy(folder / "results" / name, folder)
    campaign = folder / "campaign" / "one"
    campaign.mkdir(parents=True)
    for name in ("angle.csv", "temps.csv", "actuator.toml"):
        shutil.copy(folder / name, campaign)
    film = (folder / "experiment.toml").read_text(encoding="utf-8")
    (campaign / "experiment.toml").write_text(film.replace('[video]\npath = "film.mp4"', '[angle]\nfile = "angle.csv"'))
    return made


def test_provenance_is_enough_to_do_it_again_with_any_number_of_threads(world: World) -> None:
    """Same numbers, same bytes: every file but the recording, and all of its data; only its stamps may differ.

    That the report's plots are drawn in the same bytes is tested with the report.
    """
    # A run that was moved with its inputs: the report says the name of its folder.
    out, again = (world.folder / name / "results" for name in ("first", "second"))
    again.mkdir(parents=True)
    shutil.copy(out / "provenance.json", again)
    for name in read_json(out / "provenance.json")["inputs"]:
        shutil.copy(world.folder / "results" / name, again / name)
    # Here linear algebra has one thread (tests/conftest.py).
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS"), "2")
    command = [sys.executable, "-c", AGAIN, "run", "--from", str(again / "provenance.json")]
    environment = os.environ | threads | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, cwd=world.folder)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in again.iterdir()} == {path.name for path in out.iterdir()} >= {*FILES}
    for path in out.glob("*.*"):
        if path.name != "recording.rrd":
            assert (again / path.name).read_bytes() == path.read_bytes(), path.name
    assert fingerprint(again / "recording.rrd") == fingerprint(out / "recording.rrd")


@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS)
def test_the_commands_of_a_page_run(page: str, world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    _stand_in(monkeypatch, world.folder)
    recording = world.folder / "first" / "results" / "recording.rrd"
    monkeypatch.setattr("torsight.viewer.write_recording", lambda folder, **_: shutil.copy(recording, folder))
    for command in commands(TEXTS[page]):
        world.give(command)


def test_the_pages_with_commands_are_these() -> None:
    """A page whose commands are not found any more would be left out silently."""
    told = {
        "README.md",
        "actuator.md",
        "calibrating.md",
        "commands.md",
        "effects.md",
        "engine.md",
        "filming.md",
        "gallery.md",
    }
    assert {
        *told,
        "logs.md",
        "markers.md",
        "phone.md",
        "physics.md",
        "python.md",
        "report.md",
        "running.md",
        "scripts.md",
        "start.md",
        "trust.md",
    } == set(PAGES_WITH_COMMANDS)
