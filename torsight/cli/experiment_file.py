"""``EXPERIMENT.toml``: which film, log, camera and actuator belong together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from torsight.core.errors import ConfigError, InputError
from torsight.core.files.config import get_number, get_table, get_text, get_whole
from torsight.core.files.paths import AnyPath, is_glob, missing_file, named_from
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.frozen import Frozen

KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "video": ("path", "timestamps", "fps"),
    "angle": ("file", "film"),
    "camera": ("file",),
    "markers": ("file", "base", "moving", "kind", "family", "base_id", "moving_id", "base_mm", "moving_mm"),
    "temperature": ("path", "columns", "units"),
    "sync": ("offset_s", "drift_ppm", "max_gap_s", "led_events", "led"),
    "actuator": ("file",),
    "output": ("dir",),
    "discover": ("seed", "together"),
}
"""Tables of ``EXPERIMENT.toml`` and their keys."""


@dataclass(frozen=True, slots=True)
class Experiment(Frozen):
    """One experiment with every path resolved.

    ``video`` is a film, folder or glob of pictures, the left one of a stereo pair where ``video_right`` is given. Where
    ``angle`` names an existing table of angles, such as that of a live record, nothing is tracked, and the film, if
    given, is only shown. ``fps`` is the rate of a folder of pictures, or of the capture of a slow-motion film;
    ``markers`` are positions given in the experiment itself; ``columns`` and ``units`` describe the temperature log
    where its header does not.

    ``together`` are merged tables of earlier records of this rig that are explained together with this record; True:
    together with the other experiments of a campaign that have this setting. ``source`` is the file, for messages.
    """

    video: str | None
    video_right: str | None
    timestamps: Path | None
    fps: float | None
    camera: Path | None
    markers_file: Path | None
    markers: Mapping[str, Any]
    temperature: Path
    actuator: Path
    sync: Mapping[str, Any]
    output: Path
    seed: int
    together: bool | tuple[Path, ...] = False
    angle: Path | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    source: str = field(default="the experiment", compare=False)

    def inputs(self) -> list[Path]:
        """Return every file that the experiment reads (films given as a glob are expanded)."""
        found: list[Path] = []
        for source in (self.video, self.video_right):
            if source is not None:
                path = Path(source)
                found += sorted(path.parent.glob(path.name)) if is_glob(path.name) else [path]
        light = Path(self.sync["led_events"]) if "led_events" in self.sync else None
        optional = (self.angle, self.timestamps, self.camera, self.markers_file, light)
        others = self.together if isinstance(self.together, tuple) else ()
        return [*found, *(path for path in optional if path is not None), self.temperature, self.actuator, *others]

    def to_configuration(self, folder: Path) -> dict[str, Any]:
        """Return the configuration as used, in the shape of a TOML file in ``folder``, where the results are."""

        def named(path: AnyPath) -> str:
            return named_from(folder, path)

        films = [named(path) for path in (self.video, self.video_right) if path is not None]
        video: dict[str, Any] = {"path": films[0] if len(films) == 1 else films} if self.angle is None else {}
        angle = {} if self.angle is None else {"file": named(self.angle)}
        if self.angle is not None and self.video is not None:
            angle["film"] = named(self.video)
        light = {"led_events": named(self.sync["led_events"])} if "led_events" in self.sync else {}
        content: dict[str, dict[str, Any]] = {
            "video": video,
            "angle": angle,
            "camera": {} if self.camera is None else {"file": named(self.camera)},
            "markers": dict(self.markers) if self.markers_file is None else {"file": named(self.markers_file)},
            "temperature": {
                "path": named(self.temperature),
                **({"columns": dict(self.columns)} if self.columns else {}),
                **({"units": dict(self.units)} if self.units else {}),
            },
            "sync": {**self.sync, **light},
            "actuator": {"file": named(self.actuator)},
            "discover": {"seed": self.seed},
        }
        if self.together:
            others = self.together
            content["discover"]["together"] = others if isinstance(others, bool) else [named(path) for path in others]
        if self.timestamps is not None:
            video["timestamps"] = named(self.timestamps)
        if self.fps is not None:
            video["fps"] = self.fps
        return {name: table for name, table in content.items() if table}


def read_experiment(path: Path, *, absent: list[InputError] | None = None) -> Experiment:
    """Read ``EXPERIMENT.toml``, or that of a folder; relative paths are relative to it.

    With ``absent``, missing files are no error: each is appended to this list, so that all can be reported together.

    Raises ConfigError for an unknown key (the nearest known one is named), a missing one, or a value of the wrong kind;
    InputError when the file, or a file that it names, is missing.
    """
    path = experiment_file(path)
    if path.is_dir():
        do = f"'torsight init {path}' writes one to fill in"
        raise InputError("holds no experiment.toml", where=str(path), do=do)
    return experiment_from(read_toml(path, kind="experiment"), where=str(path), folder=path.parent, absent=absent)


def experiment_file(path: Path) -> Path:
    """Return the ``experiment.toml`` in a folder, where ``torsight init`` writes it; any other path unchanged."""
    inside = path / "experiment.toml"
    return inside if inside.is_file() else path


@dataclass(frozen=True, slots=True)
class _Files:
    """Files that an experiment names, relative to its folder; missing files go to ``absent``, or are refused."""

    folder: Path
    absent: list[InputError] | None

    def existing(self, path: Path, at: str) -> Path:
        """Return a path that is named at a place of the experiment file."""
        if not path.exists():
            missing = missing_file(path)
            error = InputError(missing.what, where=missing.where, do=f"{missing.do}; it is named in {at}")
            if self.absent is None:
                raise error
            self.absent.append(error)
        return path

    def named(self, table: Mapping[str, Any], key: str, *, where: str) -> Path | None:
        """Return the file that a key of a table names; None where it names none."""
        return (
            self.existing(self.folder / get_text(table, key, where=where), f"{where} {key}") if key in table else None
        )


def experiment_from(
    content: Mapping[str, Any], *, where: str, folder: Path, absent: list[InputError] | None = None
) -> Experiment:
    """Build an experiment from the content of its file; see :func:`read_experiment`."""
    check_keys(content, tuple(KEYS), where=where)
    tables = {
        name: get_table(content, name, where=where, required=name in ("temperature", "actuator")) for name in KEYS
    }
    places = {name: f"{where}, [{name}]" for name in KEYS}
    for name, table in tables.items():
        check_keys(table, KEYS[name], where=places[name])
    markers = tables["markers"]
    if "file" in markers and len(markers) > 1:
        raise ConfigError(
            "has both a file and its content", where=places["markers"], value=", ".join(markers), limit="one of them"
        )
    if ("video" in content) == ("angle" in content):
        raise ConfigError(
            "needs one of [video] and [angle]",
            where=where,
            value="both" if "video" in content else "none",
            do="name the film in [video] path, or an existing table of angles in [angle] file",
        )

    files = _Files(folder, absent)

    def named(table: str, key: str) -> Path | None:
        return files.named(tables[table], key, where=places[table])

    temperature, actuator = named("temperature", "path"), named("actuator", "file")
    if temperature is None or actuator is None:
        missing = places["temperature"] if temperature is None else places["actuator"]
        raise ConfigError("names no file", where=missing, do="add 'path' to [temperature], 'file' to [actuator]")
    angle = named("angle", "file")
    if "angle" in content and angle is None:
        raise ConfigError("names no file", where=places["angle"], do="add 'file', the angle.csv of a record")
    left: str | None = None
    right: str | None = None
    if angle is None:
        left, right = _films(tables["video"], files, where=places["video"])
    elif "film" in tables["angle"]:
        left, _ = _films({"path": tables["angle"]["film"]}, files, where=places["angle"])
    fps = tables["video"].get("fps")
    sync = dict(tables["sync"])
    if "led_events" in sync:
        name = get_text(sync, "led_events", where=places["sync"])
        sync["led_events"] = str(files.existing(folder / name, f"{places['sync']} led_events"))
    return Experiment(
        video=left,
        video_right=right,
        timestamps=named("video", "timestamps"),
        fps=None if fps is None else get_number(tables["video"], "fps", where=places["video"], lower=1e-3),
        camera=named("camera", "file"),
        markers_file=named("markers", "file"),
        markers={key: value for key, value in tables["markers"].items() if key != "file"},
        temperature=temperature,
        actuator=actuator,
        sync=sync,
        output=folder / get_text(tables["output"], "dir", where=places["output"], default="results"),
        seed=get_whole(tables["discover"], "seed", where=places["discover"], default=0, lower=0, upper=2**53),
        together=_together(tables["discover"], files, where=places["discover"]),
        angle=angle,
        source=where,
        **_log_columns(tables["temperature"], where=places["temperature"]),
    )


def _log_columns(table: Mapping[str, Any], *, where: str) -> dict[str, dict[str, str]]:
    """Return the checked names and units of the log's columns."""
    from sync.log.column_names import chosen_columns

    said = {name: dict(get_table(table, name, where=where)) for name in ("columns", "units")}
    chosen_columns(**said, where=where)
    return said


def _together(table: Mapping[str, Any], files: _Files, *, where: str) -> bool | tuple[Path, ...]:
    """Return whether the record is explained together with others of a campaign, or the other records."""
    value = table.get("together", False)
    if isinstance(value, bool):
        return value
    if not isinstance(value, list) or not value or not all(isinstance(name, str) for name in value):
        raise ConfigError(
            "'together' names no records",
            where=where,
            value=repr(value),
            limit="true (with the others of a campaign), or a list of merged.csv files",
        )
    return tuple(files.existing(files.folder / name, f"{where} together") for name in value)


def _films(table: Mapping[str, Any], files: _Files, *, where: str) -> tuple[str, str | None]:
    value = table.get("path")
    names: Any = [value] if isinstance(value, str) else value
    known = isinstance(names, list) and all(isinstance(name, str) and name.strip() for name in names)
    if not known or len(names) not in (1, 2):
        raise ConfigError(
            "'path' names no film", where=where, value=repr(value), limit="a text, or a list of two for left and right"
        )
    found: list[str] = []
    for name in names:
        path = files.folder / name
        if not is_glob(path.name):
            files.existing(path, f"{where} path")
        found.append(str(path))
    return found[0], found[1] if len(found) == 2 else None
