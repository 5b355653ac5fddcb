"""Changes of a heating switch, or of the LED that shows it: when each fell, and to within how much."""

from __future__ import annotations

from dataclasses import dataclass

from torsight.core.series import changes
from torsight.core.units import Flags, Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Changes of the LED or of a switch (n,): middle and length of the interval that each fell in, s; direction."""

    time_s: Floats
    step_s: Floats
    goes_on: Flags

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, rows: Ints | Flags) -> Changes:
        """Return some of the changes."""
        return Changes(self.time_s[rows], self.step_s[rows], self.goes_on[rows])


def switchings_of(time_s: Floats, switch: Flags) -> Changes:
    """Return a switch's changes, each between the row that shows it and the one before."""
    at = changes(switch)
    return Changes(0.5 * (time_s[at] + time_s[at - 1]), time_s[at] - time_s[at - 1], switch[at])
