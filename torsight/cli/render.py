"""``torsight render``: film a synthetic rig with known angles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import command, progress_bar, say
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import read_toml


def render(
    scene: Annotated[Path, Argument(help="Scene file; keys that it leaves out have the reference rig's values.")],
    out: Annotated[Path, Option(help="Folder for film, log and truth.")],
    *,
    seed: Annotated[int | None, Option(min=0, help="Replaces the scene's seed.")] = None,
    record: Annotated[
        bool, Option("--record", help="No film: merged.csv and actuator.toml, for fit and discover.")
    ] = False,
) -> Answer:
    """Film a synthetic rig whose angles are known.

    Film, temperature log, truth and a ready experiment are written.

    Example: torsight render fixtures/scenes/paper.toml --out paper
    """
    from torsight.synthetic.scene import scene_from
    from torsight.synthetic.scene_files import record_scene, render_scene

    texts = ("experiment.toml", "actuator.toml", "camera.toml", "markers.toml", "truth.toml")
    require_apart([out / name for name in texts], [scene])
    read = scene_from(read_toml(scene, kind="scene"), where=str(scene), seed=seed)
    if record:
        merged = record_scene(read, out=out)
        actuator = out / "actuator.toml"
        next_one = command("discover", merged, "--actuator", actuator, "--out", out)
        say(f"recorded {scene} in {out}; analyse it with: {next_one}")
        return Answer({"merged": str(merged)}, files=(merged, actuator, out / "truth.toml"))
    with progress_bar() as progress:
        experiment = render_scene(read, out=out, progress=progress)
    say(f"filmed {scene} into {out}; analyse it with: {command('run', experiment)}")
    return Answer({"experiment": str(experiment)}, files=sorted(path for path in out.iterdir() if path.is_file()))
