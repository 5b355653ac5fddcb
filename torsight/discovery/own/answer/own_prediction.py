"""Predictions of a model of one's own for a record, with their standard deviations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from torsight.core.parameter import REACH
from torsight.core.units import Floats
from torsight.core.words.shown import Shown, span


@dataclass(frozen=True, eq=False, repr=False)
class PredictedOutputs(Shown, Mapping[str, Floats]):
    """Outputs of a model for every row of a record, by name: ``predicted["y"]``, ``predicted["y_sigma"]``.

    The columns are time, then each output and its standard deviation, (rows,). Warnings name laws that are called
    outside of the range in which they were measured.
    """

    columns: Mapping[str, Floats]
    outputs: tuple[str, ...]
    record: str
    warnings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def facts(self) -> dict[str, str]:
        """Return the range of each output and of its standard deviation."""
        made = {"record": f"{self.record}, {len(self[self.outputs[0]])} rows"}
        for name in self.outputs:
            made[name] = f"{span(self[name], '')} ± {span(self[f'{name}_sigma'], '')}"
        return made | {f"note {k}": text for k, text in enumerate(self.warnings, 1)}

    def _columns(self) -> Mapping[str, Any]:
        return self

    def _draw(self, axes: Any) -> None:
        time = next(iter(self))
        for name in self.outputs:
            (line,) = axes.plot(self[time], self[name], label=name, linewidth=1.0)
            low, high = (self[name] + side * REACH * self[f"{name}_sigma"] for side in (-1.0, 1.0))
            axes.fill_between(self[time], low, high, color=line.get_color(), alpha=0.2, linewidth=0.0)
        axes.set_xlabel(time)
        axes.legend()
