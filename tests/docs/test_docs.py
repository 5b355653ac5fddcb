"""The pages build without a warning and fetch nothing; what they name and link is there."""

from __future__ import annotations

import importlib
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import typer
from sphinx.util.inventory import InventoryFile

from tests.core.test_paths import PACKAGES, public_functions
from tests.docs.documented import DOCS, PAGES, ROOT, WRITTEN, command_reference, commands, documented_names, named
from torsight.actuator.effects import ActsOn, load_effects
from torsight.cli.main import COMMANDS, command_line
from torsight.core.records import SyncedTable, merged_columns
from torsight.core.tracks import MARKERS, MarkerTracks, StickAngles, angle_columns, marker_columns

NOTEBOOKS = {
    # The friction torque is 0.855 mN·m there; a fit knows it to 0.02.
    "first_rig": (r"friction torque 0\.(79|8\d|9[01])\d mN·m", 4),
    # The rig has the declared 0.79 mN·m; the film is known to 0.2° of some 410°.
    "own_film": (r"tau_c_mnm\s*0\.(7|8)\d+ mN·m", 3),
    "missing_effect": (r"(?s)The model lacks an effect: sensor lag.*lag (5\.[5-9]|6\.[0-5])\d s, 95 %", 2),
    # The boat's drag is 5 v|v|: unknown as a curve, then one of two powers, then, with a record that differs, the one.
    "own_model": (
        r"(?s)more_n is missing, in a form.*square or cube: this record cannot.*square is missing.*report\.html",
        1,
    ),
}
"""What the page of each notebook has to say, and how many pictures it holds."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_named_is_there(page: Path) -> None:
    group: Any = typer.main.get_command(command_line())
    for command in named(page.read_text(encoding="utf-8")):
        _, name, *arguments = shlex.split(command)
        if name.startswith("-"):
            assert name in {flag for option in group.params for flag in option.opts} | {"--help"}, command
            continue
        known = {flag for option in group.commands[name].params for flag in option.opts}
        assert {word for word in arguments if word.startswith("-")} <= known, command


def test_the_reference_holds_every_command_with_an_example() -> None:
    shown = [command.split()[1] for command in commands(command_reference()) if " --help" not in command]
    assert list(dict.fromkeys(shown)) == list(COMMANDS)


def test_every_page_is_linked_and_every_link_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([\w./-]+\.(?:md|png|py|toml|ipynb))\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists() or target in WRITTEN, f"{page.name}: {target}"


def test_what_the_page_on_python_names_can_be_imported() -> None:
    text = (DOCS / "python.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z.]+)` \| (.*) \|$", text, flags=re.MULTILINE)
    assert len(rows) >= 6
    for package, names in rows:
        module = importlib.import_module(package)
        assert not [name for name in re.findall(r"`(\w+)`", names) if not hasattr(module, name)], package


def test_the_files_to_copy_for_an_effect_act_where_the_page_says() -> None:
    text = (DOCS / "effects.md").read_text(encoding="utf-8")
    rows = re.findall(r"^ *\| `(\w+)` \|.*\| `(\w+)` \|$", text, flags=re.MULTILINE)
    assert {port: load_effects()[name].acts_on for port, name in rows} == {port: port for port in get_args(ActsOn)}


def test_the_readme_fits_one_screen() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    # a line that is longer than the screen is wide takes two
    assert sum(1 + len(line) // 120 for line in lines) <= 60


def test_the_site_is_built_from_notebooks_that_run_and_fetches_nothing(tmp_path: Path) -> None:
    """One build, as ``make docs`` makes it: a page of a notebook is what its cells gave, and nothing else is left."""
    site, temporary = tmp_path / "site", tmp_path / "temporary"
    temporary.mkdir()
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(tmp_path / "trees")]
    paths = os.environ | {"TMPDIR": str(temporary)}
    done = subprocess.run(
        [*command, str(DOCS), str(site)], capture_output=True, text=True, check=False, cwd=ROOT, env=paths
    )
    assert done.returncode == 0, done.stderr
    assert list(temporary.iterdir()) == []
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r"""(?:src|<link[^>]*href)=["']https?://[^"']+""", text), page.name
    assert "<math" in (site / "physics.html").read_text(encoding="utf-8")
    for name, (told, pictures) in NOTEBOOKS.items():
        text = (site / "notebooks" / f"{name}.html").read_text(encoding="utf-8")
        assert re.search(told, re.sub(r"<[^>]+>", "", text)), name
        assert len(re.findall(r'<img [^>]*src="\.\./_images/\w+\.png"', text)) == pictures, name
    linked = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    objects = {name for kind, found in linked.data.items() if kind.startswith("py:") for name in found}
    assert {"sync.merge", "torsight.actuator.fit_model", "torsight.discovery.DiscoveryReport.facts"} <= objects


def test_every_notebook_is_built_and_holds_no_output() -> None:
    found = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (DOCS / "notebooks").glob("*.ipynb")}
    assert set(found) == set(NOTEBOOKS)
    assert not [cell for made in found.values() for cell in made["cells"] if cell.get("outputs")]


def test_the_reference_holds_every_public_name() -> None:
    conf = runpy.run_path(str(DOCS / "conf.py"))
    assert set(conf["PACKAGES"]) == {*PACKAGES}
    pages = {package: conf["reference"](package) for package in PACKAGES}
    known = {name for page in pages.values() for name in re.findall(r"^\.\. auto\w+:: ([\w.]+)$", page, re.MULTILINE)}
    assert {name for name, _ in public_functions()} <= known


def test_the_page_on_the_report_explains_every_number_of_its_picture() -> None:
    marks = runpy.run_path(str(DOCS / "make_pictures.py"))["MARKS"]
    text = (DOCS / "report.md").read_text(encoding="utf-8").partition("pictures/report.png")[2].partition("\n## ")[0]
    assert [int(number) for number in re.findall(r"^(\d+)\. ", text, re.MULTILINE)] == [*range(1, len(marks) + 1)]


def test_the_page_on_running_lists_the_columns_of_the_tables() -> None:
    frame, time_s, known = np.arange(2), np.array([0.0, 0.5]), np.ones(2, np.bool_)
    angles = StickAngles(frame, time_s, time_s, time_s, known, known)
    assert documented_names("angle.csv") == list(angle_columns(angles))
    four = np.ones((2, 4), np.bool_)
    tracks = MarkerTracks(frame, time_s, np.zeros((2, 4, 2)), np.zeros((2, 4, 2, 2)), four, (9, 9))
    columns = [name.replace(MARKERS[0], "m") for name in marker_columns(tracks, np.zeros((2, 4, 3)))]
    assert set(documented_names("markers.csv")) == {name for name in columns if not name.startswith(MARKERS[1:])}
    merged = SyncedTable(time_s, time_s, time_s, time_s, time_s, heat_a=known, heat_b=known)
    assert documented_names("merged.csv") == list(merged_columns(merged))
