"""A scene on disk: film, temperature log, truth, and the files that ``torsight run`` needs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import write_table, write_text
from torsight.core.files.tables import write_merged
from torsight.core.optics.camera import camera_content
from torsight.core.progress import Progress, silent
from torsight.core.units import DEG, Floats, Ints
from torsight.synthetic.experiment import Played, clock, log_columns, make_record, play_scene
from torsight.synthetic.filming.camera_work import Occluders, frame_ticks, light_gain, shake_path
from torsight.synthetic.filming.film_writer import SUFFIXES, TICKS, open_film
from torsight.synthetic.filming.optics import camera_of, views
from torsight.synthetic.filming.studio import Studio
from torsight.synthetic.scene import Scene


def render_scene(scene: Scene, *, out: AnyPath, progress: Progress = silent) -> Path:
    """Film a scene and write all files of its experiment.

    Parameters
    ----------
    scene : Scene
        The scene to film.
    out : str or Path
        Folder; gets ``film.mp4`` (``film_left`` and ``film_right`` for a pair; ``.mkv`` or a folder by codec),
        ``temps.csv``, ``truth.csv``, ``camera.toml``, ``markers.toml``, ``actuator.toml``, ``experiment.toml`` and
        ``truth.toml``.
    progress : Progress
        Called after every frame.

    Returns
    -------
    Path
        ``experiment.toml``.

    Raises
    ------
    OutputError
        When a file cannot be written.
    """
    out = Path(out)
    progress("rig", 0, None)
    played = play_scene(scene)
    progress("rig", 1, 1)
    tick = TICKS[scene.film.codec]
    ticks = frame_ticks(scene.film, played.duration_s, tick, scene.rng("frame times"))
    time_s = ticks * tick.numerator / tick.denominator
    out.mkdir(parents=True, exist_ok=True)
    write_table(out / "temps.csv", log_columns(played))
    truth = {
        "frame": np.arange(len(time_s)),
        "time_s": time_s,
        "angle_deg": (played.stick_angle(time_s) / DEG).round(6),
        "actuator_deg": (played.actuator_angle(time_s) / DEG).round(6),
    }
    write_table(out / "truth.csv", truth)
    markers_px = _film(played, ticks, time_s, out=out, progress=progress)
    _write_toml(out / "camera.toml", camera_content(camera_of(scene)))
    points = [[round(float(x), 2), round(float(y), 2)] for x, y in markers_px]
    _write_toml(out / "markers.toml", {"base": points[:2], "moving": points[2:]})
    _write_toml(out / "actuator.toml", scene.declared.to_toml())
    _write_toml(out / "truth.toml", _answer(scene))
    _write_toml(out / "experiment.toml", _experiment(scene))
    return out / "experiment.toml"


def record_scene(scene: Scene, *, out: Path) -> Path:
    """Write the record of a scene's rig without filming it, as from a perfect camera and one clock.

    The folder gets ``merged.csv``, whose path is returned, ``actuator.toml`` and ``truth.toml``. Film (except for the
    frame rate), camera, light and the log's clock do not matter.

    Raises ConfigError when the scene's motion is not a rig's; OutputError when a file cannot be written.
    """
    record = make_record(scene, rate_hz=scene.film.fps)
    write_merged(out / "merged.csv", record.table)
    _write_toml(out / "actuator.toml", scene.declared.to_toml())
    _write_toml(out / "truth.toml", _answer(scene))
    return out / "merged.csv"


def film_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the scene's films."""
    suffix = SUFFIXES[scene.film.codec]
    if scene.stereo.baseline_mm > 0.0:
        return (f"film_left{suffix}", f"film_right{suffix}")
    return (f"film{suffix}",)


def _film(played: Played, ticks: Ints, time_s: Floats, *, out: Path, progress: Progress) -> Floats:
    """Film the scene; return the positions of the markers in the first camera's first frame."""
    scene = played.scene
    seen = views(scene)
    studios = [Studio(scene, view, purpose=str(number)) for number, view in enumerate(seen)]
    occluders = [Occluders(played, view) for view in seen]
    shifts = [shake_path(scene, time_s, scene.rng(f"shake {number}")) for number in range(len(seen))]
    gain, lit = light_gain(scene, time_s), played.lit(time_s)
    half_s = 0.5 * scene.film.exposure / scene.film.fps
    stick_rad, before_rad, after_rad = (played.stick_angle(time_s + offset) for offset in (0.0, -half_s, half_s))
    with ExitStack() as stack:
        writers = [
            stack.enter_context(open_film(out / name, scene.film, view.intrinsics.size_px))
            for name, view in zip(film_names(scene), seen, strict=True)
        ]
        for index, timestamp in enumerate(ticks.tolist()):
            poses = studios[0].poses(after_rad[index] - before_rad[index])
            angles = np.array([stick_rad[index]])
            if poses > 1:
                moments = time_s[index] + half_s * (2.0 * np.arange(poses) + 1.0 - poses) / poses
                angles = played.stick_angle(moments)
            for studio, writer, occluder, shift in zip(studios, writers, occluders, shifts, strict=True):
                luma = studio.frame(
                    angles,
                    shift_px=shift[index],
                    gain=float(gain[index]),
                    bars=occluder.at(float(time_s[index])),
                    lit=bool(lit[index]),
                )
                writer.add(timestamp, luma)
            progress("film", index + 1, len(ticks))
    return studios[0].first_markers(float(stick_rad[0]), shifts[0][0])


def _answer(scene: Scene) -> dict[str, Any]:
    """Return the hidden truth: effects, the rig's own values, the clock, the seed."""
    offset_s, drift_ppm = clock(scene)
    return {
        "seed": scene.seed,
        "effects": {name: asdict(effect) for name, effect in scene.effects.items()},
        "true": dict(scene.values.public),
        "clock": {"offset_s": offset_s, "drift_ppm": drift_ppm},
        "time_factor": scene.protocol.time_factor,
    }


def _experiment(scene: Scene) -> dict[str, Any]:
    names = film_names(scene)
    video: dict[str, Any] = {"path": names[0] if len(names) == 1 else list(names)}
    if scene.film.codec == "png":
        video["fps"] = scene.film.fps
    named = {name: {"file": f"{name}.toml"} for name in ("camera", "markers") if getattr(scene.output, name)}
    rest = {"temperature": {"path": "temps.csv"}, "actuator": {"file": "actuator.toml"}, "output": {"dir": "results"}}
    return {"video": video, **named, **rest, "discover": {"seed": scene.output.seed}}


def _write_toml(path: Path, content: Mapping[str, Any]) -> None:
    write_text(path, tomli_w.dumps(content))
