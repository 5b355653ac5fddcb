"""A log after its repair, and the list of repairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from sync.log.column_names import LogColumn
from torsight.core.frozen import Frozen
from torsight.core.records import TemperatureLog
from torsight.core.words.shown import Shown


@dataclass(frozen=True, slots=True)
class Repair:
    """One kind of repair: its short name, the number of rows or fields, and a sentence for the user.

    The names are ``spike``, ``stuck``, ``repeated_stamp``, ``reordered``, ``restart``, ...; the sentence gives the
    finding, the repair, and the location of the first one.
    """

    kind: str
    count: int
    text: str

    def to_json(self) -> dict[str, object]:
        """Return the repair's form in ``sync.json``."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Restart:
    """A restart of the logging clock, after which the timestamps were shifted to continue those before.

    ``index`` is the first row of the log after the restart, ``shift_s`` the shift of the timestamps from there on.
    ``gap_s`` is the time between the rows before and after the restart, with its standard deviation: infinite where the
    log does not determine the gap, which is then one usual step.
    """

    index: int
    shift_s: float
    gap_s: float
    gap_sigma_s: float

    def to_json(self) -> dict[str, object]:
        """Return the restart's form in ``sync.json``."""
        return {"row": self.index, "shift_s": self.shift_s, "gap_s": self.gap_s, "gap_sigma_s": self.gap_sigma_s}


@dataclass(frozen=True, slots=True, repr=False)
class LogReading(Frozen, Shown):
    """A temperature log with strictly increasing timestamps, and its repairs.

    Attributes
    ----------
    log : TemperatureLog
        The repaired log; its clock is that of the rows before the first restart.
    repairs : tuple of Repair
        All changes: fields that were changed, dropped or set to NaN.
    restarts : tuple of Restart
        Restarts of the logging clock, in order.
    zero : str or None
        Instant (ISO 8601) of time 0 where the timestamps were dates; None where they were seconds.
    coarse_s : float
        Step of timestamps that are coarser than the rows, s; they are read as truncated, but may have been rounded. 0
        where every row has a distinct timestamp.
    columns : mapping of str to LogColumn
        The file's columns by their roles ``time, a, b, ...``.
    notes : tuple of str
        Notes for the user on columns that were guessed or converted.
    """

    log: TemperatureLog
    repairs: tuple[Repair, ...] = ()
    restarts: tuple[Restart, ...] = ()
    zero: str | None = None
    coarse_s: float = 0.0
    columns: Mapping[str, LogColumn] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def facts(self) -> dict[str, str]:
        """Return facts for display: the log's range, the instant of time 0, and the repairs."""
        repaired = ", ".join(f"{repair.kind} {repair.count}" for repair in self.repairs) or "nothing"
        zero = {} if self.zero is None else {"time 0": self.zero}
        return {**self.log.facts(), **zero, "repaired": repaired, "restarts": str(len(self.restarts))}

    def _columns(self) -> Mapping[str, Any]:
        return dict(self.log.to_frame())

    def _draw(self, axes: Any) -> None:
        self.log.plot(axes)
        for restart in self.restarts:
            axes.axvline(self.log.time_s[restart.index], color="grey", linestyle=":", linewidth=0.8)
