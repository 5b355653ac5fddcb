"""The pages build without a warning and fetch nothing; what they name and link is there."""

from __future__ import annotations

import importlib
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest
import typer

from tests.docs.documented import DOCS, PAGES, ROOT, WRITTEN, commands, named
from torsight.actuator.effects import ActsOn, load_effects
from torsight.cli.main import COMMANDS, app
from torsight.cli.reference import command_reference


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_named_is_there(page: Path) -> None:
    group: Any = typer.main.get_command(app)
    for command in named(page.read_text(encoding="utf-8")):
        _, name, *arguments = shlex.split(command)
        if name.startswith("-"):
            assert name in {flag for option in group.params for flag in option.opts} | {"--help"}, command
            continue
        known = {flag for option in group.commands[name].params for flag in option.opts}
        assert {word for word in arguments if word.startswith("-")} <= known, command


def test_the_reference_holds_every_command_with_an_example() -> None:
    assert [command.split()[1] for command in commands(command_reference()) if " --help" not in command] == list(
        COMMANDS
    )


def test_every_page_is_linked_and_every_link_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([\w./-]+\.(?:md|png|py|toml))\)", page.read_text(encoding="utf-8")):
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


def test_the_pages_build_without_a_warning_and_fetch_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(tmp_path / "trees")]
    done = subprocess.run(
        [*command, str(DOCS), str(tmp_path / "site")], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r"""(?:src|<link[^>]*href)=["']https?://[^"']+""", text), page.name
    assert "<math" in (tmp_path / "site" / "physics.html").read_text(encoding="utf-8")
