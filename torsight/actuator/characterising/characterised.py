"""The result of a characterisation: steps of one spring, estimates, figures; and the drawing of figures to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from torsight.actuator.spec import ActuatorSpec
from torsight.core.files.figure_file import write_figure
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, estimates_to_json
from torsight.core.units import Floats
from torsight.core.words.shown import Shown
from torsight.core.words.wording import estimate as words


@dataclass(frozen=True, slots=True, eq=False)
class Step(Frozen):
    """One step: its estimates, its error, and the measured and fitted curves.

    ``curves`` are (x, measured, fitted) by name; ``beyond`` holds the rows of the logs outside the fitted range.
    """

    estimates: Mapping[str, Estimate]
    rmse: float
    r2: Mapping[str, float]
    curves: Mapping[str, tuple[Floats, Floats, Floats]]
    beyond: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return values and errors."""
        return {"parameters": estimates_to_json(self.estimates), "rmse": self.rmse, "r2": dict(self.r2)}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Characterisation(Frozen, Shown):
    """All steps of one spring, and the estimates from them.

    Attributes
    ----------
    steps : mapping of str to Step
        ``free_recovery`` and ``free_recovery_tanaka``, ``force_angle``, ``block_heating``, ``block_cooling``.
    better_law : str
        The phase law with the smaller error in the free recovery.
    estimates : mapping of str to Estimate
        Characterised values by the names of ``actuator.toml``.
    spec : ActuatorSpec
        The content of ``actuator.toml``.
    """

    steps: Mapping[str, Step]
    better_law: str
    estimates: Mapping[str, Estimate]
    spec: ActuatorSpec

    def facts(self) -> dict[str, str]:
        """Return the better phase law and the values with their intervals."""
        values = {name: words(estimate.to_json()) for name, estimate in self.estimates.items()}
        return {"better phase law": self.better_law, **values}

    def __repr__(self) -> str:
        return f"Characterisation({', '.join(self.estimates)}; better phase law {self.better_law})"

    def _columns(self) -> dict[str, Any]:
        estimates = list(self.estimates.values())
        return {
            "name": list(self.estimates),
            "value": [one.value for one in estimates],
            "sigma": [one.sigma for one in estimates],
            "low": [one.ci95[0] for one in estimates],
            "high": [one.ci95[1] for one in estimates],
            "unit": [one.unit for one in estimates],
        }

    def _draw(self, axes: Any) -> None:
        """Draw the free recovery, measured and fitted with the better law."""
        step = "free_recovery" if self.better_law == "liang_rogers" else f"free_recovery_{self.better_law}"
        for name, (x, measured, fitted) in self.steps[step].curves.items():
            axes.plot(x, measured, ".", markersize=2, label=f"{name}, measured")
            axes.plot(x, fitted, label=f"{name}, fitted")
        axes.set(xlabel="temperature, °C", ylabel="recovered angle, °")
        axes.legend()

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``characterisation.json``."""
        plain, other = self.steps["free_recovery"].rmse, self.steps["free_recovery_tanaka"].rmse
        return {
            "parameters": estimates_to_json(self.estimates),
            "phase_law": {"better": self.better_law, "rmse_deg": {"liang_rogers": plain, "tanaka": other}},
            "steps": {name: step.to_json() for name, step in self.steps.items()},
        }


_SIZE_IN: Final = (6.4, 4.2)


class Line(NamedTuple):
    """One curve of a figure; ``style`` is matplotlib's format."""

    x: Floats
    y: Floats
    label: str = ""
    style: str = "-"


def draw(
    path: Path,
    panels: Mapping[str, Sequence[Line]],
    *,
    x_label: str,
    y_label: str,
    notes: Sequence[Mapping[str, tuple[float, float]]] = (),
) -> Path:
    """Draw panels of curves, by their titles, side by side to a picture file (PNG or SVG by its suffix).

    ``notes`` are labels by their coordinates, for each panel. Returns the path.
    """
    from matplotlib.figure import Figure

    figure = Figure(
        figsize=(_SIZE_IN[0] * (1.0 + 0.75 * (len(panels) - 1)), _SIZE_IN[1]), dpi=120, layout="constrained"
    )
    for number, (title, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(1, len(panels), number + 1)
        for line in lines:
            faint = line.style.endswith((".", "o"))
            axes.plot(line.x, line.y, line.style, label=line.label, markersize=2.0, alpha=0.4 if faint else 1.0)
        for word, place in notes[number].items() if notes else ():
            axes.plot(*place, "ko", markersize=3.0)
            axes.annotate(word, place, textcoords="offset points", xytext=(5, 5))
        if any(line.label for line in lines):
            axes.legend(frameon=False, fontsize="small", markerscale=3.0, loc="upper left" if notes else "best")
        axes.set(xlabel=x_label, ylabel=y_label, title=title)
        if all(np.all(line.y >= 0.0) for line in lines):
            axes.set_ylim(bottom=0.0)
        axes.grid(visible=True, alpha=0.3)
    write_figure(path, figure)
    return path


def characterisation_figures(folder: Path, found: Characterisation) -> list[Path]:
    """Draw figures 9 to 12 of a characterisation and return their paths."""
    steps = found.steps
    force, angle, temp = "force (N)", "size of the torsion angle (°)", "temperature (°C)"
    recovery = [*_lines(steps["free_recovery"]), *_lines(steps["free_recovery_tanaka"], model="Tanaka")]
    drawn = {
        "09_free_recovery": ("free recovery", temp, angle, sorted(recovery, key=lambda line: line.style[:2])),
        "10_force_small": ("force, small range", angle, force, _lines(steps["force_angle"], "small, ")),
        "11_force_large": (
            "force, large range (line from its middle)", angle, force, _lines(steps["force_angle"], "large, ")
        ),
        "12a_block_heating": ("block test, heating", temp, force, _lines(steps["block_heating"])),
        "12b_block_cooling": ("block test, cooling", temp, force, _lines(steps["block_cooling"])),
    }  # fmt: skip
    return [
        draw(
            folder / f"figure_{name}.png",
            {f"Figure {name.split('_')[0].lstrip('0')}: {title}": lines},
            x_label=x_label,
            y_label=y_label,
        )
        for name, (title, x_label, y_label, lines) in drawn.items()
    ]


def _lines(step: Step, kind: str = "", *, model: str = "") -> list[Line]:
    """Return the curves of a step's logs of a kind, one colour per log: measured and fitted, or another model's."""
    lines = []
    chosen = {name.removeprefix(kind): name for name in step.curves if name.startswith(kind)}
    for number, (label, name) in enumerate(chosen.items()):
        x, measured, fitted = step.curves[name]
        order, colour = np.argsort(x), f"C{number}"
        if model:
            lines.append(Line(x[order], fitted[order], f"{label}, {model}", f"{colour}--"))
            continue
        if len(step.beyond.get(name, ((),))[0]):
            lines.append(Line(*step.beyond[name], style=f"{colour}."))
        lines.append(Line(x, measured, f"{label}, measured", f"{colour}."))
        lines.append(Line(x[order], fitted[order], f"{label}, model", f"{colour}-"))
    return lines
