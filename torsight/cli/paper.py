"""``torsight paper``: the paper's figures on the reference rig."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say


def paper(
    *,
    out: Annotated[Path, Option(metavar="DIR", help="Folder for the figures.")],
    seed: Annotated[int, Option(help="Seed of the scatter in figures 9 to 12.")] = 0,
) -> Answer:
    """Draw the figures of the paper with the model.

    Every figure that the model can reproduce is drawn, with the paper's numbers beside the model's.

    Example: torsight paper --out paper
    """
    from torsight.actuator.characterising.paper_figures import make_paper

    with progress_bar() as progress:
        content = make_paper(out, seed=seed, progress=progress)
    say(f"{len(content['figures'])} figures in {out}")
    for name, entry in content["numbers"].items():
        theirs = "–" if entry["paper"] is None else f"{entry['paper']:g}"
        say(f"  {name:30s} paper {theirs:>8s}   here {entry['ours']:9.4f} {entry['unit']}")
    return Answer(content, files=tuple(out / str(name) for name in content["figures"]))
