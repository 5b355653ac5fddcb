"""``torsight demo``: film a synthetic rig with an effect that the model lacks, and find it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from torsight.cli.answer import Answer


def demo(
    *,
    out: Annotated[Path, typer.Option(help="Folder for the film and the results.")] = Path("demo"),
    view: Annotated[bool, typer.Option("--view", help="Open the recording in Rerun at the end.")] = False,
) -> Answer:
    """Film a synthetic rig and do everything that `torsight run` does on the film.

    Example: torsight demo --out demo
    """
    from torsight.cli.console import progress_bar, say
    from torsight.cli.experiment_file import read_experiment
    from torsight.cli.run import answer_of, run_experiment
    from torsight.cli.summary import summary
    from torsight.synthetic.scene import demo_scene
    from torsight.synthetic.scene_files import render_scene

    film = out / "rig"
    say(f"Filming a synthetic rig into {film}")
    with progress_bar() as progress:
        render_scene(demo_scene(), out=film, progress=progress)
    say("Measuring and modelling, as 'torsight run' does with any film")
    with progress_bar() as progress:
        folder = run_experiment(read_experiment(film / "experiment.toml"), out=out, progress=progress)
    say("")
    for line in summary(folder):
        say(line)
    say(f"What was hidden   {film / 'truth.toml'} tells, for comparison")
    if view:
        from torsight.cli.view import view as open_view

        open_view(folder)
    return answer_of(folder)
