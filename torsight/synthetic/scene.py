"""``SCENE.toml``: a rig, its temperature programme, its filming and its log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final, get_type_hints

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_switch, get_table, get_tables
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.frozen import Frozen
from torsight.core.words.wording import counted
from torsight.synthetic.effects.hidden import read_hidden
from torsight.synthetic.effects.mechanisms import HiddenEffect
from torsight.synthetic.keys import is_section, key, read_section
from torsight.synthetic.rig.moving_rig import Mechanics, Sensor, Thermal
from torsight.synthetic.rig.protocol import Protocol, read_protocol
from torsight.synthetic.rig.rig_values import Declared, RigValues, declared_from, draw_values


@dataclass(frozen=True, slots=True)
class Motion:
    """Section [motion]: the rig, or a motion given by hand for films that only test a tracker."""

    kind: str = key("rig", "what moves the stick", choices=("rig", "sweep", "turn", "still"))
    start_deg: float = key(60.0, "angle at the start (not the rig)", lower=-3600.0, upper=3600.0)
    sweep_deg: float = key(240.0, "half the range of a sweep", lower=0.0, upper=3600.0)
    period_s: float = key(20.0, "period of a sweep", lower=0.01, upper=1e5)
    rate_deg_s: float = key(20.0, "speed of a turn", lower=-1e4, upper=1e4)
    duration_s: float = key(20.0, "length (not the rig)", lower=0.01, upper=1e5)


@dataclass(frozen=True, slots=True)
class FilmSettings:
    """Section [film]."""

    fps: float = key(30.0, "frame rate", lower=0.1, upper=1000.0)
    codec: str = key(
        "h264", "h264 in .mp4; ffv1 and mjpeg in .mkv; png as a folder", choices=("h264", "ffv1", "mjpeg", "png")
    )
    crf: int = key(18, "quality of H.264, 0 (lossless) to 51", lower=0, upper=51)
    exposure: float = key(0.3, "share of the frame's time for which the shutter is open", lower=0.0, upper=1.0)
    dropped: float = key(0.0, "share of frames that are missing", lower=0.0, upper=0.9)
    jitter: float = key(0.0, "irregularity of the frame times, as a share of the frame's time", lower=0.0, upper=0.45)
    seconds: float = key(0.0, "length of the film; 0 for all of the protocol", lower=0.0, upper=1e6)


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """Section [camera]: a pinhole with OpenCV's distortion that looks at the rotation axis at a tilt."""

    width_px: int = key(640, "width, even", lower=64, upper=4096)
    height_px: int = key(480, "height, even", lower=64, upper=4096)
    focal_px: float = key(1100.0, "focal length", lower=50.0, upper=1e5)
    centre_px: tuple[float, float] = key((0.0, 0.0), "principal point minus the picture's middle")
    distortion: tuple[float, float, float, float, float] = key((0.0, 0.0, 0.0, 0.0, 0.0), "k1, k2, p1, p2, k3")
    distance_mm: float = key(300.0, "from the lens to the axis' foot", lower=1.0, upper=1e5)
    tilt_deg: float = key(0.0, "between the optical axis and the rotation axis", lower=0.0, upper=60.0)
    tilt_towards_deg: float = key(90.0, "direction in the picture towards which it is tilted")
    roll_deg: float = key(0.0, "of the camera about its own axis")
    axis_px: tuple[float, float] = key((0.0, 0.0), "where the axis' foot is seen, minus the principal point")
    base_z_mm: float = key(0.0, "height of the base stick's markers")
    moving_z_mm: float = key(6.0, "height of the moving stick's markers")
    shake_px: float = key(0.0, "standard deviation of the camera's shake", lower=0.0, upper=20.0)
    shake_hz: float = key(3.0, "its bandwidth", lower=0.01, upper=1000.0)


@dataclass(frozen=True, slots=True)
class StereoSettings:
    """Section [stereo]: a second camera, of the same kind, to the right."""

    baseline_mm: float = key(0.0, "distance between the cameras; 0 for one camera", lower=0.0, upper=1e4)
    toe_in_deg: float = key(8.0, "by how much the right camera turns towards the left one's axis")


