"""``torsight discover``: find what the model lacks, on one record or on several of one rig together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.options import ActuatorFile, Seed
from torsight.core.errors import InputError, NoResultError
from torsight.core.files.paths import require_apart
from torsight.core.files.provenance import require_each_once
from torsight.core.files.storage import read_json, write_json, write_table
from torsight.core.files.tables import read_merged
from torsight.core.progress import Progress
from torsight.core.words.wording import verdict_sentence

if TYPE_CHECKING:
    from torsight.discovery.report import DiscoveryReport

FILES: Final = ("discovery.json", "model.json", "curves.csv", "report.html")
"""Files that the command writes."""


def discover(
    merged: Annotated[
        list[Path],
        Argument(
            metavar="MERGED.csv…",
            help="Angle and temperatures on one clock; several records of one rig in their order.",
        ),
    ],
    *,
    actuator: ActuatorFile,
    out: Annotated[Path, Option(help="Folder for the results.")],
    seed: Seed = 0,
    export_effect: Annotated[
        Path | None, Option(metavar="FILE.py", help="Write the strongest measured law as an effect.")
    ] = None,
) -> Answer:
    """Find what the quasi-static model lacks.

    The result is the missing effect, the error before and after, and a better model. Several records of one rig get
    one joint answer: the springs' values, effects and laws are shared, while each record has its own start, zero of
    the sticks, and clocks.

    Example: torsight discover results/merged.csv --actuator actuator.toml --out results
    """
    from torsight.actuator.quantities import in_symbols
    from torsight.cli.summary import attention, discovery_lines

    with progress_bar() as progress:
        report = discover_to_folder(merged, actuator, out=out, seed=seed, progress=progress)
        _write_report(out, progress=progress)
    if export_effect is not None:
        from torsight.discovery.actuator.export_effect import export_effect as export

        export(export_effect, report.model, report.laws)
    content = read_json(out / "discovery.json")
    verdict = verdict_sentence(content)
    notes = [f"Note              {in_symbols(note)}" for note in report.notes if note not in verdict]
    say(*attention(content), *discovery_lines(content), *notes, f"Report            {out / 'report.html'}")
    if export_effect is not None:
        say(f"Effect            {export_effect}")
    say(f"Results           {out}")
    laws = [out / law.csv_name for law in report.laws]
    more = [out / curves_name(k) for k in range(1, len(merged))]
    files = (*(out / name for name in FILES), *more, *laws)
    if nothing := nothing_found(content, where=", ".join(map(str, merged))):
        say(f"torsight: {nothing}")
    return Answer(content, files=files, exit_code=nothing.exit_code if nothing else 0)


def nothing_found(discovery: Mapping[str, Any], *, where: str) -> NoResultError | None:
    """Return an error where the model of ``discovery.json`` is no better than a constant on held-out half-cycles."""
    from torsight.actuator.fit_result import nothing_explained

    r2 = discovery["after"]["r2_held_out"]
    if r2 is None or r2 > 0.0:
        return None
    what = "the model that was found is no better than a constant angle on held-out half-cycles"
    return nothing_explained(what, r2, where=where)


def curves_name(record: int) -> str:
    """Return the file name of the curves of a record, counted from 0."""
    return "curves.csv" if record == 0 else f"curves_{record + 1}.csv"


def discover_to_folder(
    merged: Sequence[Path], actuator: Path, *, out: Path, seed: int, progress: Progress
) -> DiscoveryReport:
    """Discover on one record or on several of one rig, and write the results.

    Written are ``discovery.json``, ``model.json`` and ``curves.csv``; every law as ``law_<port>_<driver>.csv`` and as a
    picture of that name; for an ambiguous answer ``next_experiment.csv``, the programme that would distinguish the
    alternatives. For several records ``curves.csv`` holds the curves of the first, ``curves_2.csv`` … those of the
    others, and ``model.json`` continues from the end of the last.
    """
    from torsight.actuator import read_actuator
    from torsight.core.files.lock import only_writer
    from torsight.discovery.discover import discover as find
    from torsight.discovery.together import discover_together

    made = (*FILES, "next_experiment.csv", *(curves_name(k) for k in range(1, len(merged))))
    require_apart([out / name for name in made], [*merged, actuator])
    require_one_rig(merged)
    spec = read_actuator(actuator)
    records, names = [read_merged(path) for path in merged], [str(path) for path in merged]
    with only_writer(out):
        if len(records) == 1:
            report = find(records[0], spec, seed=seed, progress=progress, where=names[0])
            _write(report, out)
            return report
        joint = discover_together(records, spec, names=names, seed=seed, progress=progress)
        _write(joint, out)
        for k, record in enumerate(joint.records[1:], start=1):
            write_table(out / curves_name(k), record.curves)
        return joint


def require_one_rig(records: Sequence[Path]) -> None:
    """Refuse a record that is given twice, and records whose runs used different actuator files.

    The ``provenance.json`` beside a record's table names the actuator file of its run, with the file's hash. Records
    without a ``provenance.json`` are accepted. A file that all runs have used may have been edited since.
    """
    require_each_once(records)
    actuators = [(path, used) for path in records if (used := _actuator_of(path)) is not None]
    for path, (name, found) in actuators[1:]:
        first, (first_name, first_found) = actuators[0]
        if found != first_found:
            raise InputError(
                "is a record of another actuator",
                where=str(path),
                value=f"{name}, {found[:12]} (SHA-256)",
                limit=f"{first_name}, {first_found[:12]}, as {first}",
                do="give records of one rig; where it is one, run them again with one actuator file",
            )


def _actuator_of(record: Path) -> tuple[str, str] | None:
    """Return name and hash of the actuator file that a record's run has used; None where they are not recorded."""
    path = record.parent / "provenance.json"
    if not path.is_file():
        return None
    content = read_json(path)
    try:
        name = content["configuration"]["actuator"]["file"]
        return str(name), str(content["inputs"][name])
    except (KeyError, TypeError):
        return None


def explain_together(merged: Sequence[Path], actuator: Path, *, out: Path, seed: int = 0, progress: Progress) -> None:
    """Discover on several records of one rig and write results and report, unless the report is newer than them."""
    last = out / "report.html"
    inputs = [*merged, actuator]
    if last.exists() and all(path.stat().st_mtime <= last.stat().st_mtime for path in inputs):
        return
    discover_to_folder(merged, actuator, out=out, seed=seed, progress=progress)
    _write_report(out, progress=progress)


def _write_report(out: Path, *, progress: Progress) -> None:
    """Write the report; the plotting modules are imported only here, because they are slow to load."""
    from torsight.core.files.lock import only_writer
    from torsight.report import write_report

    with only_writer(out):
        write_report(out, progress=progress)


def _write(report: DiscoveryReport, out: Path) -> None:
    """Write the results, and delete curves of further records that an earlier discovery may have left."""
    from torsight.actuator.fitted import write_model
    from torsight.report.figures.law_plots import write_laws

    for stale in out.glob("curves_[0-9]*.csv"):
        stale.unlink()
    write_table(out / "curves.csv", report.curves)
    (out / "next_experiment.csv").unlink(missing_ok=True)
    if report.next_experiment is not None:
        write_table(out / "next_experiment.csv", report.next_experiment.columns)
    write_laws(out, report.laws)
    write_model(out / "model.json", report.model)
    write_json(out / "discovery.json", report.to_json())
