"""``torsight run``: every stage on one experiment, from the film to the report."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

from typer import Argument, Option

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.cli.experiment_file import Experiment, experiment_from, read_experiment
from torsight.cli.fit import fit_to_folder
from torsight.cli.options import OpenView
from torsight.cli.sync import read_settings, sync_to_folder
from torsight.cli.track import FILES as TRACKED
from torsight.cli.track import is_no_result, track_to_folder
from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.paths import require_apart
from torsight.core.files.provenance import file_hash, provenance, versions
from torsight.core.files.storage import atomic_path, read_json, write_json
from torsight.core.files.tables import read_angles, write_angles
from torsight.core.optics.camera import read_camera
from torsight.core.progress import Progress, silent


def run(
    experiment: Annotated[
        Path | None, Argument(metavar="EXPERIMENT.toml", help="The experiment file, or the folder that holds it.")
    ] = None,
    *,
    out: Annotated[Path | None, Option(help="Folder for the results; [output] dir otherwise.")] = None,
    view: OpenView = False,
    resume: Annotated[bool, Option("--resume", help="Continue an interrupted run.")] = False,
    from_: Annotated[Path | None, Option("--from", metavar="PROVENANCE.json", help="Repeat a finished run.")] = None,
) -> Answer:
    """Do everything: film and log to a report and a recording.

    Track, synchronise, fit and discover; write a report and a recording.

    Example: torsight run experiment.toml --out results
    """
    if (experiment is None) == (from_ is None):
        raise ConfigError("needs one of EXPERIMENT.toml and --from PROVENANCE.json", where="torsight run")
    chosen = read_experiment(experiment) if experiment is not None else again(from_ or Path())
    if from_ is not None:
        say(*other_versions(from_))
    with progress_bar() as progress:
        folder = run_experiment(chosen, out=out, resume=resume, progress=progress)
    return shown(folder, view=view)


def shown(folder: Path, *more: str, view: bool) -> Answer:
    """Print a finished run's summary with ``more`` lines, open its recording where ``view`` asks, return its answer.

    A viewer that cannot open is only a warning: the results are there.
    """
    from torsight.cli.summary import summary

    say("", *summary(folder), *more)
    if view:
        from torsight.cli.view import view as open_view

        try:
            open_view(folder)
        except NoResultError as error:
            say(f"warning: {error}")
    return answer_of(folder)


def answer_of(folder: Path) -> Answer:
    """Return a finished run's answer to a script: its row of a campaign's table, and its files."""
    from torsight.cli.discover import nothing_found
    from torsight.cli.summary import result_row

    track = folder / "track.json"
    nothing = nothing_found(read_json(folder / "discovery.json"), where=str(folder / "merged.csv"))
    if nothing:
        say(f"torsight: {nothing}")
    none = nothing or (track.is_file() and is_no_result(read_json(track)))
    files = sorted(path for path in folder.iterdir() if path.is_file())
    return Answer(result_row(folder), files=files, exit_code=NoResultError.exit_code if none else 0)


def again(path: Path) -> Experiment:
    """Return the experiment of a ``provenance.json``, beside which its results go; changed inputs are refused."""
    content = read_json(path)
    recorded, configuration = content.get("inputs"), content.get("configuration")
    if not isinstance(recorded, dict) or not isinstance(configuration, dict):
        raise InputError("is no provenance of a run", where=str(path), do="name the provenance.json of 'torsight run'")
    for name, found in _changed(recorded, path.parent):
        limit = f"{str(recorded[name])[:12]} (SHA-256)"
        raise InputError("has changed since the run", where=name, value=found[:12], limit=limit)
    experiment = experiment_from(configuration, where=f"{path}, configuration", folder=path.parent)
    return replace(experiment, output=path.parent)


def other_versions(path: Path) -> list[str]:
    """Return a note where a ``provenance.json`` names other versions than the installed ones: numbers may differ."""
    recorded = read_json(path).get("versions")
    recorded = recorded if isinstance(recorded, dict) else {}
    changed = [
        f"{name} {recorded.get(name, 'unknown')}, here {found}"
        for name, found in versions().items()
        if recorded.get(name) != found
    ]
    return [f"note: made with other versions, numbers may differ: {'; '.join(changed)}"] if changed else []


def run_experiment(
    experiment: Experiment, *, out: Path | None = None, resume: bool = False, progress: Progress = silent
) -> Path:
    """Run every stage of one experiment and return the folder of the results.

    With ``resume`` the stages that an interrupted run of the same inputs had finished are not repeated, and an
    unfinished track continues from its last checkpoint.
    """
    from torsight.core.files.lock import only_writer

    folder = out or experiment.output
    made = [*(TRACKED if experiment.angle is None else ()), *_MADE]
    require_apart([folder / name for name in made], experiment.inputs())
    _check(experiment)
    origin = provenance_of(experiment, folder)
    with only_writer(folder):
        state = _State(folder, origin=origin, resume=resume)
        for name, work in stages_of(experiment, folder, resume=resume and state.same, progress=progress):
            if name not in state.finished:
                work()
                state.finish(name)
        _require_unchanged(origin["inputs"], state, folder=folder)
        write_json(folder / "provenance.json", origin)
        _show(experiment, folder, progress=progress)
        state.close()
    return folder


def provenance_of(experiment: Experiment, folder: Path) -> dict[str, Any]:
    """Return the content of the ``provenance.json`` of an experiment whose results go to ``folder``."""
    configuration = experiment.to_configuration(folder)
    return provenance(inputs=experiment.inputs(), configuration=configuration, seed=experiment.seed, folder=folder)


def _require_unchanged(inputs: Mapping[str, str], state: _State, *, folder: Path) -> None:
    """Refuse results from inputs that have changed during the run: their hashes would be wrong."""
    for name, _ in _changed(inputs, folder):
        state.close()
        raise InputError(
            "has changed while it was read",
            where=name,
            limit="a file that nobody writes to during the run",
            do="let its recording or copying end, then run again",
        )


def _changed(recorded: Mapping[str, str], folder: Path) -> Iterator[tuple[str, str]]:
    """Give the inputs of a provenance in ``folder`` that are not as they were recorded, with their hashes now."""
    for name, before in recorded.items():
        found = file_hash(folder / name)
        if found != before:
            yield name, found


def _check(experiment: Experiment) -> None:
    """Refuse unusable inputs (log, settings, actuator, …) before the film is tracked, not after."""
    from sync import read_temperature_log
    from torsight.actuator.spec import read_actuator
    from tracker.detect.marker_file import read_markers

    read_temperature_log(experiment.temperature, columns=experiment.columns, units=experiment.units)
    try:
        read_settings(experiment.sync)
        if experiment.markers_file is not None or experiment.markers:
            read_markers(experiment.markers_file or experiment.markers)
    except ConfigError as error:
        if error.where is not None and error.where.startswith("["):
            error.where = f"{experiment.source}, {error.where}"
        raise
    read_actuator(experiment.actuator)
    if experiment.angle is not None:
        read_angles(experiment.angle)
    if experiment.camera is not None:
        read_camera(experiment.camera)


def stages_of(
    experiment: Experiment, folder: Path, *, resume: bool, progress: Progress
) -> list[tuple[str, Callable[[], Any]]]:
    """Return the stages of a run in their order: the name of each, and what does its work."""
    from torsight.cli.discover import discover_to_folder

    merged, actuator, seed = folder / "merged.csv", experiment.actuator, experiment.seed
    return [
        ("track", lambda: _angles(experiment, folder, resume=resume, progress=progress)),
        ("sync", lambda: _one_clock(experiment, folder, progress=progress)),
        ("fit", lambda: fit_to_folder(merged, actuator, out=folder, progress=progress)),
        ("discover", lambda: discover_to_folder([merged], actuator, out=folder, seed=seed, progress=progress)),
        ("together", lambda: _together(experiment, folder, progress=progress)),
    ]


def _one_clock(experiment: Experiment, folder: Path, *, progress: Progress) -> None:
    """Merge angle and temperatures; print at once what speaks against this log, since the search takes minutes."""
    sync_to_folder(
        folder / "angle.csv",
        experiment.temperature,
        settings=experiment.sync,
        out=folder,
        film=experiment.video,
        timestamps=experiment.timestamps,
        fps=experiment.fps,
        columns=experiment.columns,
        units=experiment.units,
        progress=progress,
    )
    for note in read_json(folder / "sync.json")["notes"]:
        say(f"warning: {experiment.temperature}: {note}")


def _together(experiment: Experiment, folder: Path, *, progress: Progress) -> None:
    """Explain the record together with the records that the experiment names, in a separate folder."""
    from torsight.cli.discover import explain_together

    if isinstance(experiment.together, tuple):
        records = [*experiment.together, folder / "merged.csv"]
        explain_together(records, experiment.actuator, out=folder / TOGETHER, seed=experiment.seed, progress=progress)


def _angles(experiment: Experiment, folder: Path, *, resume: bool, progress: Progress) -> None:
    """Track the film, or copy an existing table of angles."""
    if experiment.angle is not None:
        take_over(experiment.angle, out=folder)
    elif experiment.video is not None:
        track_to_folder(
            experiment.video,
            right=experiment.video_right,
            camera=experiment.camera,
            markers=experiment.markers_file or (experiment.markers or None),
            timestamps=experiment.timestamps,
            fps=experiment.fps,
            out=folder,
            resume=resume,
            progress=progress,
        )


def take_over(angle: Path, *, out: Path) -> None:
    """Copy ``angle.csv``, and ``markers.csv`` and ``track.json`` where they exist beside it, into a run's folder.

    The run's folder may be the one that already holds them.
    """
    if angle.resolve() != (out / "angle.csv").resolve():
        write_angles(out / "angle.csv", read_angles(angle))
    for name in ("markers.csv", "track.json"):
        beside, target = angle.parent / name, out / name
        if beside.is_file() and beside.resolve() != target.resolve():
            with atomic_path(target) as temporary:
                shutil.copyfile(beside, temporary)


def _show(experiment: Experiment, folder: Path, *, progress: Progress) -> None:
    from torsight.report import write_report
    from torsight.viewer import write_recording

    film = None if experiment.video is None else Path(experiment.video)
    write_recording(folder, film=film, progress=progress)
    write_report(folder, progress=progress)


_MADE: Final = (
    *("merged.csv", "sync.json", "fit.json", "model.json", "discovery.json", "curves.csv", "next_experiment.csv"),
    *("provenance.json", "recording.rrd", "report.html"),
)
TOGETHER: Final = "together"
"""Subfolder of the results for the joint answer of several records of one rig."""
UNFINISHED: Final = ".run.json"
"""File with the finished stages; it exists in a run's folder while the run lasts or after it was interrupted."""


class _State:
    """The finished stages of a run, saved in its folder while the run lasts."""

    def __init__(self, folder: Path, *, origin: dict[str, Any], resume: bool) -> None:
        import json

        self._path = folder / UNFINISHED
        self._key = {name: origin[name] for name in ("inputs", "configuration", "seed")}
        self.same = False
        self.finished: list[str] = []
        if resume and self._path.exists():
            with contextlib.suppress(ValueError, KeyError, TypeError, OSError):
                earlier = json.loads(self._path.read_text(encoding="utf-8"))
                self.same = earlier["key"] == self._key
                self.finished = list(earlier["finished"]) if self.same else []
        self._write()

    def finish(self, stage: str) -> None:
        self.finished.append(stage)
        self._write()

    def close(self) -> None:
        self._path.unlink(missing_ok=True)

    def _write(self) -> None:
        write_json(self._path, {"key": self._key, "finished": self.finished})
