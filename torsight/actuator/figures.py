"""Figures of the paper that the model or a characterisation makes, drawn to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.springs import Rig, strain_ratio, torsional_stiffness
from torsight.core.storage import atomic_path
from torsight.core.units import DEG, MM, MNM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from torsight.actuator.characterisation import Characterisation, Step

Array = NDArray[np.float64]

_SIZE_IN: Final = (6.4, 4.2)
_COMPRESSIONS_MM: Final = (0.25, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One curve of a figure; ``style`` is matplotlib's format."""

    x: Array
    y: Array
    label: str
    style: str = "-"


def draw(path: Path, lines: Sequence[Line], *, x_label: str, y_label: str, title: str, log_y: bool = False) -> Path:
    """Draw curves to a picture file (PNG or SVG by its suffix) and return the path."""

    def fill(axes: Axes) -> None:
        for line in lines:
            faint = line.style.endswith((".", "o"))
            axes.plot(line.x, line.y, line.style, label=line.label, markersize=2.0, alpha=0.5 if faint else 1.0)
        if log_y:
            axes.set_yscale("log")
        if any(line.label for line in lines):
            axes.legend(frameon=False, fontsize="small")

    return _save(path, fill, x_label=x_label, y_label=y_label, title=title)


def _save(path: Path, fill: Any, *, x_label: str, y_label: str, title: str) -> Path:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    fill(axes)
    axes.set(xlabel=x_label, ylabel=y_label, title=title)
    axes.grid(visible=True, alpha=0.3)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, metadata={"Software": None} if path.suffix == ".png" else {"Date": None})
    return path


def strain_figure(path: Path, rig: Rig, *, active_coils: float) -> Path:
    """Draw figure 4: shear strain over normal strain for several pre-compressions."""
    angle = np.linspace(20.0, 800.0, 400)
    lines = [
        Line(
            angle,
            strain_ratio(
                angle * DEG,
                wire_diameter_m=rig.wire_diameter_m,
                wire_length_m=rig.wire_length_m,
                active_coils=active_coils,
                compression_m=size * MM,
            ),
            f"L_δ = {size:g} mm",
        )
        for size in _COMPRESSIONS_MM
    ]
    return draw(path, lines, x_label="torsion angle θ (°)", y_label="γ / ε", title="Figure 4: shear over normal strain")


def stiffness_figure(path: Path, rig: Rig) -> Path:
    """Draw figure 5: torsional stiffness against angle for several fractions."""
    angle = np.linspace(0.0, 540.0, 541)
    lines = [
        Line(angle, torsional_stiffness(rig, angle * DEG, xi=xi) / MNM * DEG, f"ξ = {xi:g}")
        for xi in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    return draw(
        path, lines, x_label="torsion angle θ (°)", y_label="stiffness (mN·m/°)", title="Figure 5: torsional stiffness"
    )


def torque_figure(path: Path, cycles: Mapping[str, tuple[Array, Array, Array]], rig: Rig) -> Path:
    """Draw figure 7: torque of spring A over its angle for cases (a) and (b), with the friction's band.

    ``cycles``: label → (θ^A in rad, torque of A, torque of B in N·m).
    """
    lines = []
    for label, (theta, own, other) in cycles.items():
        lines.append(Line(theta / DEG, own / MNM, f"{label}: τ^A", "-"))
        lines.append(Line(theta / DEG, other / MNM, f"{label}: τ^B", "--"))
    angle = np.linspace(0.0, rig.theta_p_rad, 400)
    loading = np.array([rig.loading_torque(value) for value in angle])
    lines.append(Line(angle / DEG, loading / MNM, "martensite's loading curve", ":"))
    return draw(path, lines, x_label="θ^A (°)", y_label="torque (mN·m)", title="Figure 7: motion process")


def step_figure(
    path: Path, step: Step, *, title: str, x_label: str, y_label: str, others: Mapping[str, Step] | None = None
) -> Path:
    """Draw a characterisation step: measured and fitted curves (figures 9 to 12)."""
    lines = []
    for name, (x, measured, fitted) in step.curves.items():
        order = np.argsort(x)
        lines.append(Line(x, measured, f"{name}, measured", "."))
        lines.append(Line(x[order], fitted[order], f"{name}, model", "-"))
    for law, other in (others or {}).items():
        for name, (x, _, fitted) in other.curves.items():
            order = np.argsort(x)
            lines.append(Line(x[order], fitted[order], f"{name}, {law}", "--"))
    return draw(path, lines, x_label=x_label, y_label=y_label, title=title)


def characterisation_figures(folder: Path, found: Characterisation) -> list[Path]:
    """Draw figures 9 to 12 of a characterisation and return their paths."""
    steps = found.steps
    force, angle, temp = "force (N)", "torsion angle (°)", "temperature (°C)"
    small, large = (_only(steps["force_angle"], name) for name in ("small", "large"))
    return [
        step_figure(
            folder / "figure_09_free_recovery.png", steps["free_recovery"], title="Figure 9: free recovery",
            x_label=temp, y_label=angle, others={"Tanaka": steps["free_recovery_tanaka"]},
        ),
        step_figure(
            folder / "figure_10_force_small.png", small, title="Figure 10: force, small range",
            x_label=angle, y_label=force,
        ),
        step_figure(
            folder / "figure_11_force_large.png", large, title="Figure 11: force, large range",
            x_label=angle, y_label=force,
        ),
        step_figure(
            folder / "figure_12a_block_heating.png", steps["block_heating"], title="Figure 12a: block test, heating",
            x_label=temp, y_label=force,
        ),
        step_figure(
            folder / "figure_12b_block_cooling.png", steps["block_cooling"], title="Figure 12b: block test, cooling",
            x_label=temp, y_label=force,
        ),
    ]  # fmt: skip


def _only(step: Step, kind: str) -> Step:
    return replace(step, curves={name: curve for name, curve in step.curves.items() if name.startswith(kind)})
