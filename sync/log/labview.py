"""The header of a LabVIEW measurement file (.lvm): decimal sign, units of the columns, and the time step.

With the option "empty time column" such a file has no times; they follow from ``X0`` and ``Delta_X`` of the channel's
header. Format: NI, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from sync.log.header import split_line
from sync.log.repairs import Repair

if TYPE_CHECKING:
    import pandas as pd

_FIRST_LINE: Final = "LabVIEW Measurement"


@dataclass(frozen=True, slots=True)
class LabviewHeader:
    """Information in the lines before the names; empty for a file of another kind.

    Decimal sign, units by column (the column of times has none), time of the first row, and step from row to row.
    """

    decimal: str = ""
    units: tuple[str, ...] = ()
    begin_s: float = 0.0
    step_s: float | None = None

    def fill_times(self, frame: pd.DataFrame, place: int, repairs: list[Repair]) -> None:
        """Fill the column of times if it is empty."""
        if self.step_s is not None and not frame.iloc[:, place].notna().any():
            frame.isetitem(place, self.begin_s + self.step_s * np.arange(len(frame), dtype=np.float64))
            text = f"the column of times is empty: they follow from Delta_X, {self.step_s:g} s"
            repairs.append(Repair("times", len(frame), text))


def labview_header(preamble: Sequence[str], delimiter: str) -> LabviewHeader:
    """Return the information in a LabVIEW preamble."""
    if not preamble or not preamble[0].strip().startswith(_FIRST_LINE):
        return LabviewHeader()
    entries: dict[str, list[str]] = {}
    for line in preamble:
        key, *values = split_line(line, delimiter)
        entries[key] = values
    decimal = next(iter(entries.get("Decimal_Separator", [])), "")
    step_s = _number(entries.get("Delta_X"), decimal)
    return LabviewHeader(
        decimal=decimal if decimal in (".", ",") else "",
        units=("", *entries.get("Y_Unit_Label", ())) if any(entries.get("Y_Unit_Label", ())) else (),
        begin_s=_number(entries.get("X0"), decimal) or 0.0,
        step_s=step_s if step_s is not None and step_s > 0.0 else None,
    )


def _number(values: Sequence[str] | None, decimal: str) -> float | None:
    try:
        number = float(values[0].replace(decimal or ".", ".")) if values else math.nan
    except ValueError:
        return None
    return number if math.isfinite(number) else None
