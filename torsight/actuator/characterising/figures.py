"""The paper's figures, computed from the model or a characterisation and drawn to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from torsight.actuator.springs import Rig, strain_ratio, torsional_stiffness
from torsight.core.files.figure_file import write_figure
from torsight.core.units import DEG, MM, MNM, Floats, Ints

if TYPE_CHECKING:
    from torsight.actuator.characterising.characterised import Characterisation, Step


_SIZE_IN: Final = (6.4, 4.2)
_COMPRESSIONS_MM: Final = (0.25, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One curve of a figure; ``style`` is matplotlib's format."""

    x: Floats
    y: Floats
    label: str
    style: str = "-"


def draw(path: Path, lines: Sequence[Line], *, x_label: str, y_label: str, title: str) -> Path:
    """Draw curves to a picture file (PNG or SVG by its suffix) and return the path."""
    return draw_panels(path, [(title, lines)], x_label=x_label, y_label=y_label)


def draw_panels(
    path: Path,
    panels: Sequence[tuple[str, Sequence[Line]]],
    *,
    x_label: str,
    y_label: str,
    notes: Sequence[Mapping[str, tuple[float, float]]] = (),
) -> Path:
    """Draw curves to panels side by side; ``notes`` are labels by their coordinates, per panel."""
    from matplotlib.figure import Figure

    figure = Figure(
        figsize=(_SIZE_IN[0] * (1.0 + 0.75 * (len(panels) - 1)), _SIZE_IN[1]), dpi=120, layout="constrained"
    )
    for number, (title, lines) in enumerate(panels):
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


@dataclass(frozen=True, slots=True, eq=False)
class MotionCycle:
    """One cycle over θ^A: both torques (N·m), half-cycle of every row, friction, and the rows of the corners 1 to 4."""

    theta_rad: Floats
    torque_a_nm: Floats
    torque_b_nm: Floats
    half: Ints
    tau_c_nm: float
    corners: tuple[int, int, int, int]


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
            f"$L_\\delta$ = {size:g} mm",
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


def motion_figure(path: Path, cycles: Mapping[str, MotionCycle], rig: Rig) -> Path:
    """Draw figure 7: torque of spring A over its angle through a whole cycle, per case, within the friction's band.

    1 to 2 A is heated, 2 to 3 it cools; 3 to 4 B is heated and winds A, 4 to 1 B cools.
    """
    panels, notes = [], []
    angle = np.linspace(0.0, rig.theta_p_rad, 400)
    loading = np.array([rig.loading_torque(value) for value in angle])
    for label, cycle in cycles.items():
        theta, half = cycle.theta_rad / DEG, cycle.half
        band = cycle.torque_b_nm[half == 0] / MNM
        first = theta[half == 0]
        panels.append(
            (
                f"Figure 7, {label}",
                [
                    Line(angle / DEG, loading / MNM, "martensite being wound", "k:"),
                    Line(first, band, "τᴮ while A is driven (no friction)", "C7-"),
                    Line(first, band + cycle.tau_c_nm / MNM, "τᴮ ± τ_c", "C7--"),
                    Line(first, band - cycle.tau_c_nm / MNM, "", "C7--"),
                    Line(first, cycle.torque_a_nm[half == 0] / MNM, "τᴬ, A heated and cooled", "C0-"),
                    Line(theta[half == 1], cycle.torque_a_nm[half == 1] / MNM, "τᴬ, B heated and cooled", "C1-"),
                ],
            )
        )
        notes.append(
            {
                number: (float(theta[row]), float(cycle.torque_a_nm[row] / MNM))
                for number, row in zip("1234", cycle.corners, strict=True)
            }
        )
    return draw_panels(path, panels, x_label="θᴬ (°)", y_label="torque (mN·m)", notes=notes)


def step_figure(
    path: Path, step: Step, *, title: str, x_label: str, y_label: str, others: Mapping[str, Step] | None = None
) -> Path:
    """Draw the measured and fitted curves of a characterisation step (figures 9 to 12), one colour per log."""
    lines = []
    for number, (name, (x, measured, fitted)) in enumerate(step.curves.items()):
        order, colour = np.argsort(x), f"C{number}"
        if len(step.beyond.get(name, ((),))[0]):
            lines.append(Line(*step.beyond[name], "", f"{colour}."))
        lines.append(Line(x, measured, f"{name}, measured", f"{colour}."))
        lines.append(Line(x[order], fitted[order], f"{name}, model", f"{colour}-"))
        for law, other in (others or {}).items():
            other_x, _, other_fitted = other.curves[name]
            lines.append(Line(other_x[order], other_fitted[order], f"{name}, {law}", f"{colour}--"))
    return draw(path, lines, x_label=x_label, y_label=y_label, title=title)


def characterisation_figures(folder: Path, found: Characterisation) -> list[Path]:
    """Draw figures 9 to 12 of a characterisation and return their paths."""
    steps = found.steps
    force, angle, temp = "force (N)", "size of the torsion angle (°)", "temperature (°C)"
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
            folder / "figure_11_force_large.png", large, title="Figure 11: force, large range (line from its middle)",
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
    """Return a step restricted to the logs of one range."""
    return replace(
        step,
        curves={_short(name): item for name, item in step.curves.items() if name.startswith(kind)},
        beyond={_short(name): item for name, item in step.beyond.items() if name.startswith(kind)},
    )


def _short(name: str) -> str:
    return name.split(", ", 1)[1]
