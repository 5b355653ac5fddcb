"""Make the README's picture from a finished demo: the Rerun view, and below it the error before and after.

Run: make demo && .venv/bin/python docs/make_pictures.py demo
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np

from torsight.core.storage import read_json, read_table
from torsight.core.wording import effect_name
from torsight.viewer.pictures import WHOLE, take_pictures

HERE = Path(__file__).parent
SIZE_PX = (1280, 720)
MENU_PX = 37
"""The viewer's own menu is no part of the picture."""


def main(folder: Path) -> None:
    """Write ``demo.png`` beside this script."""
    view = take_pictures(folder / "recording.rrd", time_s=62.0, size_px=SIZE_PX)[WHOLE]
    upper = cv2.imdecode(np.frombuffer(view, np.uint8), cv2.IMREAD_COLOR)
    assert upper is not None
    both = np.vstack([upper[MENU_PX:], residuals(folder)])
    assert cv2.imwrite(str(HERE / "demo.png"), both, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(HERE / "demo.png")


def residuals(folder: Path) -> np.ndarray:
    """Return the plot of both residuals against time as a picture, BGR."""
    mpl.use("agg")
    import matplotlib.pyplot as plt

    curves = read_table(folder / "curves.csv", required=("time_s", "residual_before_deg", "residual_after_deg"))
    found = read_json(folder / "discovery.json")
    names = " and ".join(effect_name(effect["id"]) for effect in found["effects"])
    figure, axes = plt.subplots(figsize=(SIZE_PX[0] / 100, 2.6), dpi=100, layout="constrained")
    for when, colour, model in (("before", "#d55e00", "plain model"), ("after", "#0072b2", f"with {names}")):
        error = found[when]["rmse_held_out_deg"]
        axes.plot(
            curves["time_s"],
            curves[f"residual_{when}_deg"],
            color=colour,
            lw=1.4,
            label=f"{when}: {model}, {error:.2f}° rms on half-cycles that the fit did not see",
        )
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("measured − model (°)")
    axes.grid(alpha=0.3)
    axes.margins(x=0)
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())
    plt.close(figure)
    return cv2.cvtColor(picture, cv2.COLOR_RGBA2BGR)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))
