"""Plots as SVG text: axes with round ticks, lines, points, bands, a legend above the data.

Colours are classes, not values: the page's style sheet gives them for light, dark and print, and a figure saved on
its own carries the light ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

CHARACTER_PX: Final = 6.9
"""Mean width of a character at the labels' 12 px in a wide font; places legend entries side by side."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: what it shows with its unit, and its range."""

    label: str
    low: float
    high: float
    ticks: int = 6

    @staticmethod
    def along(label: str, values: NDArray[np.float64], *, ticks: int = 10) -> Axis:
        """Return an axis from the first to the last finite value, as for time."""
        known = values[np.isfinite(values)]
        if not len(known):
            return Axis(label, 0.0, 1.0, ticks)
        low, high = float(known.min()), float(known.max())
        return Axis(label, low, high if high > low else low + 1.0, ticks)

    @staticmethod
    def around(label: str, *values: ArrayLike, margin: float = 0.04, ticks: int = 6) -> Axis:
        """Return an axis that holds all finite values with a margin on both sides."""
        known = np.concatenate([np.ravel(np.asarray(one, dtype=np.float64)) for one in values])
        known = known[np.isfinite(known)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        pad = margin * (high - low) if high > low else max(abs(high), 1.0) * 0.1
        return Axis(label, low - pad, high + pad, ticks)

    def positions(self) -> list[float]:
        """Return round tick positions inside the range: steps of 1, 2 or 5 times a power of ten."""
        low, high = min(self.low, self.high), max(self.low, self.high)
        if not high > low:
            return [low]
        raw = (high - low) / self.ticks
        power = 10.0 ** math.floor(math.log10(raw))
        steps = [power * factor for factor in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0)]
        place = next(k for k, step in enumerate(steps) if step >= raw * 0.999)
        found = _multiples(steps[place], low, high)
        finer = _multiples(steps[place - 1], low, high)
        return finer if len(found) < 3 and len(finer) <= self.ticks + 1 else found


def _multiples(step: float, low: float, high: float) -> list[float]:
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


