"""Disturbances in front of and inside the camera, frame by frame: times, shake, light, hands and wires."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from torsight.core.units import DEG, Floats, Ints
from torsight.synthetic.experiment import Played
from torsight.synthetic.filming.optics import View
from torsight.synthetic.filming.picture import MARGIN_PX
from torsight.synthetic.scene import FilmEvent, FilmSettings, Scene


@dataclass(frozen=True, slots=True)
class Bar:
    """Something in front of the picture: a bar with round ends, x and y of both (4,), half its width, grey level."""

    ends_px: Floats
    radius_px: float
    level: float


def frame_ticks(settings: FilmSettings, duration_s: float, tick: Fraction, rng: np.random.Generator) -> Ints:
    """Return the timestamps of the frames that the film has, in ticks of its container."""
    # A length of a whole number of frames may be shorter by a rounding error.
    count = max(1, int(duration_s * settings.fps + 1e-9))
    place = np.arange(count, dtype=np.float64)
    place[1:] += settings.jitter * rng.uniform(-1.0, 1.0, count - 1) if count > 1 else 0.0
    kept = rng.random(count) >= settings.dropped
    kept[0] = True
    ticks = np.rint(place / settings.fps / float(tick)).astype(np.int64)
    return ticks[kept]


def shake_path(scene: Scene, time_s: Floats, rng: np.random.Generator) -> Floats:
    """Return the displacement of the picture in each frame (n, 2), px: shake and bumps."""
    shift = np.zeros((len(time_s), 2))
    if scene.camera.shake_px > 0.0:
        # A first-order Gauss-Markov process: its correlation ends after 1 / (2π f).
        step_s = np.diff(time_s, prepend=time_s[0])
        keep = np.exp(-2.0 * math.pi * scene.camera.shake_hz * step_s)
        push = rng.standard_normal((len(time_s), 2)) * np.sqrt(1.0 - keep**2)[:, None]
        state = rng.standard_normal(2)
        for i in range(len(time_s)):
            state = keep[i] * state + push[i]
            shift[i] = scene.camera.shake_px * state
    for event in scene.events:
        if event.kind == "bump":
            shift[time_s >= event.start_s] += np.array(event.shift_px)
    limit = MARGIN_PX - 2.0  # rays are interpolated between a pixel and the next
    return np.clip(shift, -limit, limit)


def light_gain(scene: Scene, time_s: Floats) -> Floats:
    """Return the light of each frame, relative: flicker, and the light switched off."""
    gain = 1.0 + scene.light.flicker * np.sin(2.0 * math.pi * scene.light.flicker_hz * time_s)
    for event in scene.events:
        if event.kind == "dark":
            off = (time_s >= event.start_s) & (time_s < event.start_s + event.duration_s)
            gain = np.where(off, 0.02, gain)  # a room is never quite dark
    return np.asarray(gain, np.float64)


def marker_points(scene: Scene, stick_rad: float) -> Floats:
    """Return the four markers in the world (4, 3), mm, in the order of the tracks, at a stick angle."""
    points = []
    for direction, z_mm in (
        (scene.sticks.base_deg * DEG, scene.camera.base_z_mm),
        (scene.sticks.base_deg * DEG + stick_rad, scene.camera.moving_z_mm),
    ):
        unit = np.array([math.cos(direction), math.sin(direction)])
        points += [[*(radius * unit), z_mm] for radius in (scene.sticks.inner_mm, scene.sticks.outer_mm)]
    return np.array(points)


class Occluders:
    """Hands and wires of a scene as one camera sees them."""

    def __init__(self, played: Played, view: View) -> None:
        self._size_px = view.intrinsics.size_px
        self._bars: list[tuple[FilmEvent, Floats]] = []
        for event in played.scene.events:
            if event.kind in ("hand", "wire"):
                stick_rad = float(played.stick_angle(np.array([event.start_s]))[0])
                seen = view.project(marker_points(played.scene, stick_rad))
                names = {"base_inner": [0], "base_outer": [1], "moving_inner": [2], "moving_outer": [3]}
                chosen = names.get(event.over, [0, 1] if event.over == "base" else [2, 3])
                self._bars.append((event, seen[chosen].mean(axis=0)))

    def at(self, time_s: float) -> list[Bar]:
        """Return the bars that cover the picture at an instant of the film's clock."""
        found = []
        for event, target_px in self._bars:
            since_s = time_s - event.start_s
            if 0.0 <= since_s < event.duration_s:
                make = self._hand if event.kind == "hand" else self._wire
                found.append(make(event, target_px, since_s))
        return found

    def _hand(self, event: FilmEvent, target_px: Floats, since_s: float) -> Bar:
        """Return a hand that comes in from the nearer side of the picture, stays and leaves."""
        radius = 0.5 * (event.width_px or 60.0)
        from_right = target_px[0] > 0.5 * self._size_px[0]
        outside = np.array([self._size_px[0] + 2.0 * radius if from_right else -2.0 * radius, target_px[1] + 80.0])
        # About a metre a second over the usual camera's view of 17 cm.
        entry_s = min(0.15, 0.25 * event.duration_s)
        reach = min(since_s, event.duration_s - since_s, entry_s) / entry_s
        tip = outside + reach * (target_px - outside)
        return Bar(np.array([*outside, *tip]), radius, event.level)

    def _wire(self, event: FilmEvent, target_px: Floats, since_s: float) -> Bar:
        """Return a wire across the whole picture that passes over the target in the middle of its time."""
        direction = np.array([math.cos(0.9), math.sin(0.9)])
        across = np.array([-direction[1], direction[0]])
        off = 12.0 * (since_s / event.duration_s - 0.5)
        length = float(sum(self._size_px))
        middle = target_px + off * across
        ends = np.array([*(middle - length * direction), *(middle + length * direction)])
        return Bar(ends, 0.5 * (event.width_px or 4.0), event.level)