@dataclass(frozen=True, slots=True)
class StickSettings:
    """Section [sticks]."""

    base_deg: float = key(200.0, "direction of the base stick")
    offset_deg: float = key(0.0, "angle between the sticks when the actuator's angle is zero")
    length_mm: float = key(32.0, "from the axis to a stick's end", lower=1.0, upper=1e4)
    width_mm: float = key(5.0, "width of a stick", lower=0.1, upper=1e4)
    inner_mm: float = key(12.0, "distance of the inner marker from the axis", lower=0.1, upper=1e4)
    outer_mm: float = key(28.0, "distance of the outer marker from the axis", lower=0.1, upper=1e4)
    dot_mm: float = key(1.5, "radius of a marker", lower=0.01, upper=1e3)
    level: float = key(195.0, "grey level of the sticks", lower=0.0, upper=255.0)
    dot_level: float = key(30.0, "grey level of the markers", lower=0.0, upper=255.0)
    hub_mm: float = key(4.0, "radius of the hub on the axis", lower=0.0, upper=1e3)
    hub_level: float = key(85.0, "its grey level", lower=0.0, upper=255.0)


@dataclass(frozen=True, slots=True)
class LightSettings:
    """Section [light]: background, light and noise, in grey levels of 8 bits."""

    background: float = key(115.0, "grey level of the background", lower=0.0, upper=255.0)
    texture: float = key(10.0, "standard deviation of its texture", lower=0.0, upper=100.0)
    grain_px: float = key(3.0, "size of the texture's grain", lower=0.5, upper=100.0)
    plate_mm: float = key(0.0, "radius of a light disk under the sticks", lower=0.0, upper=1e4)
    plate_level: float = key(150.0, "its grey level", lower=0.0, upper=255.0)
    uneven: float = key(0.0, "relative change of the light from one side to the other", lower=0.0, upper=0.9)
    uneven_towards_deg: float = key(30.0, "direction in the picture in which it gets brighter")
    blur_px: float = key(0.7, "standard deviation of the lens' blur", lower=0.05, upper=10.0)
    read_noise: float = key(1.5, "noise of the sensor in the dark", lower=0.0, upper=100.0)
    shot_noise: float = key(0.01, "variance per grey level", lower=0.0, upper=10.0)
    flicker: float = key(0.0, "relative amplitude of flicker", lower=0.0, upper=0.95)
    flicker_hz: float = key(7.3, "its frequency", lower=0.01, upper=1e4)


@dataclass(frozen=True, slots=True)
class LedSettings:
    """Section [led]: an LED in the picture that is lit while a spring is switched on."""

    radius_px: float = key(0.0, "size; 0 for none", lower=0.0, upper=100.0)
    position_px: tuple[float, float] = key((40.0, 40.0), "where it is seen")
    level: float = key(250.0, "grey level when lit", lower=0.0, upper=255.0)


@dataclass(frozen=True, slots=True)
class LogSettings:
    """Section [log]: the temperature log's clock. Temperature time = film time · (1 + drift) + offset."""

    offset_s: float = key(0.0, "log's clock minus film's at the film's start", lower=-1e6, upper=1e6)
    drift_ppm: float = key(0.0, "drift of the log's clock", lower=-1e4, upper=1e4)
    before_s: float = key(2.0, "log runs this long before the film", lower=0.0, upper=1e5)
    after_s: float = key(2.0, "and this long after it", lower=0.0, upper=1e5)
    lost: float = key(0.0, "share of rows that are lost", lower=0.0, upper=0.95)


@dataclass(frozen=True, slots=True)
class FilmEvent:
    """One [[event]]: something that happens to the film for a while."""

    kind: str = key("hand", "what happens", choices=("hand", "wire", "dark", "bump"))
    start_s: float = key(5.0, "when it begins, on the film's clock", lower=-1e6, upper=1e6)
    duration_s: float = key(1.0, "how long it lasts (not a bump)", lower=0.0, upper=1e6)
    over: str = key(
        "moving_outer",
        "what a hand or wire covers at its start",
        choices=("base_inner", "base_outer", "moving_inner", "moving_outer", "moving", "base"),
    )
    width_px: float = key(0.0, "its width; 0 for 60 (hand) or 4 (wire)", lower=0.0, upper=1000.0)
    level: float = key(140.0, "its grey level", lower=0.0, upper=255.0)
    shift_px: tuple[float, float] = key((3.0, 2.0), "how far a bump moves the picture")


