"""Plots as SVG pictures, drawn with matplotlib: for paper, for a browser without scripts, and for other programs.

They are drawn on a separate canvas: matplotlib's configured backend does not matter and need not be installed.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any, Final
from urllib.parse import quote

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.textpath import TextPath

from torsight.core.words.colours import LIGHT
from torsight.report.plots.panels import Band, Box, Line, Mark, Note, Panel, Points, Ribbon, Rule, style_of, thin_points

_PX_PER_INCH: Final = 96.0
"""Pixels of a style sheet per inch, by the standard of CSS."""
_POINTS_PER_PX: Final = 72.0 / _PX_PER_INCH
_SAFE: Final = " !$'()*+,-./:;<=>?@[]^_`{|}~"
"""Characters that need no escape in an attribute in double quotes."""
_SETTINGS: Final[dict[Any, Any]] = {
    "svg.fonttype": "none",
    # Otherwise matplotlib's identifiers are random, and the same results would not give the same bytes.
    "svg.hashsalt": "torsight",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 12.0 * _POINTS_PER_PX,
    "axes.unicode_minus": True,
    "axes.edgecolor": LIGHT["rule"],
    "axes.labelcolor": LIGHT["muted"],
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": LIGHT["rule"],
    "grid.linewidth": _POINTS_PER_PX,
    "xtick.color": LIGHT["rule"],
    "ytick.color": LIGHT["rule"],
    "xtick.labelcolor": LIGHT["muted"],
    "ytick.labelcolor": LIGHT["muted"],
    "text.color": LIGHT["ink"],
    "legend.frameon": False,
    "path.simplify": True,
}


def still(panels: Sequence[Panel]) -> str:
    """Return panels one above the other as the text of a self-contained SVG."""
    with mpl.rc_context(_SETTINGS):
        buffer = io.StringIO()
        _picture(panels).savefig(buffer, format="svg", transparent=True)
    return bare(buffer.getvalue())


def bare(svg: str) -> str:
    """Return matplotlib's SVG without date and creator, so that the same results give the same bytes."""
    return re.sub(r"<metadata>.*?</metadata>\s*", "", svg[svg.index("<svg") :], flags=re.DOTALL).strip()


def png(panels: Sequence[Panel]) -> bytes:
    """Return panels one above the other as a PNG on white, at twice the resolution of a plain screen."""
    with mpl.rc_context(_SETTINGS):
        buffer = io.BytesIO()
        _picture(panels).savefig(buffer, format="png", dpi=2.0 * _PX_PER_INCH, facecolor="white")
    return buffer.getvalue()


def _picture(panels: Sequence[Panel]) -> Picture:
    width, height = panels[0].width, sum(panel.height for panel in panels)
    picture = Picture(figsize=(width / _PX_PER_INCH, height / _PX_PER_INCH))
    top = height
    for panel in panels:
        _draw(picture, panel, top, width, height)
        top -= panel.height
    return picture


def picture_data(svg: str) -> Markup:
    """Return a picture as a data URL for an attribute of a page, a quarter shorter than in base64."""
    words = " ".join(svg.replace("'", "&apos;").replace('"', "'").split())
    return Markup("data:image/svg+xml," + quote(words, safe=_SAFE))  # noqa: S704 - quote leaves no '"' and no '&'


def _draw(picture: Picture, panel: Panel, top: float, width: float, height: float) -> None:
    """Draw one panel whose upper edge is ``top`` pixels above the lower edge of the picture."""
    # Pixels: at the left numbers and the axis' label, above a row for each line of the legend, below numbers and label.
    left = max(64.0, 20.0 + max((_width_px(name) for _, name in panel.y_names or []), default=0.0))
    rows = _legend_rows(panel, width - left)
    above, below = 10.0 + 20.0 * len(rows), 46.0 if panel.x.label else 26.0
    place = (
        left / width,
        (top - panel.height + below) / height,
        (width - left - 16.0) / width,
        (panel.height - above - below) / height,
    )
    axes = picture.add_axes(place)
    axes.set_xlim(panel.x.low, panel.x.high)
    axes.set_ylim(panel.y.low, panel.y.high)
    axes.set_xlabel(panel.x.label)
    axes.set_ylabel(panel.y.label)
    for names, axis in ((panel.x_names, axes.xaxis), (panel.y_names, axes.yaxis)):
        if names is not None:
            axis.set_ticks([value for value, _ in names], [_plain(name) for _, name in names])
            axis.grid(visible=False)
    if panel.square:
        axes.set_aspect("equal", adjustable="box")
    for mark in panel.marks:
        _draw_mark(axes, panel, mark)
    for row, entries in enumerate(rows):
        handles = [_handle(mark) for mark, _ in entries]
        legend = axes.legend(
            handles,
            [_plain(label) for _, label in entries],
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0 + 20.0 * (len(rows) - 1 - row) / (panel.height - above - below)),
            borderaxespad=0.2,
            ncols=len(entries),
            columnspacing=1.4,
            handlelength=1.6,
        )
        axes.add_artist(legend)


