"""From a scene to a record: the rig's signals, as camera and log observe them, and their clocks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.records import SyncedTable
from torsight.core.units import DEG, PPM, Flags, Floats
from torsight.core.words.shown import Shown
from torsight.synthetic.effects.hidden import ClockOffset
from torsight.synthetic.rig.moving_rig import RigRecord, Setup, between_samples, reading_angle, simulate_rig
from torsight.synthetic.scene import Scene, scene_from


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A scene's signals on the film's clock.

    The rig's record, None where the motion is prescribed, begins ``before_s`` before the film, which lasts
    ``duration_s``. ``reading_error_rad`` (n,) is what a camera reads less the actuator's angle, every ``step_s`` from
    ``before_s`` before the film on: play depends on the history, so that one instant does not tell it. A slipped marker
    is no part of it.
    """

    scene: Scene
    rig: RigRecord | None
    before_s: float
    duration_s: float
    step_s: float
    reading_error_rad: Floats

    def actuator_angle(self, time_s: Floats) -> Floats:
        """Return the actuator angle φ, rad, at instants of the film's clock."""
        if self.rig is None:
            return hand_motion(self.scene, time_s)
        return self.rig.angle_at(time_s + self.before_s)

    def stick_angle(self, time_s: Floats) -> Floats:
        """Return the moving stick's direction less the base stick's, rad, at instants of the film's clock."""
        slips = {name: effect for name, effect in self.scene.effects.items() if name == "marker_slip"}
        error_rad = between_samples(self.reading_error_rad, (time_s + self.before_s) / self.step_s)
        # A slip may happen between two samples.
        read = reading_angle(self.actuator_angle(time_s) + error_rad, time_s, slips)
        return read + self.scene.sticks.offset_deg * DEG

    def lit(self, time_s: Floats) -> Flags:
        """Return whether a spring is switched on at instants of the film's clock."""
        if self.rig is None:
            return np.zeros(time_s.shape, bool)
        index = np.clip(((time_s + self.before_s) / self.rig.step_s).astype(np.int64), 0, len(self.rig) - 1)
        on: Flags = (self.rig.heat_a | self.rig.heat_b)[index]
        return on


def hand_motion(scene: Scene, time_s: Floats) -> Floats:
    """Return the angle of a prescribed motion, rad."""
    motion = scene.motion
    angle_deg = np.full(time_s.shape, motion.start_deg)
    if motion.kind == "sweep":
        angle_deg = angle_deg + motion.sweep_deg * (np.cos(2.0 * math.pi * time_s / motion.period_s) - 1.0)
    elif motion.kind == "turn":
        angle_deg = angle_deg + motion.rate_deg_s * time_s
    return angle_deg * DEG


def play_scene(scene: Scene) -> Played:
    """Simulate the scene's rig (nothing is filmed or written)."""
    if scene.motion.kind != "rig":
        # Where play turns round is known to 1/16 of a frame's motion.
        step_s = 1.0 / (16 * scene.film.fps)
        time_s = np.arange(0.0, scene.motion.duration_s + 2.0 * step_s, step_s)
        error_rad = _reading_error(scene, hand_motion(scene, time_s), time_s)
        return Played(scene, None, 0.0, scene.motion.duration_s, step_s, error_rad)
    total_s = scene.film.seconds or scene.protocol.duration_s
    # Whole samples, so that the film begins at one.
    before_s = math.ceil(scene.log.before_s / scene.sensor.sample_s) * scene.sensor.sample_s
    rig = simulate_rig(
        scene.values,
        scene.protocol,
        effects=scene.effects,
        setup=Setup(scene.mechanics, scene.thermal, scene.sensor),
        rng=scene.rng("sensor"),
        before_s=before_s,
        after_s=scene.log.after_s,
    )
    error_rad = _reading_error(scene, rig.angle_rad, rig.time_s - before_s)
    return Played(scene, rig, before_s, min(total_s, scene.protocol.duration_s), rig.step_s, error_rad)


def _reading_error(scene: Scene, angle_rad: Floats, time_s: Floats) -> Floats:
    """Return what a camera reads less the angle, rad, without what happens at one moment of the film."""
    steady = {name: effect for name, effect in scene.effects.items() if name != "marker_slip"}
    return reading_angle(angle_rad, time_s, steady) - angle_rad


def clock(scene: Scene) -> tuple[float, float]:
    """Return offset, s, and drift, ppm, of the log's clock: the sums of the declared and the hidden values."""
    offset_s, drift_ppm = hidden_clock(scene)
    return scene.log.offset_s + offset_s, scene.log.drift_ppm + drift_ppm