@dataclass(slots=True)
class Plot:
    """One panel under construction; every method adds to it and :meth:`render` gives the SVG text.

    Parameters
    ----------
    x, y : Axis
        The axes.
    title : str
        Said to people who cannot see the picture.
    width, height : float
        Size of the whole figure in its own pixels; the page scales it.
    legend_rows : int
        Rows kept free above the data for legend entries.
    """

    x: Axis
    y: Axis
    title: str
    width: float = 860.0
    height: float = 300.0
    legend_rows: int = 1
    left: float = 62.0
    x_labels: Sequence[tuple[float, str]] | None = None
    y_labels: Sequence[tuple[float, str]] | None = None
    _marks: list[str] = field(default_factory=list)
    _legend: list[tuple[str, str, str]] = field(default_factory=list)

    @property
    def top(self) -> float:
        """Upper edge of the data's rectangle."""
        return 10.0 + 20.0 * self.legend_rows if self.legend_rows else 6.0

    @property
    def right(self) -> float:
        """Right edge of the data's rectangle."""
        return self.width - 14.0

    @property
    def bottom(self) -> float:
        """Lower edge of the data's rectangle."""
        return self.height - (44.0 if self.x.label else 24.0)

    def at_x(self, value: ArrayLike) -> NDArray[np.float64]:
        """Return the horizontal position of values on the x axis."""
        share = (np.asarray(value, dtype=np.float64) - self.x.low) / ((self.x.high - self.x.low) or 1.0)
        return np.asarray(self.left + share * (self.right - self.left))

    def at_y(self, value: ArrayLike) -> NDArray[np.float64]:
        """Return the vertical position of values on the y axis."""
        share = (np.asarray(value, dtype=np.float64) - self.y.low) / (self.y.high - self.y.low)
        return np.asarray(self.bottom - share * (self.bottom - self.top))

    def legend(self, kind: str, mark: str, text: str) -> None:
        """Add a legend entry; ``mark`` is ``line``, ``points`` or ``band``."""
        if (kind, mark, text) not in self._legend:
            self._legend.append((kind, mark, text))

    def line(self, x: ArrayLike, y: ArrayLike, kind: str, *, label: str = "", ordered: bool = True) -> None:
        """Draw a curve; ``ordered`` says that x increases, so that every peak is kept when it is thinned."""
        px, py = self.at_x(x), self.at_y(y)
        px, py = thin_series(px, py, bins=700) if ordered else thin_path(px, py)
        self._marks.append(f'<path class="line {kind}" d="{path_data(px, py)}"/>')
        if label:
            self.legend(kind, "line", label)

    def points(self, x: ArrayLike, y: ArrayLike, kind: str, *, label: str = "") -> None:
        """Draw points; of those that fall on the same spot one is kept."""
        px, py = thin_points(self.at_x(x), self.at_y(y))
        data = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(px, py, strict=True))
        self._marks.append(f'<path class="points {kind}" d="{data}"/>')
        if label:
            self.legend(kind, "points", label)

    def band(self, low: float, high: float, kind: str, *, label: str = "") -> None:
        """Shade a range of x over the full height."""
        a, b = np.clip(self.at_x([low, high]), self.left, self.right)
        self._marks.append(
            f'<rect class="band {kind}" x="{a:.1f}" y="{self.top:.1f}" width="{max(b - a, 0.5):.1f}" '
            f'height="{self.bottom - self.top:.1f}"/>'
        )
        if label:
            self.legend(kind, "band", label)

    def mark(self, value: float, kind: str, *, tip: str, label: str = "") -> None:
        """Draw a line over the full height at a value of x, with words for who points at it."""
        a = float(self.at_x(value))
        if self.left - 1.0 <= a <= self.right + 1.0:
            self._marks.append(
                f'<path class="mark {kind}" d="M{a:.1f} {self.top:.1f}V{self.bottom:.1f}">'
                f"<title>{escape(tip)}</title></path>"
            )
            if label:
                self.legend(f"mark {kind}", "line", label)

    def range_y(self, low: float, high: float, kind: str, *, label: str = "") -> None:
        """Shade a range of y over the full width."""
        b, a = np.clip(self.at_y([low, high]), self.top, self.bottom)
        self._marks.append(
            f'<rect class="band {kind}" x="{self.left:.1f}" y="{a:.1f}" width="{self.right - self.left:.1f}" '
            f'height="{max(b - a, 0.5):.1f}"/>'
        )
        if label:
            self.legend(kind, "band", label)

    def box(self, x: tuple[float, float], y: tuple[float, float], kind: str, *, tip: str = "") -> None:
        """Draw a filled rectangle between two values of x and of y."""
        (a, b), (d, c) = np.sort(self.at_x(x)), np.sort(self.at_y(y))
        title = f"<title>{escape(tip)}</title>" if tip else ""
        self._marks.append(
            f'<rect class="fill {kind}" x="{a:.1f}" y="{d:.1f}" width="{b - a:.1f}" '
            f'height="{max(c - d, 0.8):.1f}">{title}</rect>'
        )

    def dots(self, x: ArrayLike, y: ArrayLike, kind: str, *, radius: float = 4.0) -> None:
        """Draw single large dots."""
        for a, b in zip(np.ravel(self.at_x(x)), np.ravel(self.at_y(y)), strict=True):
            self._marks.append(f'<circle class="fill {kind}" cx="{a:.1f}" cy="{b:.1f}" r="{radius:g}"/>')

    def level(self, value: float) -> None:
        """Draw a level over the full width."""
        b = float(self.at_y(value))
        self._marks.append(f'<path class="grid zero" d="M{self.left:.1f} {b:.1f}H{self.right:.1f}"/>')

    def text(
        self, x: float, y: float, words: str, *, anchor: str = "middle", shift_px: float = 0.0, right_px: float = 0.0
    ) -> None:
        """Write words at a place of the data, moved down and to the right."""
        a, b = float(self.at_x(x)) + right_px, float(self.at_y(y)) + shift_px
        self._marks.append(f'<text class="note" x="{a:.1f}" y="{b:.1f}" text-anchor="{anchor}">{escape(words)}</text>')

    def render(self) -> str:
        """Return the figure as an ``<svg>`` element."""
        return stacked([self], self.title)

    def body(self) -> str:
        """Return what is drawn, without the element around it."""
        return f"{self._grid()}{''.join(self._marks)}{self._legend_text()}"

    def _grid(self) -> str:
        parts = []
        y_positions = self.y.positions()
        for value, words in self.y_labels or list(zip(y_positions, tick_texts(y_positions), strict=True)):
            b = float(self.at_y(value))
            if self.y_labels is None:
                parts.append(f'<path class="grid" d="M{self.left:.1f} {b:.1f}H{self.right:.1f}"/>')
            parts.append(
                f'<text class="tick" x="{self.left - 7:.1f}" y="{b + 4:.1f}" text-anchor="end">{escape(words)}</text>'
            )
        positions = self.x.positions()
        labels = self.x_labels or list(zip(positions, tick_texts(positions), strict=True))
        for value, words in labels:
            a = float(self.at_x(value))
            if self.x_labels is None:
                parts.append(f'<path class="grid" d="M{a:.1f} {self.top:.1f}V{self.bottom:.1f}"/>')
            parts.append(
                f'<text class="tick" x="{a:.1f}" y="{self.bottom + 17:.1f}" text-anchor="middle">{escape(words)}</text>'
            )
        middle_x, middle_y = (self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0
        parts.append(
            f'<text class="axis" x="{middle_x:.1f}" y="{self.height - 8:.1f}" text-anchor="middle">'
            f"{escape(self.x.label)}</text>"
            f'<text class="axis" transform="translate(14 {middle_y:.1f}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y.label)}</text>"
        )
        return "".join(parts)

    def _legend_text(self) -> str:
        parts, a, row = [], self.left, 0
        for kind, mark, words in self._legend:
            width = 42.0 + CHARACTER_PX * len(words)
            if a + width > self.width and a > self.left and row + 1 < self.legend_rows:
                a, row = self.left, row + 1
            b = 12.0 + 20.0 * row
            if mark == "band":
                parts.append(f'<rect class="band {kind}" x="{a:.1f}" y="{b - 6:.1f}" width="20" height="12"/>')
            elif mark == "points":
                data = "".join(f"M{a + k:.1f} {b:.1f}h0" for k in (3, 10, 17))
                parts.append(f'<path class="points key {kind}" d="{data}"/>')
            else:
                parts.append(f'<path class="line key {kind}" d="M{a:.1f} {b:.1f}h20"/>')
            parts.append(f'<text class="key" x="{a + 26:.1f}" y="{b + 4:.1f}">{escape(words)}</text>')
            a += width
        return "".join(parts)


def stacked(plots: Sequence[Plot], title: str) -> str:
    """Return panels one above the other as one ``<svg>`` element."""
    parts, down = [], 0.0
    for plot in plots:
        shift = f' transform="translate(0 {down:g})"' if down else ""
        parts.append(f"<g{shift}>{plot.body()}</g>")
        down += plot.height
    size = f'viewBox="0 0 {max(plot.width for plot in plots):g} {down:g}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" aria-label="{escape(title, quote=True)}">'
        f"{''.join(parts)}</svg>"
    )