@dataclass(frozen=True, slots=True)
class OutputSettings:
    """Section [output]: what ``experiment.toml`` names."""

    camera: bool = key(default=True, text="name camera.toml")
    markers: bool = key(default=False, text="name markers.toml, instead of leaving them to be found")
    seed: int = key(0, "seed of the discovery", lower=0, upper=2**31)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Scene(Frozen):
    """Complete description of a synthetic experiment."""

    seed: int
    declared: Declared
    values: RigValues
    mechanics: Mechanics
    thermal: Thermal
    sensor: Sensor
    protocol: Protocol
    effects: Mapping[str, HiddenEffect]
    motion: Motion
    film: FilmSettings
    camera: CameraSettings
    stereo: StereoSettings
    sticks: StickSettings
    light: LightSettings
    led: LedSettings
    log: LogSettings
    events: tuple[FilmEvent, ...]
    output: OutputSettings

    def __repr__(self) -> str:
        hidden = ", ".join(self.effects) or "no effects"
        done = counted(len(self.protocol.half_cycles), "half-cycle")
        film = f"{self.camera.width_px} × {self.camera.height_px} px at {self.film.fps:g} frames/s"
        return f"Scene(seed {self.seed}, {hidden}, {done}, {film})"

    def rng(self, purpose: str) -> np.random.Generator:
        """Return the random generator for one purpose, independent of the draws for other purposes."""
        return np.random.default_rng([self.seed, *purpose.encode()])


SECTIONS: Final[Mapping[str, type[Any]]] = {
    name: kind for name, kind in get_type_hints(Scene).items() if is_section(kind)
}
"""Sections with plain keys; [actuator], [rig], [protocol], [effects] and [[event]] have their own layout."""


def read_scene(path: AnyPath) -> Scene:
    """Read ``SCENE.toml``; absent keys have the values of the reference rig and the default film.

    Raises ConfigError for an unknown key (the nearest known one is named), or a value of the wrong kind or out of
    range; InputError when the file cannot be read.
    """
    path = Path(path)
    return scene_from(read_toml(path, kind="scene"), where=str(path))


def scene_from(content: Mapping[str, Any], *, where: str = "scene", seed: int | None = None) -> Scene:
    """Build a scene from the content of its file; ``seed`` replaces the file's."""
    check_keys(content, ("seed", "actuator", "rig", "protocol", "effects", "event", *SECTIONS), where=where)
    if seed is None:
        seed = int(get_number(content, "seed", where=where, default=0, lower=0))
    sections = {
        name: read_section(kind, get_table(content, name, where=where), where=f"{where}, [{name}]")
        for name, kind in SECTIONS.items()
    }
    declared = declared_from(get_table(content, "actuator", where=where), where=f"{where}, [actuator]")
    scene = Scene(
        seed=seed,
        declared=declared,
        values=_true_values(get_table(content, "rig", where=where), declared, seed, where=where),
        protocol=read_protocol(get_table(content, "protocol", where=where), where=where),
        effects=read_hidden(get_table(content, "effects", where=where), where=where),
        events=tuple(
            read_section(FilmEvent, item, where=place) for item, place in get_tables(content, "event", where=where)
        ),
        **sections,
    )
    _check(scene, where=where)
    return scene


def _true_values(table: Mapping[str, Any], declared: Declared, seed: int, *, where: str) -> RigValues:
    place = f"{where}, [rig]"
    check_keys(table, ("as_declared", "true"), where=place)
    given = get_table(table, "true", where=place)
    check_keys(given, tuple(declared.flat()), where=f"{where}, [rig.true]")
    numbers = {name: get_number(given, name, where=f"{where}, [rig.true]") for name in given}
    rng = None if get_switch(table, "as_declared", where=place) else np.random.default_rng([seed, *b"values"])
    return draw_values(declared, given=numbers, rng=rng)


def _check(scene: Scene, *, where: str) -> None:
    for name in ("width_px", "height_px"):
        value = getattr(scene.camera, name)
        if value % 2:
            raise ConfigError(f"'{name}' is odd", where=f"{where}, [camera]", value=value, limit="an even number")
    if not scene.sticks.inner_mm < scene.sticks.outer_mm <= scene.sticks.length_mm:
        raise ConfigError(
            "markers do not lie on the stick in order",
            where=f"{where}, [sticks]",
            value=f"inner_mm {scene.sticks.inner_mm:g}, outer_mm {scene.sticks.outer_mm:g}",
            limit=f"inner_mm < outer_mm <= length_mm ({scene.sticks.length_mm:g})",
        )


def demo_scene() -> Scene:
    """Return the scene of ``torsight demo``, which comes with the package."""
    with resources.as_file(resources.files("torsight.synthetic") / "scenes" / "demo.toml") as path:
        return read_scene(path)
