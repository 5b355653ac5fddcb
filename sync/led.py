"""The times at which an LED on the film, which shows the heating switch, is switched on and off.

In: a film and a position in its picture (px), or a file of times. Out: :class:`LightEvents`, changes on the film's
clock (s) with their direction.

In every frame the few brightest pixels near the position that the user gives are compared with the picture around them,
so that an LED some pixels beside this position is found, and a change of the room's light is not mistaken for the LED.
The values have two levels; the middle between them separates on from off.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import first_row, read_table
from torsight.core.files.tables import switch_column
from torsight.core.progress import AT_ONCE_S, Progress, silent
from torsight.core.series import BY_CHANCE, changes, constant_runs, robust_sigma
from torsight.core.units import Flags, Floats, Ints
from torsight.core.words.shown import Shown, span

if TYPE_CHECKING:
    from tracker.frames.frame import FrameSource


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LightEvents(Shown):
    """Changes of the LED on the film.

    Attributes
    ----------
    time_s : (n,) float64
        Time of the first frame that shows the change, film clock, increasing.
    goes_on : (n,) bool
        True where the LED is switched on.
    since_s : (n,) float64 or None
        Time of the last frame before the change; None: the film's frame before ``time_s``.
    """

    time_s: Floats
    goes_on: Flags
    since_s: Floats | None = None

    def at_pace(self, pace: float) -> LightEvents:
        """Return the same changes with times multiplied by ``pace``."""
        since_s = None if self.since_s is None else pace * self.since_s
        return LightEvents(pace * self.time_s, self.goes_on, since_s)

    def facts(self) -> dict[str, str]:
        """Return the number of changes and their range of times."""
        return {"changes": str(len(self.time_s)), "time": span(self.time_s, "s")}

    def _columns(self) -> dict[str, Any]:
        since = {} if self.since_s is None else {"since_s": self.since_s}
        return {"time_s": self.time_s, "on": self.goes_on, **since}

    def _draw(self, axes: Any) -> None:
        axes.step(self.time_s, self.goes_on, where="post")
        axes.set(xlabel="time, s", ylabel="LED", yticks=[0, 1], yticklabels=["off", "on"])


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Changes of the LED or of a switch (n,): middle and length of the interval of each, s; direction."""

    time_s: Floats
    step_s: Floats
    goes_on: Flags

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, rows: Ints | Flags) -> Changes:
        """Return the changes with the given indices or mask."""
        return Changes(self.time_s[rows], self.step_s[rows], self.goes_on[rows])


def switchings_of(time_s: Floats, switch: Flags) -> Changes:
    """Return a switch's changes, each between the row that shows it and the one before."""
    at = changes(switch)
    return Changes(0.5 * (time_s[at] + time_s[at - 1]), time_s[at] - time_s[at - 1], switch[at])


def read_light_events(path: AnyPath) -> LightEvents:
    """Read film times of an LED: ``time_s`` and, optionally, ``on`` (1: it goes on, 0: it goes off).

    Without ``on`` the LED is switched on at every time. InputError when the file cannot be read or holds no times.
    """
    path = Path(path)
    table = read_table(path, required=("time_s",))
    time_s = table["time_s"].to_numpy(np.float64)
    for _, place in first_row(~np.isfinite(time_s), where=path, column="time_s"):
        raise InputError("has no time", where=place, do="correct that row")
    on = switch_column(table, "on", where=str(path))
    order = np.argsort(time_s, kind="stable")
    return LightEvents(time_s[order], (np.ones(len(time_s), np.bool_) if on is None else on)[order])


# benchmarks/sync/led.py measures the effect of half and twice of these constants, for bright and dim LEDs whose
# position is given to 6 px. With these values 91 in 100 readings are complete: they find all changes, and no false one.
_NEAR_PX: Final = 6
"""Radius of the search around the given position, which is clicked, or read off a picture, to a few pixels. With half
this value 84 in 100 readings are complete, with twice 88."""
_AROUND_PX: Final = 3 * _NEAR_PX
"""Radius of the picture around: eight times the area, so that the median is not that of the LED."""
_BRIGHTEST: Final = 9
"""Number of brightest pixels that are averaged: three by three. With half this value 94 in 100 readings are complete,
with twice as many as with this value."""
_FLICKER_S: Final = AT_ONCE_S
"""Duration below which a state is a flicker: no heating is switched for so short a time. With half this value one
detected change in eight is false, with twice nothing changes."""


def film_light_events(
    film: str | Path,
    place_px: tuple[float, float],
    *,
    fps: float | None = None,
    timestamps: AnyPath | None = None,
    progress: Progress = silent,
) -> LightEvents:
    """Read the times at which an LED on a film is switched on and off.

    Parameters
    ----------
    film : str or Path
        Film, folder or glob of pictures, as it was tracked.
    place_px : (float, float)
        Position of the LED in the picture, x and y, to about six pixels.
    fps, timestamps
        As in the tracking of the film.
    progress : Progress
        Called with every frame.

    Raises
    ------
    ConfigError
        When the position lies outside the picture.
    InputError
        When the film cannot be read.
    NoResultError
        When nothing at this position is switched on or off.
    """
    timestamps = None if timestamps is None else Path(timestamps)
    from tracker.frames.source import open_source

    source = open_source(film, fps=fps, timestamps=timestamps)
    width, height = source.size_px
    x, y = place_px
    if not (0 <= x < width and 0 <= y < height):
        limit = f"x below {width}, y below {height}"
        raise ConfigError("the LED lies outside the picture", where="led", value=f"[{x:g}, {y:g}]", limit=limit)
    time_s, value = brightness(source, (round(x), round(y)), progress=progress)
    return led_changes(time_s, value, where=f"{film}, around pixel ({x:g}, {y:g})")


def led_changes(time_s: Floats, value: Floats, *, where: str) -> LightEvents:
    """Return the changes of an LED from its brightness (n,) at times (n,) of frames that could be read.

    A brightness without two levels raises NoResultError; ``where`` is the LED's position, for messages.
    """
    # Loaded here: it takes as long as tracking starts.
    from tracker.follow.reading import LEAST_STEP

    low, high, noise = _two_levels(value)
    # As many readings are complete with twice the tracker's least step (benchmarks/sync/led.py).
    least = max(LEAST_STEP, BY_CHANCE * noise)
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
        raise NoResultError("the LED does not change during the film", where=where, do="leave led out")
    return LightEvents(time_s[at], lit[at], since_s=time_s[at - 1])


def brightness(source: FrameSource, place: tuple[int, int], *, progress: Progress = silent) -> tuple[Floats, Floats]:
    """Return the times (n,), s, of the readable frames, and the brightness (n,) of the LED near a pixel in each."""
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
    """Return the medians of the two levels of values, and the noise of one value."""
    if len(value) < 2:
        return 0.0, 0.0, 0.0
    low, high = float(value.min()), float(value.max())
    # Alternate threshold and medians until they are constant: usually two or three times.
    for _ in range(50):
        before, above = (low, high), value > 0.5 * (low + high)
        if not above.any():
            break
        low, high = float(np.median(value[~above])), float(np.median(value[above]))
        if (low, high) == before:
            break
    away = np.minimum(np.abs(value - low), np.abs(value - high))
    return low, high, robust_sigma(away)


def _steady(time_s: Floats, lit: Flags) -> Flags:
    """Return the states without flickers, which last less than a tenth of a second."""
    steady = lit.copy()
    for begin, end in constant_runs(lit)[1:-1]:
        if time_s[end] - time_s[begin] < _FLICKER_S:
            steady[begin:end] = steady[begin - 1]
    return steady