def hidden_clock(scene: Scene) -> tuple[float, float]:
    """Return the hidden offset, s, and drift, ppm, which ``[log]`` does not declare."""
    effect = scene.effects.get("clock_offset")
    return (effect.offset_s, effect.drift_ppm) if isinstance(effect, ClockOffset) else (0.0, 0.0)


def log_columns(played: Played) -> dict[str, Any]:
    """Return the temperature log on its own clock, column by column as in ``temps.csv``."""
    scene = played.scene
    offset_s, drift_ppm = clock(scene)
    rig = played.rig
    if rig is None:
        film_s = np.arange(-scene.log.before_s, played.duration_s + scene.log.after_s, scene.sensor.sample_s)
        noise = scene.rng("sensor").standard_normal((len(film_s), 2)) * scene.sensor.noise_c + scene.thermal.room_c
        columns: dict[str, Any] = {"temp_a_c": noise[:, 0], "temp_b_c": noise[:, 1]}
    else:
        film_s = rig.time_s - played.before_s
        columns = {
            "temp_a_c": rig.temp_a_c,
            "temp_b_c": rig.temp_b_c,
            "heat_a": rig.heat_a,
            "heat_b": rig.heat_b,
            "current_a_a": rig.current_a_a.round(4),
            "current_b_a": rig.current_b_a.round(4),
        }
    columns = {"time_s": (film_s * (1.0 + drift_ppm * PPM) + offset_s).round(6), **columns}
    kept = (film_s <= played.duration_s + scene.log.after_s) & (
        scene.rng("lost rows").random(len(film_s)) >= scene.log.lost
    )
    return {name: values[kept] for name, values in columns.items()}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Record(Shown):
    """A record without a film, for the discovery benchmark.

    Attributes
    ----------
    table : SyncedTable
        The merged table that a film and a log would have given.
    angle_rad : (n,) float64
        The true angle as a camera would read it, without noise.
    played : Played
        The signals behind it.
    """

    table: SyncedTable
    angle_rad: Floats
    played: Played

    def facts(self) -> dict[str, str]:
        """Return facts about the table for display."""
        return self.table.facts()

    def _columns(self) -> dict[str, Any]:
        return {**dict(self.table.to_frame()), "true_deg": self.angle_rad / DEG}

    def _draw(self, axes: Any) -> None:
        self.table.plot(axes)


def make_record(
    content: Mapping[str, Any] | Scene, *, seed: int | None = None, rate_hz: float = 4.0, sigma_deg: float = 0.06
) -> Record:
    """Return the merged table of a scene without filming it.

    Parameters
    ----------
    content : mapping or Scene
        Content of a scene file (film, camera and light do not matter).
    seed : int, optional
        Replaces the scene's seed.
    rate_hz : float
        Frames per second.
    sigma_deg : float
        Standard deviation of the angle's noise.

    Returns
    -------
    Record
        Its temperatures are shifted by the declared offset of the clocks: the offset of ``[log]`` is removed, a hidden
        ``clock_offset`` is not.
    """
    scene = content if isinstance(content, Scene) else scene_from(content, seed=seed)
    if scene.motion.kind != "rig":
        raise ConfigError("has no rig", where="[motion] kind", value=scene.motion.kind, limit="rig")
    played = play_scene(scene)
    rig = played.rig
    assert rig is not None  # noqa: S101 - play_scene gives one for every rig motion
    time_s = np.arange(0.0, played.duration_s, 1.0 / rate_hz)
    angle_rad = played.stick_angle(time_s)
    noise = scene.rng("angle").standard_normal(len(time_s)) * sigma_deg * DEG
    shift_s, drift_ppm = hidden_clock(scene)
    # Temperature time = film time (1 + drift) + offset: at film time t the log shows an earlier temperature.
    then_s = (time_s - shift_s) / (1.0 + drift_ppm * PPM) + played.before_s
    index = np.clip(np.rint(then_s / scene.sensor.sample_s).astype(np.int64), 0, len(rig) - 1)
    table = SyncedTable(
        time_s=time_s,
        angle_rad=angle_rad + noise,
        angle_sigma_rad=np.full(len(time_s), sigma_deg * DEG),
        temp_a_c=np.interp(then_s, rig.time_s, rig.temp_a_c),
        temp_b_c=np.interp(then_s, rig.time_s, rig.temp_b_c),
        heat_a=rig.heat_a[index],
        heat_b=rig.heat_b[index],
    )
    return Record(table=table, angle_rad=angle_rad, played=played)
