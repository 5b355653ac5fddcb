"""Content of a plot, independent of its drawing: axes, curves, points, bars, bands and words.

:mod:`torsight.report.plots.interactive` draws it with Bokeh for the screen, :mod:`torsight.report.plots.still` with
matplotlib for paper and for a browser without scripts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from torsight.core.units import Floats
from torsight.core.words.colours import LIGHT

COLOURS: Final = {
    "base": "spring-b",
    "moving": "after",
    "event": "before",
    "floor": "muted",
    "prior": "muted",
    "zero": "muted",
    "rival": "held",
    "covered": "spring-b",
    "rival-0": "after",
    "rival-1": "held",
    "rival-2": "spring-a",
    "rival-3": "muted",
}
"""The palette's colour for kinds with another name."""

_DASHES: Final = {"rival-1": (7, 3), "rival-2": (2, 4), "rival-3": (9, 3, 2, 3), "event": (3, 3), "last": (7, 5)}
_WIDTHS: Final = {
    "measured": 5.0,
    "rival-0": 3.4,
    "rival-1": 2.0,
    "rival-2": 2.4,
    "mean": 2.6,
    "interval": 3.0,
    "stick": 3.5,
}
_OPACITIES: Final = {
    "faint": 0.3,
    "interval": 0.55,
    "last": 0.45,
    "held": 0.17,
    "floor": 0.3,
    "lost": 0.3,
    "prior": 0.16,
    "covered": 0.14,
    "ribbon": 0.25,
}

BINS: Final = 1000
"""Bins of a curve, two points each: on a wide screen a zoom by three shows every point that there is to see. A cloud
has as many points as a curve."""


@dataclass(frozen=True, slots=True)
class Style:
    """Colour (``#rrggbb``, of a light screen), width in pixels, dashes in pixels, and opacity."""

    colour: str
    width: float = 1.5
    dash: tuple[int, ...] = ()
    opacity: float = 1.0


