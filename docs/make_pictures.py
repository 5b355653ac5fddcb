"""Make the pages' pictures from a finished demo: the README's, the report with numbers on it, and the gallery's.

The report is rendered by Chromium or Chrome (``TORSIGHT_BROWSER`` names another program).

Run: make demo && .venv/bin/python docs/make_pictures.py demo
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Final

import cv2
import matplotlib as mpl
import numpy as np

from torsight.core.files.storage import read_json, read_table
from torsight.core.words.wording import effect_name, error_words
from torsight.viewer.screenshots import WHOLE, take_pictures

HERE = Path(__file__).parent
PICTURES = HERE / "pictures"
SIZE_PX = (1280, 720)
MENU_PX = 37
"""The viewer's own menu is no part of the picture."""
REPORT_PX: Final = (1000, 1300)
TRACK_PX: Final = 900
MARKS: Final = (
    *(".kicker", "h1", ".lead", ".hero figure", ".hero .plot", ".tiles li:nth-child(1)", ".tiles li:nth-child(2)"),
    *(".tiles li:nth-child(3)", ".facts", *(f"#next .step:nth-child({k})" for k in (1, 2, 3))),
)
"""CSS selectors of the parts of the report at which the numbers 1, 2, … stand; ``report.md`` explains each part."""
FIGURES: Final = ("candidates", "angle_temperature_a", "angle_sigma")
"""Plots of the report that the gallery shows."""
_NUMBERS: Final = """marks => marks.forEach((mark, k) => {
  const place = document.querySelector(mark).getBoundingClientRect(), number = document.createElement("span");
  number.textContent = k + 1;
  number.style.cssText = `position:absolute;z-index:99;left:${Math.max(2, place.left + scrollX - 26)}px;
    top:${place.top + scrollY}px;width:22px;height:22px;border-radius:11px;background:#d55e00;color:#fff;
    font:bold 14px/22px sans-serif;text-align:center`;
  document.body.append(number);
})"""


def main(folder: Path) -> None:
    """Write ``demo.png`` beside this script, and the other pages' pictures into ``pictures/``."""
    PICTURES.mkdir(exist_ok=True)
    whole(folder)
    track(folder)
    report(folder)


def track(folder: Path) -> None:
    """Write the picture of the track, as wide as a page."""
    picture = cv2.imread(str(folder / "track.png"))
    assert picture is not None
    scale = TRACK_PX / picture.shape[1]
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    assert cv2.imwrite(str(PICTURES / "track.png"), small, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(PICTURES / "track.png")


def report(folder: Path) -> None:
    """Write the report's first screens with their numbers, and some of its plots."""
    from playwright.sync_api import sync_playwright

    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    program = os.environ.get("TORSIGHT_BROWSER") or next(filter(None, map(shutil.which, names)))
    # Chromium refuses its sandbox to root.
    flags = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=flags)
        # Without scripts the plots are the pictures for paper: nothing moves while the screenshot is taken.
        page = browser.new_page(viewport={"width": REPORT_PX[0], "height": REPORT_PX[1]}, java_script_enabled=False)
        page.goto((folder / "report.html").resolve().as_uri())
        for name in FIGURES:
            page.locator(f"#{name}").screenshot(path=str(PICTURES / f"{name}.png"))
        page = browser.new_page(viewport={"width": REPORT_PX[0], "height": REPORT_PX[1]})
        page.goto((folder / "report.html").resolve().as_uri())
        page.wait_for_selector("html.drawn")
        page.evaluate(_NUMBERS, list(MARKS))
        page.screenshot(path=str(PICTURES / "report.png"))
        browser.close()
    print(*(PICTURES / f"{name}.png" for name in ("report", *FIGURES)), sep="\n")


def whole(folder: Path) -> None:
    """Write the README's picture: the Rerun view, and below it the error before and after."""
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
            label=f"{when}: {model}, {error_words(error)} rms on held-out half-cycles",
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
