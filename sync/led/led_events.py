"""Changes of an LED on the film that shows the heating switch, and the file that may list them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from torsight.core.errors import InputError
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import first_row, read_table
from torsight.core.files.tables import switch_column
from torsight.core.units import Flags, Floats
from torsight.core.words.shown import Shown, span


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


def read_light_events(path: AnyPath) -> LightEvents:
    """Read film times of an LED: ``time_s`` and, optionally, ``on`` (1: it goes on, 0: it goes off).

    Without ``on`` the LED is switched on at every time.

    Raises
    ------
    InputError
        When the file cannot be read or holds no times.
    """
    path = Path(path)
    table = read_table(path, required=("time_s",))
    time_s = table["time_s"].to_numpy(np.float64)
    for _, place in first_row(~np.isfinite(time_s), where=path, column="time_s"):
        raise InputError("has no time", where=place, do="correct that row")
    on = switch_column(table, "on", where=str(path))
    order = np.argsort(time_s, kind="stable")
    return LightEvents(time_s[order], (np.ones(len(time_s), np.bool_) if on is None else on)[order])
