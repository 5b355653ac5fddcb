"""Layout of a run in Rerun: panes, colours, names; the same for a recorded run and for the live view."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from torsight.core.words.colours import DARK, Colour, rgb

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

APPLICATION: Final = "torsight"
TIME: Final = "film_time"
FRAME: Final = "frame"
WINDOW_PX: Final = (1280, 800)
"""Default width and height of all panes together, pixels."""


class Series(NamedTuple):
    """A curve: its entity, the name in the legend, colour (safe for the colour-blind, on dark), width."""

    entity: str
    name: str
    colour: Colour
    width: float


_SHADE: Final = {name: rgb(colour) for name, colour in DARK.items()}

SERIES: Final = (
    # Curves are drawn in the order of their names: the extended model lies under the measured angle.
    Series("angle/extended", "extended model", _SHADE["after"], 4.5),
    Series("angle/measured", "measured", _SHADE["ink"], 1.25),
    Series("angle/plain", "plain model", _SHADE["before"], 1.5),
    Series("residual/below", "−2σ of the angle", _SHADE["muted"], 1.0),
    Series("residual/above", "+2σ of the angle", _SHADE["muted"], 1.0),
    Series("residual/before", "before: plain model", _SHADE["before"], 1.5),
    Series("residual/after", "after: extended model", _SHADE["after"], 1.5),
    Series("temperature/a", "spring A", _SHADE["spring-a"], 1.5),
    Series("temperature/b", "spring B", _SHADE["spring-b"], 1.5),
)
"""Every curve of the view."""

BAND: Final = {2.0: "residual/above", -2.0: "residual/below"}
"""Limits within which 95 % of a residual lie that consists only of the measured angle's error: sigmas, entity."""

HALF_CYCLE: Final = "angle/half_cycle"
"""Points at the starts of half-cycles."""

LAW_COLOURS: Final = {"reached": _SHADE["after"], "not_reached": (110, 118, 130)}
"""Bars of a law, by whether the record covers that value of the driver."""

HALF_CYCLE_COLOUR: Final = _SHADE["held"]


def blueprint(span_s: tuple[float, float] | None = None, *, laws: Sequence[str] = ()) -> rrb.Blueprint:
    """Return the arrangement of the panes, with one for each law by its name below the curves.

    ``span_s`` is the first and last time of a finished record; without ``span_s`` the curves follow the cursor. Both
    leave room on the right for the legends.
    """
    import rerun.blueprint as rrb

    def curves(name: str, origin: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            origin=origin,
            name=name,
            axis_x=rrb.TimeAxis(view_range=_view_range(span_s)),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=True),
        )

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial2DView(origin="film", name="Film"),
                rrb.TextDocumentView(origin="summary", name="Summary"),
                rrb.TextLogView(origin="events", name="Events", columns=_event_columns()),
                row_shares=[5.0, 3.6, 2.8],
            ),
            rrb.Vertical(
                curves("Angle (°)", "angle"),
                curves("Residual: measured − model (°)", "residual"),
                curves("Temperature (°C)", "temperature"),
                *([_laws(laws)] if laws else []),
                row_shares=[4, 3, 2, *([3] if laws else [])],
            ),
            column_shares=[4, 6],
        ),
        # The cursor follows a live record; in a finished record it stays at its position.
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="following" if span_s is None else None),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )


def _laws(laws: Sequence[str]) -> rrb.Horizontal:
    """Return one pane for each law, side by side: a pane behind another one cannot be drawn without a screen."""
    import rerun.blueprint as rrb

    # Its legend would name entities, over the bars; grey ones the record has not reached.
    legend = rrb.PlotLegend(visible=False)
    return rrb.Horizontal(*(rrb.BarChartView(origin=law_entity(name), name=name, plot_legend=legend) for name in laws))


def law_entity(name: str) -> str:
    """Return the path of a law in the recording: its name without characters that a path cannot contain."""
    return f"laws/{re.sub('[^a-z0-9_]+', '_', name.lower()).strip('_')}"


def _view_range(span_s: tuple[float, float] | None) -> rrb.TimeRange:
    """Return the range of the curves: a record's, or two minutes before the cursor.

    To the right is room for the legends, as a share of the range: of a pane of 770 px, six tenths of the window,
    0.3 / 1.3 or 177 px. The longest name has 21 letters of 7 px, and its line takes 30.
    """
    import rerun.blueprint as rrb

    live_s, legend = 120.0, 0.3
    if span_s is None:
        return rrb.TimeRange(
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-live_s),
            end=rrb.TimeRangeBoundary.cursor_relative(seconds=legend * live_s),
        )
    first_s, last_s = span_s
    margin_s = legend * (last_s - first_s)
    return rrb.TimeRange(
        start=rrb.TimeRangeBoundary.absolute(seconds=first_s - 0.02 * margin_s),
        end=rrb.TimeRangeBoundary.absolute(seconds=last_s + margin_s),
    )


def _event_columns() -> rrb.TextLogColumns:
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind

    return rrb.TextLogColumns(
        text_log_columns=[TextLogColumn(TextLogColumnKind.LogLevel), TextLogColumn(TextLogColumnKind.Body)]
    )


def log_series(stream: rr.RecordingStream, entity: str, time_s: ArrayLike, values: ArrayLike) -> None:
    """Log a curve (n,), or more of one, over times on the film's clock."""
    import rerun as rr

    indexes = [rr.TimeColumn(TIME, duration=np.asarray(time_s, np.float64))]
    stream.send_columns(entity, indexes=indexes, columns=rr.Scalars.columns(scalars=values))


def log_styles(stream: rr.RecordingStream) -> None:
    """Log names, colours and widths of the curves."""
    import rerun as rr

    for series in SERIES:
        style = rr.SeriesLines(colors=series.colour, widths=series.width, names=series.name)
        stream.log(series.entity, style, static=True)
    points = rr.SeriesPoints(colors=HALF_CYCLE_COLOUR, markers="diamond", marker_sizes=5.0, names="half-cycle begins")
    stream.log(HALF_CYCLE, points, static=True)


def log_sizes(stream: rr.RecordingStream) -> None:
    """Log the sizes of markers and sticks, and that the angle is written beside its arc."""
    import rerun as rr

    markers = rr.Points2D.from_fields(radii=rr.Radius.ui_points(5.0), show_labels=False)
    sticks = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.5), show_labels=True)
    stream.log("film/markers", markers, static=True)
    stream.log("film/sticks", sticks, static=True)
