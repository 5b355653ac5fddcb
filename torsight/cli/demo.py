"""``torsight demo``: film a synthetic rig with an effect that the model lacks, and find it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.experiment_file import read_experiment
from torsight.cli.options import OpenView


def demo(
    *, out: Annotated[Path, Option(help="Folder for the film and the results.")] = Path("demo"), view: OpenView = False
) -> Answer:
    """Film a synthetic rig with a hidden effect and analyse it.

    The film is analysed as `torsight run` does.

    Example: torsight demo --out demo
    """
    from torsight.cli.run import run_experiment, shown
    from torsight.synthetic.scene import demo_scene
    from torsight.synthetic.scene_files import render_scene

    film = out / "rig"
    say(f"Filming a synthetic rig into {film}")
    with progress_bar() as progress:
        render_scene(demo_scene(), out=film, progress=progress)
    say("Measuring and modelling, as 'torsight run' does with any film")
    with progress_bar() as progress:
        folder = run_experiment(read_experiment(film / "experiment.toml"), out=out, progress=progress)
    return shown(folder, f"Hidden effect     in {film / 'truth.toml'}, for comparison", view=view)
