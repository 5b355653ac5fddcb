"""The doctor's input files, and the findings on each file and on all of them together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from sync import LightEvents, LogReading, find_clock
from sync.clock.estimation import ADVICE, WIDE_S
from sync.led import switchings_of
from sync.merge.slow_motion import slow_motion_text
from torsight.actuator.drive import Drive
from torsight.actuator.fit_result import taken_as_exact
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, read_actuator
from torsight.cli.checkup.film_check import check_film
from torsight.cli.checkup.finding import RESIDUAL_DEG, Finding, refusal
from torsight.cli.checkup.log import LogCheck, check_log, check_programme, driven_by
from torsight.cli.checkup.rig import limits_of
from torsight.cli.experiment_file import experiment_file, read_experiment
from torsight.core.errors import ConfigError, InputError, NoResultError, TorsightError
from torsight.core.files.kinds import toml_kind
from torsight.core.files.paths import is_glob, missing_file
from torsight.core.files.storage import CSV_SUFFIXES, PARQUET_SUFFIXES, read_toml
from torsight.core.files.tables import read_angles
from torsight.core.optics.camera import Camera, read_camera, require_second
from torsight.core.progress import Progress, silent
from torsight.core.records import TemperatureLog
from torsight.core.tracks import FEW, USUAL_SHARE, StickAngles
from torsight.core.units import DEG, PPM, Floats
from torsight.core.words.wording import number
from tracker.detect.marker_file import read_markers

_KINDS: Final = ("experiment", "actuator", "camera", "markers")
"""Kinds of TOML files that are examined."""


@dataclass(slots=True)
class Inputs:
    """Files of one experiment; None for a file that is not given.

    There is one film, two films of a stereo pair, or none where ``angle`` names an existing table of angles. Markers
    are a file or the table of their positions; ``fps`` is the rate of pictures, ``settings`` the experiment's table
    ``[sync]``, ``columns`` and ``units`` are those of the log. ``absent`` are missing files that the experiment names.
    """

    films: list[str] = field(default_factory=list)
    angle: Path | None = None
    timestamps: Path | None = None
    log: Path | None = None
    actuator: Path | None = None
    camera: Path | None = None
    markers: Path | Mapping[str, Any] | None = None
    fps: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    absent: list[InputError] = field(default_factory=list)


def inputs_of(names: Sequence[str], *, fps: float | None) -> Inputs:
    """Return the inputs that the names on the command line refer to.

    Raises ConfigError when a TOML file is of no known kind, or the experiment is wrong; InputError when a file is
    missing.
    """
    found = Inputs(fps=fps)
    for name in names:
        path = experiment_file(Path(name))
        suffix = path.suffix.lower()
        if suffix == ".toml":
            kind = _kind(path)
            if kind == "experiment":
                return _of_experiment(path)
            setattr(found, kind, path)
        elif suffix in (*CSV_SUFFIXES, *PARQUET_SUFFIXES):
            found.log = path
        else:
            if not is_glob(name) and not path.exists():
                raise missing_file(path)
            found.films.append(name)
    return found


def _kind(path: Path) -> str:
    content = read_toml(path)
    kind = toml_kind(content)
    if kind in _KINDS:
        return str(kind)
    raise ConfigError(
        "is neither an experiment nor an actuator, a camera or markers",
        where=str(path),
        value=", ".join(content) or "nothing",
        limit="[video], [material], [intrinsics], or base and moving",
        do="name one of these files",
    )


def _of_experiment(path: Path) -> Inputs:
    absent: list[InputError] = []
    experiment = read_experiment(path, absent=absent)
    films = [name for name in (experiment.video, experiment.video_right) if name is not None]
    found = {error.where for error in absent}

    def there(file: Path | None) -> Path | None:
        return None if file is None or str(file) in found else file

    return Inputs(
        absent=absent,
        films=[] if experiment.angle is not None or found & set(films) else films,
        angle=there(experiment.angle),
        timestamps=there(experiment.timestamps),
        log=there(experiment.temperature),
        actuator=there(experiment.actuator),
        camera=there(experiment.camera),
        markers=there(experiment.markers_file) or experiment.markers or None,
        fps=experiment.fps,
        settings=experiment.sync,
        columns=experiment.columns,
        units=experiment.units,
    )


def examine(inputs: Inputs, *, progress: Progress = silent) -> tuple[list[Finding], dict[str, Any]]:
    """Check every input that is given; return the findings and the measured figures."""
    findings: list[Finding] = [refusal("experiment", error) for error in inputs.absent]
    content: dict[str, Any] = {}
    camera = _read(findings, "camera", inputs.camera, read_camera)
    hints = _read(findings, "markers", inputs.markers, read_markers)
    spec = _read(findings, "actuator", inputs.actuator, read_actuator)
    if spec is not None:
        findings += _look_at_priors(spec)
        content["actuator"] = {"uncertain": list(spec.uncertainty)}
    log = LogCheck("log") if inputs.log is None else check_log(inputs.log, columns=inputs.columns, units=inputs.units)
    findings += log.findings
    if inputs.log is not None:
        content["log"] = log.content
    if spec is not None and log.reading is not None:
        more, programme = check_programme(log.reading, spec, where=str(inputs.log), progress=progress)
        findings += more
        content["programme"] = programme
    angles = _read(findings, "angle", inputs.angle, read_angles)
    if angles is not None:
        findings += _look_at_angles(angles)
        findings += _look_at_overlap(float(angles.time_s[-1] - angles.time_s[0]), log, inputs.settings)
    stereo = len(inputs.films) == 2
    for place, film in enumerate(_films(inputs, camera, findings)):
        check = check_film(
            film,
            about="right film" if place else "film",
            fps=inputs.fps,
            timestamps=inputs.timestamps,
            hints=None if place else hints,
            camera=None if stereo else camera,
            progress=progress,
        )
        findings += check.findings
        content["film_right" if place else "film"] = check.content
        if place == 0:
            findings += _look_at_overlap(check.duration_s, log, inputs.settings, rate_fps=check.content.get("rate_fps"))
    if log.reading is not None and (spec is not None or angles is not None):
        more, content["clock"] = predict_clock(
            log.reading, inputs.settings, spec=spec, angles=angles, filming=_filming(content.get("film", {}))
        )
        findings += more
    return findings, content


def _films(inputs: Inputs, camera: Camera | None, findings: list[Finding]) -> list[str]:
    """Return the films to examine: none where camera or markers are refused, since tracking takes long.

    A run would end there, too. Refusals are appended to the findings.
    """
    if len(inputs.films) == 2:
        try:
            require_second(camera, where=str(inputs.camera or "experiment"))
        except ConfigError as error:
            findings.append(refusal("camera", error))
    refused = [item.about for item in findings if item.level == "stops" and item.about in ("camera", "markers")]
    if refused and inputs.films:
        text = f"was not examined: a run ends before it, at the {refused[0]}."
        findings.append(Finding("film", "note", text, "mend that, and ask again"))
    return [] if refused else inputs.films


def _filming(film: Mapping[str, Any]) -> Filming:
    """Return the properties of the film that its check measured."""
    sigma_deg = film.get("tracked", {}).get("noise", {}).get("angle_sigma_deg", {}).get("median")
    found = {"rate_fps": film.get("rate_fps"), "duration_s": film.get("duration_s"), "sigma_deg": sigma_deg}
    return Filming(**{name: value for name, value in found.items() if value})


def _read(findings: list[Finding], about: str, source: Any, reader: Any) -> Any:
    """Read a file; a refusal becomes a finding, so that the other files are still checked."""
    if source is None:
        return None
    try:
        return reader(source)
    except TorsightError as error:
        findings.append(refusal(about, error))
        return None


def _look_at_angles(angles: StickAngles) -> list[Finding]:
    """Report the share of frames with an angle, and the angle's standard deviation."""
    if not angles.valid.any():
        return [Finding("angle", "stops", "no frame has an angle.", "track the film again")]
    sigma_deg = float(np.median(angles.sigma_rad[angles.valid])) / DEG
    text = f"{int(angles.valid.sum())} of {len(angles)} frames have an angle, known to {sigma_deg:.4f}°."
    good = angles.valid.mean() > USUAL_SHARE and sigma_deg < RESIDUAL_DEG
    return [Finding("angle", "fine" if good else "limits", text, angle_deg=sigma_deg)]


