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
from torsight.viewer.pictures import WHOLE, take_pictures

HERE = Path(__file__).parent
WIDTH_PX = 1280


def main(folder: Path) -> None:
    """Write ``demo.png`` beside this script."""
    view = take_pictures(folder / "recording.rrd", time_s=62.0, size_px=(WIDTH_PX, 800))[WHOLE]
    upper = cv2.imdecode(np.frombuffer(view, np.uint8), cv2.IMREAD_COLOR)
    assert upper is not None
    lower = residuals(folder)
    assert cv2.imwrite(str(HERE / "demo.png"), np.vstack([upper, lower]), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(HERE / "demo.png")


def residuals(folder: Path) -> np.ndarray:
    """Return the plot of both residuals against time as a picture, BGR."""
    mpl.use("agg")
    import matplotlib.pyplot as plt

    curves = read_table(folder / "curves.csv", required=("time_s", "residual_before_deg", "residual_after_deg"))
    found = read_json(folder / "discovery.json")
    before, after = (found[when]["rmse_held_out_deg"] for when in ("before", "after"))
    figure, axes = plt.subplots(figsize=(WIDTH_PX / 100, 3.2), dpi=100, layout="constrained")
    axes.plot(curves["time_s"], curves["residual_before_deg"], color="#d55e00", lw=1.4)
    axes.plot(curves["time_s"], curves["residual_after_deg"], color="#0072b2", lw=1.4)
    names = ", ".join(effect["id"].replace("_", " ") for effect in found["effects"])
    axes.set_title(
        f"measured − model: {before:.2f}° rms with the plain model, {after:.2f}° with {names}; "
        "half-cycles that the fit did not see",
        fontsize=11,
    )
    axes.set_xlabel("time (s)")
    axes.set_ylabel("residual (°)")
    axes.grid(alpha=0.3)
    axes.margins(x=0)
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())
    plt.close(figure)
    return cv2.cvtColor(picture, cv2.COLOR_RGBA2BGR)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))
