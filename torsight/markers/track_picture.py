"""``track.png``: frames of the film with what was read drawn on them, and the angle with its gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from torsight.core.parameter import REACH
from torsight.core.series import runs
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG
from torsight.core.words.wording import counted
from torsight.markers.drawing import BASE, MOVING, PLAIN, new_figure, panel, save, show_frame, show_stick
from tracker.rows import STATES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tracker.track import TrackResult

NAME: Final = "track.png"
"""The file's name in the folder of a track."""
_OVER_THE_FILM: Final = 4
"""Frames beside the first one and the worst one, evenly spaced up to the last."""
_PANEL_PX: Final = 420.0
_SHAPE: Final = 4.0 / 3.0
"""Width over height of the part of a frame that is drawn, where the frame has it."""
_HEAD_PX: Final = 40.0
_PLOT_PX: Final = 260.0
_GAP: Final = "#d55e00"


class Pictures(Protocol):
    """A source of frames that gives single ones again after a pass."""

    name: str

    def pictures(self, indices: Iterable[int]) -> dict[int, NDArray[np.uint8]]:
        """Return some frames of the last pass by their numbers, without those that cannot be decoded."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A frame in the picture: which, and why this one."""

    index: int
    why: str


def write_track_picture(path: Path, source: Pictures, result: TrackResult, angles: StickAngles) -> None:
    """Draw the first frame, four over the film and the worst one with the markers as read, and the angle with its gaps.

    Parameters
    ----------
    path : Path
        The PNG file.
    source : Pictures
        The film, after a pass.
    result : TrackResult
        The markers that were read.
    angles : StickAngles
        The angle made of them.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    shown = chosen_frames(result, angles)
    view = _view(result)
    tall = min(_PANEL_PX, _PANEL_PX * (view[3] - view[1]) / (view[2] - view[0]))
    rows = (len(shown) + 2) // 3
    wide = 3 * _PANEL_PX + 4 * 10.0
    high = _HEAD_PX + rows * (tall + _HEAD_PX) + _PLOT_PX + 90.0
    figure = new_figure((wide, high))
    known = int(angles.valid.sum())
    title = f"{Path(source.name).name}: {known} of {counted(len(angles), 'frame')} have an angle"
    figure.text(10.0 / wide, 1.0 - 10.0 / high, title, fontsize=12, weight="bold", va="top", color=PLAIN)
    lumas = source.pictures([one.index for one in shown])
    for number, one in enumerate(shown):
        row, column = divmod(number, 3)
        box = (10.0 + column * (_PANEL_PX + 10.0), 2 * _HEAD_PX + row * (tall + _HEAD_PX), _PANEL_PX, tall)
        _draw_frame(panel(figure, box), lumas.get(one.index), one, result=result, angles=angles, view=view)
    top = 2 * _HEAD_PX + rows * (tall + _HEAD_PX) - 10.0
    _draw_angle(panel(figure, (70.0, top, wide - 90.0, _PLOT_PX)), angles, shown)
    save(figure, path)


def chosen_frames(result: TrackResult, angles: StickAngles) -> list[Shown]:
    """Return the frames that are drawn: the first, four up to the last, and the worst; none twice.

    The worst frame is the middle one of the longest stretch without an angle; where every frame has one, that of the
    largest sigma.
    """
    count = len(angles)
    if count == 0:
        return []
    shown = [Shown(0, "first frame")]
    gaps = runs(~angles.valid)
    if gaps:
        begin, end = max(gaps, key=lambda gap: gap[1] - gap[0])
        middle = (begin + end - 1) // 2
        worst = Shown(middle, f"worst: amid {counted(end - begin, 'frame')} without an angle ({_why(result, middle)})")
    else:
        index = int(np.argmax(angles.sigma_rad))
        worst = Shown(index, f"worst: largest uncertainty, ± {angles.sigma_rad[index] / DEG:.3f}°")
    for part in range(1, _OVER_THE_FILM + 1):
        index = round(part * (count - 1) / _OVER_THE_FILM)
        shown.append(Shown(index, f"{100 * part // _OVER_THE_FILM} % of the film"))
    once = {one.index: one for one in [*reversed(shown), worst]}
    return [*sorted((one for one in once.values() if one is not worst), key=lambda one: one.index), worst]


def _why(result: TrackResult, index: int) -> str:
    """Return the states of the markers that were not read in a frame, as words."""
    states = [STATES[code] for code in result.rows["state"][index].tolist()]
    bad = sorted({state for state in states if state != "seen"})
    return ", ".join(f"{states.count(state)} {state}" for state in bad) or "impossible length"


def _view(result: TrackResult) -> tuple[float, float, float, float]:
    """Return the part of the picture that holds all places of all markers, with room around them."""
    width, height = result.tracks.size_px
    whole = (-0.5, -0.5, width - 0.5, height - 0.5)
    places = result.tracks.position_px.reshape(-1, 2)
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return whole
    low, high = places.min(axis=0), places.max(axis=0)
    room = max(0.15 * float((high - low).max()), 4.0 * float(result.report["markers"]["radius_px"]))
    wide, tall = (high - low + 2.0 * room).tolist()
    # Panels of one shape, as far as the picture reaches; a smaller part is moved to lie inside it.
    wide, tall = min(max(wide, _SHAPE * tall), float(width)), min(max(tall, wide / _SHAPE), float(height))
    left = min(max(whole[0], 0.5 * (low[0] + high[0] - wide)), whole[2] - wide)
    top = min(max(whole[1], 0.5 * (low[1] + high[1] - tall)), whole[3] - tall)
    return float(left), float(top), float(left + wide), float(top + tall)


def _draw_frame(
    axes: Axes,
    luma: NDArray[np.uint8] | None,
    one: Shown,
    *,
    result: TrackResult,
    angles: StickAngles,
    view: tuple[float, float, float, float],
) -> None:
    angle = f"{angles.angle_rad[one.index] / DEG:.2f}°" if angles.valid[one.index] else "no angle"
    axes.set_title(f"{one.why}\nframe {one.index}, {angles.time_s[one.index]:.2f} s: {angle}", fontsize=8, color=PLAIN)
    if luma is None:
        axes.text(0.5, 0.5, "this frame cannot be decoded", ha="center", transform=axes.transAxes, fontsize=9)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    show_frame(axes, luma, view_px=view)
    radius = float(result.report["markers"]["radius_px"])
    read = np.where(result.tracks.valid[one.index, :, None], result.tracks.position_px[one.index], np.nan)
    show_stick(axes, read[:2], colour=BASE, radius_px=radius)
    show_stick(axes, read[2:], colour=MOVING, radius_px=radius)


def _draw_angle(axes: Axes, angles: StickAngles, shown: list[Shown]) -> None:
    """Draw the angle over time, its 95 % band, the gaps as bands, and where the frames above are."""
    time_s, angle_deg = angles.time_s, angles.angle_rad / DEG
    band = REACH * angles.sigma_rad / DEG
    axes.fill_between(time_s, angle_deg - band, angle_deg + band, color="#0072b2", alpha=0.25, lw=0)
    axes.plot(time_s, angle_deg, color="#0072b2", lw=1.0, label="angle, with its 95 % band")
    if not angles.valid.all() and len(time_s):
        step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
        gaps = [(time_s[begin] - 0.5 * step, time_s[end - 1] + 0.5 * step) for begin, end in runs(~angles.valid)]
        axes.broken_barh(
            [(begin, end - begin) for begin, end in gaps],
            (0.0, 1.0),
            transform=axes.get_xaxis_transform(),
            color=_GAP,
            alpha=0.3,
            lw=0,
            label=f"no angle ({counted(int((~angles.valid).sum()), 'frame')})",
        )
    for one in shown:
        axes.axvline(time_s[one.index], color=PLAIN, lw=0.7, ls=":" if one is not shown[-1] else "--", alpha=0.7)
    axes.set_xlabel("time (s); dotted: the frames above, dashed: the worst one", fontsize=8)
    axes.set_ylabel("angle (°)", fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.25)
    axes.margins(x=0.01)
    axes.legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