def _look_at_priors(spec: ActuatorSpec) -> list[Finding]:
    """Report the values that count as exact."""
    if not spec.exact:
        return []
    level = "note" if spec.uncertainty else "limits"
    text = f"{taken_as_exact(spec.exact)}."
    return [Finding("actuator", level, text, "give one standard deviation of each in [uncertainty]")]


def _look_at_overlap(
    film_s: float, log: LogCheck, settings: Mapping[str, Any], *, rate_fps: float | None = None
) -> list[Finding]:
    """Compare the lengths of film and log, and their ends where the offset is given."""
    if film_s == 0.0 or log.reading is None:
        return []
    slow = slow_motion_text(film_s, log.duration_s, rate_fps=rate_fps)
    if slow is not None:
        return [Finding("record", "limits", f"{slow[0]}.", slow[1])]
    offset = settings.get("offset_s")
    if isinstance(offset, (int, float)) and not isinstance(offset, bool):
        time_s = log.reading.log.time_s
        first, last = float(time_s[0]) - offset, float(time_s[-1]) - offset
        covered = max(0.0, min(film_s, last) - max(0.0, first))
    else:
        covered = min(film_s, log.duration_s)
    if covered >= (1.0 - FEW) * film_s:
        return []
    text = f"the log ({log.duration_s:.0f} s) covers at most {covered:.0f} s of the film ({film_s:.0f} s)."
    if covered == 0.0:
        return [Finding("record", "stops", text, "check [sync] offset_s: temperature time = film time + offset")]
    return [Finding("record", "limits", text, "let the log run before the film starts and after it ends")]


