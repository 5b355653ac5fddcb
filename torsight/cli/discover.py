"""``torsight discover``: find what the model lacks on one record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from torsight.cli.answer import Answer
from torsight.core.progress import Progress, silent

if TYPE_CHECKING:
    from torsight.discovery.report import DiscoveryReport

FILES: Final = ("discovery.json", "model.json", "curves.csv", "report.html")
"""What the command writes."""
_LEAST_CLOCK_SIGMA_S: Final = 0.05


def discover(
    merged: Annotated[Path, typer.Argument(metavar="MERGED.csv", help="Angle and temperatures on one clock.")],
    *,
    actuator: Annotated[Path, typer.Option(help="Characterised values, ACTUATOR.toml.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")],
    seed: Annotated[int, typer.Option(help="Seed of every random draw.", min=0)] = 0,
    export_effect: Annotated[
        Path | None,
        typer.Option(metavar="FILE.py", help="Write the strongest measured law as an effect."),
    ] = None,
) -> Answer:
    """Find what the quasi-static model lacks: the missing effect, the error before and after, a better model.

    Example: torsight discover results/merged.csv --actuator actuator.toml --out results
    """
    from torsight.cli.console import progress_bar, say
    from torsight.core.storage import read_json
    from torsight.core.wording import verdict_sentence
    from torsight.report import write_report

    with progress_bar() as progress:
        report = discover_to_folder(merged, actuator, out=out, seed=seed, progress=progress)
        write_report(out, progress=progress)
    if export_effect is not None:
        from torsight.discovery.export_effect import export_effect as export

        export(export_effect, report.model, report.laws)
    content = read_json(out / "discovery.json")
    say(f"Missing           {verdict_sentence(content)}")
    say(f"Error             {_errors(report)} (noise floor {report.noise_floor_deg:.2f}°)")
    if report.next_experiment is not None:
        say(f"Next experiment   {report.next_experiment.text}")
    for note in report.notes:
        say(f"Note              {note}")
    say(f"Report            {out / 'report.html'}")
    if export_effect is not None:
        say(f"Effect            {export_effect}")
    say(f"Results           {out}")
    laws = [out / law.csv_name for law in report.laws]
    return Answer(content, files=(*(out / name for name in FILES), *laws))


def _clock_sigma_s(merged: Path) -> float | None:
    """Return how well the clocks are known by an event that both saw, from the ``sync.json`` beside the table.

    What motion and temperature said about the clocks is in the table itself: it is not counted a second time. An offset
    that was given is a claim like any other.
    """
    from torsight.core.errors import InputError
    from torsight.core.records import SHARED_EVENT
    from torsight.core.storage import read_json

    path = merged.parent / "sync.json"
    if not path.is_file():
        return None
    content = read_json(path)
    if not str(content.get("method", "")).startswith(SHARED_EVENT):
        return None
    try:
        low, high = (float(end) for end in content["offset_s"]["ci95"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            "'offset_s' has no interval", where=str(path), do="write it again with 'torsight sync', or take it away"
        ) from error
    return max((high - low) / 3.92, _LEAST_CLOCK_SIGMA_S) if low <= high else None


def _errors(report: DiscoveryReport) -> str:
    before, after = report.before, report.after
    if not report.held_out:
        return (
            f"{before.rmse_train_deg:.2f}° rms before, {after.rmse_train_deg:.2f}° after, on the very record that was "
            "fitted: one half-cycle only, none could be held out"
        )
    return (
        f"{before.rmse_held_out_deg:.2f}° rms before, {after.rmse_held_out_deg:.2f}° after, on half-cycles that the "
        "fit did not see"
    )


def discover_to_folder(
    merged: Path, actuator: Path, *, out: Path, seed: int = 0, progress: Progress = silent
) -> DiscoveryReport:
    """Discover and write ``discovery.json``, ``model.json`` and ``curves.csv``; return what was found.

    Every law is written as ``law_<port>_<driver>.csv``, and as a picture of that name. For an ambiguous answer there is
    ``next_experiment.csv`` too: the programme that would tell the alternatives apart.
    """
    from torsight.actuator import read_actuator
    from torsight.actuator.fitted import write_model
    from torsight.core.paths import require_apart
    from torsight.core.storage import write_json, write_table
    from torsight.core.tables import read_merged
    from torsight.discovery.discover import discover as find
    from torsight.report.laws import write_laws

    made = ("curves.csv", "next_experiment.csv", "model.json", "discovery.json", "report.html")
    require_apart([out / name for name in made], [merged, actuator])
    spec = read_actuator(actuator)
    known_s = _clock_sigma_s(merged)
    report = find(read_merged(merged), spec, seed=seed, clock_sigma_s=known_s, progress=progress, where=str(merged))
    write_table(out / "curves.csv", report.curves)
    (out / "next_experiment.csv").unlink(missing_ok=True)
    if report.next_experiment is not None:
        write_table(out / "next_experiment.csv", report.next_experiment.columns)
    write_laws(out, report.laws)
    write_model(out / "model.json", report.model)
    write_json(out / "discovery.json", report.to_json())
    return report
