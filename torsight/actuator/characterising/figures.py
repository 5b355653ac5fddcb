"""Figures of a characterisation, and how the paper's figures are drawn to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from torsight.core.files.figure_file import write_figure
from torsight.core.units import Floats

if TYPE_CHECKING:
    from torsight.actuator.characterising.characterised import Characterisation, Step


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