@dataclass(frozen=True, slots=True)
class Filming:
    """Properties of the film: rate, length (0: as long as the log) and standard deviation of the angle.

    Without a film an ordinary film is assumed: thirty frames a second, and a standard deviation of a twentieth of a
    degree, as round dots of a few pixels give.
    """

    rate_fps: float = 30.0
    duration_s: float = 0.0
    sigma_deg: float = 0.05


def predict_clock(
    reading: LogReading,
    settings: Mapping[str, Any],
    *,
    spec: ActuatorSpec | None = None,
    angles: StickAngles | None = None,
    filming: Filming,
) -> tuple[list[Finding], dict[str, Any]]:
    """Return the expected intervals of offset and drift, as findings and as figures.

    ``sync`` is run on ``angles``, or on a film of the model's angles for this log that is simulated with the properties
    of ``filming``, so that heating rates, the log's noise and step, the sensor's lag and a shared event have the same
    effect as in a run. ``settings`` is the table ``[sync]`` of the experiment.
    """
    offset_s, drift_ppm = settings.get("offset_s"), settings.get("drift_ppm")
    if offset_s is not None:
        text = f"the offset is given ({number(float(offset_s))} s) and taken as exact."
        return [Finding("clock", "fine", text)], {"offset_s": float(offset_s), "offset_ci95_s": 0.0}
    limits = None if spec is None else limits_of(spec)
    # The made-up film runs on the film's clock.
    on_film = replace(reading.log, time_s=reading.log.time_s / (1.0 + (drift_ppm or 0.0) * PPM))
    try:
        if angles is None:
            if spec is None or limits is None:
                return [], {}
            drive = driven_by(replace(reading, log=on_film), spec, limits, where="log")
            angles = made_up_film(drive, spec, filming)
        light = _made_up_led(on_film, angles.time_s) if {"led", "led_events"} & set(settings) else None
        clock = find_clock(angles, reading, given_drift_ppm=drift_ppm, light=light).clock
    except NoResultError as error:
        return [
            Finding("clock", "limits", "motion and temperature would not determine the offset.", error.do or ADVICE)
        ], {}
    except TorsightError as error:
        return [refusal("clock", error)], {}
    half_s, half_ppm = (float(np.ptp(ends)) / 2.0 for ends in (clock.within_s, clock.drift_ci95_ppm))
    figures = {"offset_ci95_s": half_s, "drift_ci95_ppm": half_ppm, "method": clock.method}
    text = (
        f"the offset between film and log would be known to ±{number(half_s, 2)} s, their drift to "
        f"±{number(half_ppm, 2)} ppm (95 %), from {clock.method.partition(':')[0]}."
    )
    wide = 2.0 * half_s > WIDE_S
    return [Finding("clock", "limits" if wide else "fine", text, ADVICE if wide else "")], figures


def made_up_film(drive: Drive, spec: ActuatorSpec, filming: Filming) -> StickAngles:
    """Return the angles of a simulated film of the model: of the whole log, or of its middle if the film is shorter."""
    angle_rad = ActuatorModel(spec).simulate(drive).angle_rad
    first_s, last_s = float(drive.time_s[0]), float(drive.time_s[-1])
    spare_s = max(0.0, last_s - first_s - filming.duration_s) if filming.duration_s else 0.0
    time_s = np.arange(first_s + 0.5 * spare_s, last_s - 0.5 * spare_s, 1.0 / filming.rate_fps)
    sigma_rad, count = filming.sigma_deg * DEG, len(time_s)
    noise = sigma_rad * np.random.default_rng(0).standard_normal(count)
    known = np.ones(count, np.bool_)
    angle = np.interp(time_s, drive.time_s, angle_rad) + noise
    return StickAngles(np.arange(count), time_s, angle, np.full(count, sigma_rad), known, known)


def _made_up_led(log: TemperatureLog, frame_s: Floats) -> LightEvents | None:
    """Return the first frames that would show a change of the heating switch; None where the log has no switch."""
    switch = log.heat_a if log.heat_a is not None else log.heat_b
    if switch is None:
        return LightEvents(frame_s[:1], np.ones(1, np.bool_))
    changes = switchings_of(log.time_s, switch)
    frames = np.searchsorted(frame_s, changes.time_s)
    seen = (frames > 0) & (frames < len(frame_s))
    return LightEvents(frame_s[frames[seen]], changes.goes_on[seen])
