"""``torsight init``: files to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import command, say
from torsight.core.errors import ConfigError
from torsight.core.files.storage import write_text


def init(
    folder: Annotated[Path, Argument(help="Folder for the two files.")] = Path(),
    *,
    force: Annotated[bool, Option("--force", help="Overwrite existing files.")] = False,
) -> Answer:
    """Write an experiment.toml and an actuator.toml to fill in.

    Comments in both files explain every key.

    Example: torsight init my-rig
    """
    templates = Path(__file__).parent / "templates"
    targets = {template: folder / template.name for template in sorted(templates.glob("*.toml"))}
    for target in targets.values():
        if target.exists() and not force:
            raise ConfigError("is there already", where=str(target), do="give another folder, or --force")
    for template, target in targets.items():
        write_text(target, template.read_text(encoding="utf-8"))
        say(f"wrote {target}")
    experiment = folder / "experiment.toml"
    say(f"Fill them in, then: {command('doctor', experiment)}, and {command('run', experiment)}")
    return Answer({"folder": str(folder)}, files=tuple(targets.values()))