def tick_texts(values: Sequence[float]) -> list[str]:
    """Return the labels of evenly spaced ticks: as many decimals as their step needs, a true minus sign."""
    if len(values) < 2:
        return [f"{value:g}".replace("-", "−") for value in values]
    step = abs(values[1] - values[0])
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return [f"{value + 0.0:.{decimals}f}".replace("-", "−") for value in values]


def path_data(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    """Return SVG path data through the points; a point that is not finite lifts the pen."""
    parts: list[str] = []
    down = False
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if math.isfinite(a) and math.isfinite(b):
            parts.append(f"{'L' if down else 'M'}{a:.1f} {b:.1f}")
            down = True
        else:
            down = False
    return "".join(parts)


def thin_series(
    x: NDArray[np.float64], y: NDArray[np.float64], *, bins: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep the lowest and the highest point of every bin of consecutive samples, and one gap where there is any."""
    n = len(x)
    if n <= 4 * bins:
        return x, y
    keep: list[int] = [0]
    for part in np.array_split(np.arange(n), bins):
        known = part[np.isfinite(y[part])]
        ends = [int(known[np.argmin(y[known])]), int(known[np.argmax(y[known])])] if len(known) else []
        gap = part[~np.isfinite(y[part])]
        keep += sorted({*ends, *(gap[:1].tolist())})
    index = np.unique([*keep, n - 1])
    return x[index], y[index]


def thin_path(
    x: NDArray[np.float64], y: NDArray[np.float64], *, least_px: float = 0.8
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Drop the points of a path that lie within ``least_px`` of the last one that was kept."""
    keep: list[int] = []
    last_x = last_y = math.nan
    for index, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        near = abs(a - last_x) < least_px and abs(b - last_y) < least_px
        if not near:
            keep.append(index)
            last_x, last_y = a, b
    return x[keep], y[keep]


def thin_points(
    x: NDArray[np.float64], y: NDArray[np.float64], *, spot_px: float = 1.6, most: int = 3000
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep one point per spot of the picture, and of these an even choice where there are too many."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if not len(x):
        return x, y
    cells = np.round(np.column_stack([x, y]) / spot_px).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    chosen = np.sort(first)
    chosen = chosen[:: max(1, math.ceil(len(chosen) / most))]
    return x[chosen], y[chosen]
