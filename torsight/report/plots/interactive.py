"""Plots for the screen, drawn with Bokeh: zoom, values under the pointer, one time axis for all of them.

All plots are one document, so that plots can share the axis of one quantity. The page contains the document as JSON,
and BokehJS to draw it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from bokeh.core.properties import value
from bokeh.document import Document
from bokeh.layouts import gridplot
from bokeh.models import (
    BoxZoomTool,
    ColumnDataSource,
    CrosshairTool,
    FixedTicker,
    HoverTool,
    PanTool,
    Range1d,
    ResetTool,
    WheelZoomTool,
    ZoomInTool,
    ZoomOutTool,
    glyphs,
)
from bokeh.plotting import figure as Plot  # noqa: N812 - the class, by another name than our figures
from bokeh.resources import Resources

from torsight.core.words.colours import LIGHT
from torsight.report.plots.panels import Band, Box, Line, Mark, Note, Panel, Points, Ribbon, Rule, style_of, thin_points

_FOCUS: Final = f":focus-visible {{ outline: 3px solid {LIGHT['held']}; }}"
_FONT: Final = 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif'
"""Outline and fonts of the page's style sheet, because a plot has a separate style sheet."""


def library() -> str:
    """Return BokehJS: plots without widgets, tables and formulas."""
    (text,) = Resources(mode="inline", components=["bokeh"]).js_raw[:1]
    # "</script" within a string would end the page's script element.
    return text.replace("</script", "<\\/script")


def drawing(figures: Mapping[str, Sequence[Panel]]) -> str:
    """Return figures, panels by name, as one Bokeh document; time axes of one clock are shared.

    The text is the page's JSON: the ``document``, and each figure's identifier in it by its name (``roots``). ``<`` is
    escaped so that no text can end the element around it. The same panels give the same text.
    """
    document = Document()
    shared: dict[str, Range1d] = {}
    roots = {}
    # Otherwise Bokeh collects the models of all plots again with each plot that is added.
    with document.models.freeze():
        for name, panels in figures.items():
            root = _figure(panels, shared)
            document.add_root(root)
            roots[name] = root.id
    text = json.dumps({"document": document.to_json(deferred=False), "roots": roots}, allow_nan=False)
    # Bokeh counts its models over the whole process.
    names: dict[str, str] = {}

    def again(found: re.Match[str]) -> str:
        return names.setdefault(found.group(), f'"p{len(names) + 1}"')

    return re.sub(r'"p\d+"', again, text).replace("<", "\\u003c")


def _figure(panels: Sequence[Panel], shared: dict[str, Range1d]) -> Any:
    plots = [_plot(panel, shared) for panel in panels]
    if len(plots) == 1:
        return plots[0]
    rows: list[list[Any]] = [[plot] for plot in plots]
    grid = gridplot(rows, merge_tools=True, toolbar_location="above", sizing_mode="stretch_width")
    grid.toolbar.logo = None
    grid.toolbar.stylesheets = [_FOCUS]
    return grid


def _plot(panel: Panel, shared: dict[str, Range1d]) -> Plot:
    across = Range1d(start=panel.x.low, end=panel.x.high)
    if panel.x.clock:
        across = shared.setdefault(panel.x.clock, across)
        across.start, across.end = min(across.start, panel.x.low), max(across.end, panel.x.high)
    box = BoxZoomTool(match_aspect=panel.square)
    plot = Plot(
        x_range=across,
        y_range=Range1d(start=panel.y.low, end=panel.y.high),
        height=round(panel.height),
        match_aspect=panel.square,
        tools=[PanTool(), box, WheelZoomTool(), ZoomInTool(), ZoomOutTool(), ResetTool()],
        active_drag=box,
        active_scroll=None,
        toolbar_location="above",
        aspect_ratio=1.0 if panel.square else None,
        sizing_mode="scale_width" if panel.square else "stretch_width",
    )
    plot.toolbar.logo = None
    plot.toolbar.stylesheets = [_FOCUS]
    _dress(plot, panel)
    if panel.x.clock:
        plot.add_tools(CrosshairTool(dimensions="height", line_color=LIGHT["muted"], line_alpha=0.6, visible=False))
    hover: dict[str, list[Any]] = {}
    for alike in _alike(panel.marks):
        for words, renderer in _draw(plot, panel, alike):
            hover.setdefault(words, []).append(renderer)
    for words, renderers in hover.items():
        mode: Any = "vline" if panel.x.clock and words == _CURVE else "mouse"
        plot.add_tools(HoverTool(renderers=renderers, tooltips=words, mode=mode, visible=False))
    return plot


def _dress(plot: Plot, panel: Panel) -> None:
    """Set labels, fonts and colours."""
    plot.background_fill_color = plot.border_fill_color = None
    plot.outline_line_color = None
    plot.min_border_left, plot.min_border_right = 64, 12
    for axis, grid, label, names in (
        (plot.xaxis[0], plot.xgrid[0], panel.x.label, panel.x_names),
        (plot.yaxis[0], plot.ygrid[0], panel.y.label, panel.y_names),
    ):
        axis.axis_label = label or None
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "12px"
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_color = axis.major_label_text_color = LIGHT["muted"]
        axis.axis_line_color = axis.major_tick_line_color = LIGHT["rule"]
        axis.minor_tick_line_color = None
        grid.grid_line_color = LIGHT["rule"]
        if names is not None:
            axis.ticker = FixedTicker(ticks=[value for value, _ in names])
            axis.major_label_overrides = dict(names)
            grid.grid_line_color = None


