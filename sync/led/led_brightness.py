"""An LED in the film that shows the heating switch: when it went on and off.

Around the place that the user names, the brightest few pixels are compared with the picture around them in every frame,
so that an LED some pixels beside that place is found and a change of the room's light is not taken for it. The values
fall into two levels; the middle between them separates on from off.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from sync.led.led_events import LightEvents
from torsight.core.errors import ConfigError, NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.progress import AT_ONCE_S, Progress, silent
from torsight.core.series import BY_CHANCE, changes, constant_runs, robust_sigma
from torsight.core.units import Flags, Floats

if TYPE_CHECKING:
    from tracker.frames.frame import FrameSource

# benchmarks/sync/led.py measures what half and twice of these constants do. As they are 91 in 100 readings are whole,
# which find all changes of LEDs, bright and dim, that are given to 6 px, and no other one.
_NEAR_PX: Final = 6
"""How far from the given place the LED is looked for: a place is clicked, or read off a picture, to a few pixels. With
half of it 84 in 100 readings are whole, with twice of it 88."""
_AROUND_PX: Final = 3 * _NEAR_PX
"""How far the picture around it reaches: eight times the area, so that the median is not the LED's."""
_BRIGHTEST: Final = 9
"""Pixels of which the mean is taken: as many as three by three. With half of it 94 in 100 readings are whole, with
twice of it as many as with it."""
_LEAST_STEP: Final = 8.0
"""Least change of brightness, grey levels: 3 % of what eight bits hold. With half of it as many readings are whole,
with twice of it 88 in 100."""
_FLICKER_S: Final = AT_ONCE_S
"""A state that lasts less is a flicker: nobody switches a heating for so short a time. With half of it one change in
eight that is found is none, with twice of it nothing changes."""


def film_light_events(
    film: str | Path,
    place_px: tuple[float, float],
    *,
    fps: float | None = None,
    timestamps: AnyPath | None = None,
    progress: Progress = silent,
) -> LightEvents:
    """Read from a film when an LED went on and off.

    Parameters
    ----------
    film : str or Path
        Film, folder or glob of pictures, as it was tracked.
    place_px : (float, float)
        Where the LED is seen, x and y, to some six pixels.
    fps, timestamps
        As the film was tracked with.
    progress : Progress
        Called with every frame.

    Raises
    ------
    ConfigError
        When the place lies outside the picture.
    InputError
        When the film cannot be read.
    NoResultError
        When nothing at that place goes on or off.
    """
    timestamps = None if timestamps is None else Path(timestamps)
    from tracker.frames.source import open_source

    source = open_source(film, fps=fps, timestamps=timestamps)
    width, height = source.size_px
    x, y = place_px
    if not (0 <= x < width and 0 <= y < height):
        raise ConfigError(
            "the LED lies outside the picture",
            where="led",
            value=f"[{x:g}, {y:g}]",
            limit=f"x below {width}, y below {height}",
        )
    time_s, value = brightness(source, (round(x), round(y)), progress=progress)
    return led_changes(time_s, value, where=f"{film}, around pixel ({x:g}, {y:g})")


def led_changes(time_s: Floats, value: Floats, *, where: str) -> LightEvents:
    """Return the changes of an LED from its brightness (n,) at times (n,) of frames that could be read.

    A brightness that does not fall into two levels is no result; ``where`` is the LED's place, for messages.
    """
    low, high, noise = _two_levels(value)
    least = max(_LEAST_STEP, BY_CHANCE * noise)
    if high - low < least:
        raise NoResultError(
            "no LED goes on or off there",
            where=where,
            value=f"brightness changes by {high - low:.3g} grey levels",
            limit=f"at least {least:.3g}",
            do="point at the LED's middle in the first frame (led = [x, y]), or leave it out",
        )
    lit = _steady(time_s, value > 0.5 * (low + high))
    at = changes(lit)
    if len(at) == 0:
        raise NoResultError("the LED stays as it is through the film", where=where, do="leave led out")
    return LightEvents(time_s[at], lit[at], since_s=time_s[at - 1])


def brightness(source: FrameSource, place: tuple[int, int], *, progress: Progress = silent) -> tuple[Floats, Floats]:
    """Return the times (n,), s, of the frames that can be read, and how bright the LED near a pixel is in each (n,)."""
    x, y = place
    times: list[float] = []
    values: list[float] = []
    for frame in source:
        progress("read the LED", frame.index, max(source.frame_count or 0, frame.index))
        if frame.luma is None or frame.damaged:
            continue
        near = frame.luma[max(y - _NEAR_PX, 0) : y + _NEAR_PX + 1, max(x - _NEAR_PX, 0) : x + _NEAR_PX + 1]
        around = frame.luma[max(y - _AROUND_PX, 0) : y + _AROUND_PX + 1, max(x - _AROUND_PX, 0) : x + _AROUND_PX + 1]
        brightest = np.partition(near, near.size - _BRIGHTEST, axis=None)[-_BRIGHTEST:]
        times.append(frame.time_s)
        values.append(float(brightest.mean()) - float(np.median(around)))
    return np.array(times), np.array(values)


def _two_levels(value: Floats) -> tuple[float, float, float]:
    """Return the middles of two levels of values, and the noise of one value."""
    if len(value) < 2:
        return 0.0, 0.0, 0.0
    # The threshold and both medians in turn, until neither moves: two or three times, fifty at most.
    threshold = 0.5 * float(value.min() + value.max())
    low = high = threshold
    for _ in range(50):
        below, above = value[value <= threshold], value[value > threshold]
        if len(above) == 0:
            break
        low, high = float(np.median(below)), float(np.median(above))
        moved = 0.5 * (low + high)
        if moved == threshold:
            break
        threshold = moved
    away = np.minimum(np.abs(value - low), np.abs(value - high))
    return low, high, robust_sigma(away)


def _steady(time_s: Floats, lit: Flags) -> Flags:
    """Take flickers out: states that last less than a tenth of a second."""
    steady = lit.copy()
    for begin, end in constant_runs(lit)[1:-1]:
        if time_s[end] - time_s[begin] < _FLICKER_S:
            steady[begin:end] = steady[begin - 1]
    return steady