def _plain(words: str) -> str:
    """Return words escaped so that matplotlib reads no formula in them."""
    return words.replace("$", r"\$")


def _width_px(words: str) -> float:
    """Return the width of words in the plots' font of 12 px, a wide one among those that browsers take instead."""
    return float(TextPath((0.0, 0.0), _plain(words), size=12.0).get_extents().width)


def _legend_rows(panel: Panel, width: float) -> list[list[tuple[Any, str]]]:
    """Return the legend's entries in as many rows as the width requires."""
    rows: list[list[tuple[Any, str]]] = []
    room = 0.0
    for mark, label in panel.legend():
        needed = 46.0 + _width_px(label)
        if not rows or needed > room:
            rows, room = [*rows, []], width
        rows[-1].append((mark, label))
        room -= needed
    return rows


def _draw_mark(axes: Axes, panel: Panel, mark: Mark) -> None:
    if isinstance(mark, Note):
        words, place = _plain(mark.words), (mark.x, mark.y)
        look: dict[str, Any] = {"va": "center", "color": LIGHT["muted"]}
        axes.annotate(words, place, xytext=(4.0, 0.0), textcoords="offset points", **look)
        return
    style = style_of(mark.kind)
    filled: dict[str, Any] = {"color": style.colour, "alpha": style.opacity, "linewidth": 0.0}
    match mark:
        case Line():
            axes.add_line(_line(mark, *mark.thinned(panel)))
        case Points():
            _draw_points(axes, panel, mark)
        case Ribbon():
            axes.fill_between(mark.x, mark.low, mark.high, **filled)
        case Band():
            span = axes.axvspan if mark.upright else axes.axhspan
            span(mark.low, mark.high, **filled)
        case Box():
            (left, right), (low, high) = sorted(mark.x), sorted(mark.y)
            axes.bar(left, high - low, right - left, low, align="edge", color=style.colour, linewidth=0.0)
        case Rule():
            rule = axes.axvline if mark.upright else axes.axhline
            rule(mark.value, color=style.colour, linewidth=style.width * _POINTS_PER_PX, linestyle=_dashes(style.dash))


def _draw_points(axes: Axes, panel: Panel, mark: Points) -> None:
    style = style_of(mark.kind)
    spot = ((panel.x.high - panel.x.low) / panel.width * 2.0, abs(panel.y.high - panel.y.low) / panel.height * 2.0)
    x, y = thin_points(mark.x, mark.y, spot=spot)
    axes.plot(
        x,
        y,
        linestyle="none",
        marker="o",
        markersize=2.0 * mark.radius * _POINTS_PER_PX,
        markeredgewidth=0.0,
        color=style.colour,
        alpha=style.opacity,
        # Thousands of points are one picture within the picture.
        rasterized=len(x) > 300,
    )


def _line(mark: Line, x: Any, y: Any) -> Any:
    style = style_of(mark.kind)
    return Line2D(
        x,
        y,
        color=style.colour,
        linewidth=style.width * _POINTS_PER_PX,
        linestyle=_dashes(style.dash),
        alpha=style.opacity,
        solid_capstyle="round",
    )


def _dashes(dash: tuple[int, ...]) -> Any:
    return (0, tuple(_POINTS_PER_PX * one for one in dash)) if dash else "solid"


def _handle(mark: Any) -> Any:
    """Return the symbol before a label of the legend."""
    style = style_of(mark.kind)
    if isinstance(mark, (Band, Box, Ribbon)):
        return Patch(facecolor=style.colour, alpha=style.opacity, linewidth=0.0)
    if isinstance(mark, Points):
        return Line2D([], [], linestyle="none", marker="o", markersize=5.0, color=style.colour)
    if isinstance(mark, Rule):
        return _line(Line(np.empty(0), np.empty(0), mark.kind), [], [])
    return _line(mark, [], [])
