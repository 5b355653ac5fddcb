"""Changes of a heating switch, or of the LED that shows it: the interval within which each occurred."""

from __future__ import annotations

from dataclasses import dataclass

from torsight.core.series import changes
from torsight.core.units import Flags, Floats, Ints


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