_CURVE: Final = "<b>$name</b> @y{0.[000]} at @x{0.[00]}"
_TIP: Final = "@tip"
_Drawn = list[tuple[str, Any]]
"""Text under the pointer, and the renderers that show it."""


def _alike(marks: Sequence[Mark]) -> list[list[Mark]]:
    """Return groups of marks that one renderer can draw, ordered by their first marks; a renderer is a kilobyte."""
    found: dict[tuple[Any, ...], list[Mark]] = {}
    for number, mark in enumerate(marks):
        # A curve with its own name needs its own renderer, which shows the name.
        alone = number if isinstance(mark, Ribbon) or (isinstance(mark, Line) and mark.label) else -1
        upright = mark.upright if isinstance(mark, (Band, Rule)) else True
        kind = "" if isinstance(mark, Note) else mark.kind
        found.setdefault((type(mark), kind, upright, alone), []).append(mark)
    return list(found.values())


def _source(**columns: Any) -> Any:
    return ColumnDataSource({name: _column(values) for name, values in columns.items()})


def _column(values: Any) -> Any:
    """Return a column in single precision: a page of half the size, and 0.1 ms in an hour."""
    if isinstance(values, np.ndarray) or (values and isinstance(values[0], float)):
        return np.asarray(values, np.float32)
    return values


def _stroke(kind: str) -> dict[str, Any]:
    style = style_of(kind)
    return {"line_color": style.colour, "line_width": style.width, "line_dash": list(style.dash)}


def _draw(plot: Plot, panel: Panel, alike: Sequence[Any]) -> _Drawn:
    """Draw marks that one renderer can draw together."""
    mark = alike[0]
    match mark:
        case Line():
            return _draw_lines(plot, panel, alike)
        case Points():
            return _draw_points(plot, panel, alike)
        case Box():
            return _draw_boxes(plot, alike)
        case Rule():
            return _draw_rules(plot, alike)
        case Ribbon():
            style, known = style_of(mark.kind), np.isfinite(mark.low) & np.isfinite(mark.high)
            area = glyphs.VArea(x="x", y1="low", y2="high", fill_color=style.colour, fill_alpha=style.opacity)
            plot.add_glyph(_source(x=mark.x[known], low=mark.low[known], high=mark.high[known]), area)
        case Band():
            style = style_of(mark.kind)
            look: dict[str, Any] = {"fill_color": style.colour, "fill_alpha": style.opacity, "line_color": None}
            upright = mark.upright
            strip = (
                glyphs.VStrip(x0="low", x1="high", **look) if upright else glyphs.HStrip(y0="low", y1="high", **look)
            )
            ends = _source(low=[one.low for one in alike], high=[one.high for one in alike])
            plot.add_glyph(ends, strip, level="underlay")
        case Note():
            said = _source(x=[one.x for one in alike], y=[one.y for one in alike], words=[one.words for one in alike])
            font: dict[str, Any] = {"text_font": value(_FONT), "text_font_size": "12px", "text_color": LIGHT["muted"]}
            plot.add_glyph(said, glyphs.Text(x="x", y="y", text="words", x_offset=5, text_baseline="middle", **font))
    return []


def _draw_lines(plot: Plot, panel: Panel, alike: Sequence[Line]) -> _Drawn:
    mark = alike[0]
    look = {**_stroke(mark.kind), "line_alpha": style_of(mark.kind).opacity, "line_cap": "round", "line_join": "round"}
    lines = [line.thinned(panel) for line in alike if len(line.x)]
    if not lines:
        return []
    if not mark.label:
        # NaN separates the curves.
        x, y = (np.concatenate([np.append(line[k], np.nan) for line in lines]) for k in (0, 1))
        plot.add_glyph(_source(x=x, y=y), glyphs.Line(x="x", y="y", **look))
        return []
    x, y = lines[0]
    return [(_CURVE, plot.add_glyph(_source(x=x, y=y), glyphs.Line(x="x", y="y", **look), name=mark.label))]


def _draw_points(plot: Plot, panel: Panel, alike: Sequence[Points]) -> _Drawn:
    mark = alike[0]
    style = style_of(mark.kind)
    pixel = (abs(panel.x.high - panel.x.low) / panel.width, abs(panel.y.high - panel.y.low) / panel.height)
    x, y = (np.concatenate([getattr(one, name) for one in alike]) for name in "xy")
    x, y = thin_points(x, y, spot=pixel)
    dots = glyphs.Scatter(
        x="x", y="y", size=2.0 * mark.radius, fill_color=style.colour, fill_alpha=style.opacity, line_color=None
    )
    drawn = plot.add_glyph(_source(x=x, y=y), dots, name=mark.label or None)
    return [(_CURVE, drawn)] if mark.label else []


def _draw_boxes(plot: Plot, alike: Sequence[Box]) -> _Drawn:
    source = _source(
        left=[min(one.x) for one in alike],
        right=[max(one.x) for one in alike],
        bottom=[min(one.y) for one in alike],
        top=[max(one.y) for one in alike],
        tip=[one.tip for one in alike],
    )
    colour = style_of(alike[0].kind).colour
    quad = glyphs.Quad(left="left", right="right", bottom="bottom", top="top", fill_color=colour, line_color=None)
    return [(_TIP, plot.add_glyph(source, quad))]


def _draw_rules(plot: Plot, alike: Sequence[Rule]) -> _Drawn:
    mark = alike[0]
    source = _source(at=[one.value for one in alike], tip=[one.tip for one in alike])
    look = _stroke(mark.kind)
    span = glyphs.VSpan(x="at", **look) if mark.upright else glyphs.HSpan(y="at", **look)
    drawn = plot.add_glyph(source, span)
    return [(_TIP, drawn)] if any(one.tip for one in alike) else []
