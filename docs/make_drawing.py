"""Draw the definition of the angle: both springs and the disk from the side, both sticks as the camera sees them.

Run: .venv/bin/python docs/make_drawing.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

HERE: Final = Path(__file__).parent
A_COLOUR: Final = "#d55e00"
B_COLOUR: Final = "#0072b2"
DARK: Final = "#333333"
SHOWN_DEG: Final = 62.0
BASE_DEG: Final = 200.0
"""Direction of the base stick in the picture: arbitrary."""


def main() -> None:
    """Write ``actuator.svg`` beside this script."""
    mpl.use("svg")
    # The same bytes every time, and letters that need no font where the page is read.
    mpl.rcParams.update({"svg.hashsalt": "torsight", "svg.fonttype": "path", "font.size": 10.0})
    import matplotlib.pyplot as plt

    figure, (side, front) = plt.subplots(1, 2, figsize=(9.4, 4.0), width_ratios=(1.15, 1.0), layout="constrained")
    draw_side(side)
    draw_front(front)
    for axes in (side, front):
        axes.set_aspect("equal")
        axes.set_axis_off()
    figure.savefig(HERE / "actuator.svg", metadata={"Date": None})
    plt.close(figure)
    print(HERE / "actuator.svg")


def draw_side(axes: Axes) -> None:
    """Draw the springs between their fixed ends with the disk between them."""
    axes.set_title("from the side", loc="left")
    for x in (-3.3, 3.1):
        axes.add_patch(Rectangle((x, -1.0), 0.2, 2.0, color="#999999"))
    axes.plot([-3.1, 3.1], [0.0, 0.0], color="#bbbbbb", lw=1.0, ls="-.")
    along = np.linspace(0.0, 1.0, 400)
    for start, stop, colour in ((-3.1, -0.12, A_COLOUR), (0.12, 3.1, B_COLOUR)):
        axes.plot(start + (stop - start) * along, 0.42 * np.sin(2.0 * np.pi * 6.0 * along), color=colour, lw=2.2)
    axes.add_patch(Rectangle((-0.12, -1.15), 0.24, 2.3, color=DARK))
    axes.text(-1.6, 0.62, r"spring A, wound by $\theta^A$", color=A_COLOUR, ha="center")
    axes.text(1.6, 0.62, r"spring B, wound by $\theta^B$", color=B_COLOUR, ha="center")
    axes.text(0.0, 1.25, "turning disk", ha="center", color=DARK)
    for x in (-3.2, 3.2):
        axes.text(x, -1.3, "fixed", ha="center", color="#777777")
    axes.text(0.0, -1.85, r"$\theta^A + \theta^B = \theta_P$,   $\varphi = \theta^A - \theta_P/2$", ha="center")
    axes.text(0.0, -2.35, r"$\varphi = 0$ where both springs are wound alike", ha="center", color=DARK)
    axes.set_xlim(-3.6, 3.6)
    axes.set_ylim(-2.6, 1.9)


def draw_front(axes: Axes) -> None:
    """Draw both sticks in the picture of the camera with the angle between them."""
    axes.set_title("as the camera's picture is displayed", loc="left")
    axes.add_patch(Circle((0.0, 0.0), 1.35, facecolor="#f2f2f2", edgecolor="#999999"))
    axes.plot(0.0, 0.0, marker="+", color=DARK, ms=9.0)
    _stick(axes, BASE_DEG, "#777777", "base stick", (-0.1, -0.32))
    _stick(axes, BASE_DEG + SHOWN_DEG, DARK, "moving stick", (0.95, 0.0))
    turn = np.radians(np.linspace(BASE_DEG, BASE_DEG + SHOWN_DEG - 6.0, 60))
    axes.plot(0.75 * np.cos(turn), 0.75 * np.sin(turn), color="black", lw=1.4)
    _arrow(axes, (0.75, BASE_DEG + SHOWN_DEG - 8.0), (0.75, BASE_DEG + SHOWN_DEG), "black")
    middle = np.radians(BASE_DEG + 0.5 * SHOWN_DEG)
    axes.text(0.98 * np.cos(middle), 0.98 * np.sin(middle), r"$\alpha$", ha="center", va="center", fontsize=13)
    _sense(axes, (20.0, 80.0), B_COLOUR, "B heated: the angle rises\n(counter-clockwise)", (1.45, 1.5))
    _sense(axes, (160.0, 100.0), A_COLOUR, "A heated: the angle falls\n(clockwise)", (-1.45, 1.5))
    axes.text(0.0, -2.2, r"angle read  $\alpha = \varphi\,+$ zero_deg", ha="center")
    axes.set_xlim(-2.9, 2.9)
    axes.set_ylim(-2.4, 2.2)


def _stick(axes: Axes, angle_deg: float, colour: str, name: str, off: tuple[float, float]) -> None:
    way = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    axes.plot(*np.outer(way, [0.2, 1.7]), color=colour, lw=7.0, solid_capstyle="round")
    for place in (0.45, 1.55):
        axes.add_patch(Circle(tuple(place * way), 0.085, facecolor="white", edgecolor=colour, zorder=3))
    axes.text(*(1.75 * way + off), name, color=colour, ha="center", va="center")


def _arrow(axes: Axes, start: tuple[float, float], stop: tuple[float, float], colour: str) -> None:
    ends = [(r * np.cos(np.radians(a)), r * np.sin(np.radians(a))) for r, a in (start, stop)]
    axes.add_patch(FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=14, color=colour, shrinkA=0, shrinkB=0))


def _sense(axes: Axes, arc_deg: tuple[float, float], colour: str, text: str, place: tuple[float, float]) -> None:
    """Draw the direction in which the moving stick turns while a spring is heated."""
    turn = np.radians(np.linspace(*arc_deg, 40))
    axes.plot(1.12 * np.cos(turn[:-3]), 1.12 * np.sin(turn[:-3]), color=colour, lw=2.0)
    _arrow(axes, (1.12, arc_deg[1] - 0.12 * (arc_deg[1] - arc_deg[0])), (1.12, arc_deg[1]), colour)
    axes.text(*place, text, color=colour, ha="center", va="bottom")


if __name__ == "__main__":
    main()