def style_of(kind: str) -> Style:
    """Return the style of a kind: its first word names the colour, further words refine it (``before mean``)."""
    words = kind.split()
    return Style(
        colour=LIGHT[COLOURS.get(words[0], words[0])],
        width=next((_WIDTHS[word] for word in reversed(words) if word in _WIDTHS), 1.5),
        dash=next((_DASHES[word] for word in words if word in _DASHES), ()),
        opacity=min((_OPACITIES[word] for word in words if word in _OPACITIES), default=1.0),
    )


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: its label with the unit, its initial range, and for a time axis its clock.

    Time axes of one clock move together.
    """

    label: str
    low: float
    high: float
    clock: str = ""

    @staticmethod
    def along(label: str, values: Floats, *, clock: str = "film") -> Axis:
        """Return an axis of time from the first to the last finite value."""
        known = values[np.isfinite(values)]
        if not len(known):
            return Axis(label, 0.0, 1.0, clock)
        low, high = float(known.min()), float(known.max())
        return Axis(label, low, high if high > low else low + 1.0, clock)

    @staticmethod
    def around(label: str, *values: ArrayLike, margin: float = 0.04) -> Axis:
        """Return an axis that holds all finite values with a margin on both sides."""
        known = np.concatenate([np.ravel(np.asarray(one, dtype=np.float64)) for one in values])
        known = known[np.isfinite(known)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        pad = margin * (high - low) if high > low else max(abs(high), 1.0) * 0.1
        return Axis(label, low - pad, high + pad)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A curve; ``ordered``: x increases, so that thinning can keep every peak."""

    x: Floats
    y: Floats
    kind: str
    label: str = ""
    ordered: bool = True

    def thinned(self, panel: Panel) -> tuple[Floats, Floats]:
        """Return the points to draw."""
        if self.ordered:
            return thin_series(self.x, self.y)
        # Two points for each pixel of a path that crosses the panel about twice.
        across, along = abs(panel.x.high - panel.x.low), abs(panel.y.high - panel.y.low)
        return thin_path(self.x, self.y, least=(2.0 * across / BINS, 2.0 * along / BINS))


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points, small where there are many and large where each one is named (``radius`` in pixels)."""

    x: Floats
    y: Floats
    kind: str
    label: str = ""
    radius: float = 1.2


@dataclass(frozen=True, slots=True, eq=False)
class Ribbon:
    """The area between two curves."""

    x: Floats
    low: Floats
    high: Floats
    kind: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class Band:
    """A range of one axis, over the whole of the other."""

    low: float
    high: float
    kind: str
    label: str = ""
    upright: bool = True


@dataclass(frozen=True, slots=True)
class Box:
    """A filled rectangle, with words under the pointer."""

    x: tuple[float, float]
    y: tuple[float, float]
    kind: str
    tip: str = ""
    label: str = ""


@dataclass(frozen=True, slots=True)
class Rule:
    """A straight line over the whole panel, with words under the pointer."""

    value: float
    kind: str
    tip: str = ""
    label: str = ""
    upright: bool = True


@dataclass(frozen=True, slots=True)
class Note:
    """Words to the right of a point in data coordinates."""

    x: float
    y: float
    words: str


Drawn = Line | Points | Ribbon | Band | Box | Rule
"""Marks of a kind, which a legend can explain."""
Mark = Drawn | Note


@dataclass(slots=True)
class Panel:
    """One panel under construction: two axes, and the marks that are drawn, the first below the last.

    The size is in pixels of the unscaled page. A categorical axis has names at positions. ``square``: both axes have
    one scale.
    """

    x: Axis
    y: Axis
    width: float = 860.0
    height: float = 300.0
    x_names: Sequence[tuple[float, str]] | None = None
    y_names: Sequence[tuple[float, str]] | None = None
    square: bool = False
    marks: list[Mark] = field(default_factory=list)

    def line(self, x: ArrayLike, y: ArrayLike, kind: str, *, label: str = "", ordered: bool = True) -> None:
        """Draw a curve."""
        self.marks.append(Line(_array(x), _array(y), kind, label, ordered))

    def points(self, x: ArrayLike, y: ArrayLike, kind: str, *, label: str = "", radius: float = 1.2) -> None:
        """Draw points."""
        self.marks.append(Points(_array(x), _array(y), kind, label, radius))

    def ribbon(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, kind: str, *, label: str = "") -> None:
        """Fill the area between two curves."""
        self.marks.append(Ribbon(_array(x), _array(low), _array(high), kind, label))

    def band(self, low: float, high: float, kind: str, *, label: str = "", upright: bool = True) -> None:
        """Shade a range of x over the full height, or of y over the full width."""
        self.marks.append(Band(float(low), float(high), kind, label, upright))

    def box(self, x: tuple[float, float], y: tuple[float, float], kind: str, *, tip: str = "", label: str = "") -> None:
        """Draw a filled rectangle between two values of x and of y."""
        self.marks.append(Box(x, y, kind, tip, label))

    def rule(self, value: float, kind: str, *, tip: str = "", label: str = "", upright: bool = True) -> None:
        """Draw a straight line over the whole panel."""
        self.marks.append(Rule(float(value), kind, tip, label, upright))

    def note(self, x: float, y: float, words: str) -> None:
        """Write words to the right of a point in data coordinates."""
        self.marks.append(Note(x, y, words))

    def key(self, kind: str, label: str) -> None:
        """Explain a kind of curve that has no label of its own."""
        self.marks.append(Line(np.empty(0), np.empty(0), kind, label))

    def legend(self) -> list[tuple[Drawn, str]]:
        """Return one mark for every label, in the order in which they were drawn."""
        found: dict[str, Drawn] = {}
        for mark in self.marks:
            if not isinstance(mark, Note) and mark.label:
                found.setdefault(mark.label, mark)
        return [(mark, label) for label, mark in found.items()]


def _array(values: ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(values, dtype=np.float64))


def thin_series(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Keep the lowest and the highest point of every bin of consecutive samples, and one gap where there is any."""
    n = len(x)
    if n <= 4 * BINS:
        return x, y
    keep: list[int] = [0]
    for part in np.array_split(np.arange(n), BINS):
        known = part[np.isfinite(y[part])]
        ends = [int(known[np.argmin(y[known])]), int(known[np.argmax(y[known])])] if len(known) else []
        gap = part[~np.isfinite(y[part])]
        keep += sorted({*ends, *(gap[:1].tolist())})
    index = np.unique([*keep, n - 1])
    return x[index], y[index]


def thin_path(x: Floats, y: Floats, *, least: tuple[float, float]) -> tuple[Floats, Floats]:
    """Drop the points of a path that lie within ``least`` (in x and in y) of the last point that was kept."""
    keep: list[int] = []
    last_x = last_y = math.nan
    for index, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        gap = not (math.isfinite(a) and math.isfinite(b))
        near = abs(a - last_x) < least[0] and abs(b - last_y) < least[1]
        # One NaN is enough to interrupt the line.
        if not near and not (gap and keep and math.isnan(last_x)):
            keep.append(index)
            last_x, last_y = (math.nan, math.nan) if gap else (a, b)
    return x[keep], y[keep]


def thin_points(x: Floats, y: Floats, *, spot: tuple[float, float]) -> tuple[Floats, Floats]:
    """Keep one point per cell of the size ``spot`` (x, y), and choose evenly among these where there are too many."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if not len(x):
        return x, y
    cells = np.round(np.column_stack([x / spot[0], y / spot[1]])).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    chosen = np.sort(first)
    chosen = chosen[:: max(1, math.ceil(len(chosen) / (2 * BINS)))]
    return x[chosen], y[chosen]
