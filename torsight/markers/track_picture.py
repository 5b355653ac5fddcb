"""``track.png``: frames of the film with the tracked markers drawn on them, and the angle with its gaps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from torsight.core.files.figure_file import write_figure
from torsight.core.parameter import REACH
from torsight.core.series import runs, usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, LIGHT, MOVING_COLOUR, hex_of
from torsight.core.words.wording import counted
from torsight.markers.preview import TEXT, show_frame, show_named, show_ring
from tracker.rows import STATES

if TYPE_CHECKING:
    from tracker.frames.source import Source
    from tracker.track import TrackResult

_OVER_THE_FILM: Final = 4
"""Frames beside the first one and the worst one, evenly spaced up to the last."""
_PANEL_PX: Final = 420.0
"""Width of a frame's panel; three of them stand side by side."""
_SHAPE: Final = 4.0 / 3.0
"""Width over height of the part of a frame that is drawn, where the frame has it."""
_HEAD_PX: Final = 40.0
_PLOT_PX: Final = 260.0
"""Height of the text above a panel; height of the plot of the angle."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A frame in the picture: its number, and the reason for showing it."""

    index: int
    why: str


def keep_pictures(source: Source) -> None:
    """Let a source keep, during a pass, the frames that will be drawn, as far as they are known beforehand."""
    if source.frame_count:
        source.keep(_evenly(source.frame_count))


def write_track_picture(path: Path, source: Source, result: TrackResult, angles: StickAngles) -> None:
    """Draw the first frame, four over the film and the worst one with the tracked markers, and the angle with its gaps.

    The source is read for these frames after a pass.
    """
    shown = chosen_frames(result, angles)
    view = _view(result)
    tall = min(_PANEL_PX, _PANEL_PX * (view[3] - view[1]) / (view[2] - view[0]))
    rows = (len(shown) + 2) // 3
    wide, high = 3 * _PANEL_PX + 40.0, _HEAD_PX + rows * (tall + _HEAD_PX) + _PLOT_PX + 90.0
    figure = Figure((wide / 100.0, high / 100.0), dpi=100.0)

    def part(left: float, top: float, width: float, height: float) -> Axes:
        return figure.add_axes((left / wide, 1.0 - (top + height) / high, width / wide, height / high))

    known = int(angles.valid.sum())
    title = f"{Path(source.name).name}: {known} of {counted(len(angles), 'frame')} have an angle"
    figure.suptitle(title, x=0.01, y=1.0 - 10.0 / high, ha="left", fontweight="bold")
    lumas = source.pictures([one.index for one in shown])
    for number, one in enumerate(shown):
        row, column = divmod(number, 3)
        left, top = 10.0 + column * (_PANEL_PX + 10.0), 2 * _HEAD_PX + row * (tall + _HEAD_PX)
        angle = f"{angles.angle_rad[one.index] / DEG:.2f}°" if angles.valid[one.index] else "no angle"
        axes = part(left, top, _PANEL_PX, tall)
        axes.set(xticks=[], yticks=[])
        below = f"frame {one.index}, {angles.time_s[one.index]:.2f} s: {angle}"
        axes.set_title(f"{one.why}\n{below}", **TEXT)
        _draw_frame(axes, lumas.get(one.index), one, result=result, view=view)
    top = 2 * _HEAD_PX + rows * (tall + _HEAD_PX) - 10.0
    _draw_angle(part(70.0, top, wide - 90.0, _PLOT_PX), angles, shown)
    # Quick compression: the usual one takes a quarter of the drawing's time, for a file a quarter smaller.
    write_figure(path, figure, pil_kwargs={"compress_level": 1})


def chosen_frames(result: TrackResult, angles: StickAngles) -> list[Shown]:
    """Return the frames that are drawn: the first, four up to the last, and the worst; none twice.

    The worst frame is the middle of the longest stretch without an angle; where every frame has an angle, the frame
    with the largest sigma.
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
    for part, index in enumerate(_evenly(count)[1:], 1):
        shown.append(Shown(index, f"{100 * part // _OVER_THE_FILM} % of the film"))
    once = {one.index: one for one in [*reversed(shown), worst]}
    return [*sorted((one for one in once.values() if one is not worst), key=lambda one: one.index), worst]


def _evenly(count: int) -> list[int]:
    """Return the first of ``count`` frames and four more up to the last, evenly spaced."""
    return [round(part * (count - 1) / _OVER_THE_FILM) for part in range(_OVER_THE_FILM + 1)]


def _why(result: TrackResult, index: int) -> str:
    """Return the states of the markers that were not tracked in a frame, as words."""
    states = [STATES[code] for code in result.rows["state"][index].tolist()]
    bad = sorted({state for state in states if state != "seen"})
    return ", ".join(f"{states.count(state)} {state}" for state in bad) or "impossible length"


def _view(result: TrackResult) -> tuple[int, int, int, int]:
    """Return the part of the picture that holds all positions of all markers, with a margin."""
    width, height = result.tracks.size_px
    rivals = [point for one in result.report["markers"].get("rivals", []) for point in (*one["base"], *one["moving"])]
    places = np.concatenate([result.tracks.position_px.reshape(-1, 2), np.reshape(rivals, (-1, 2))])
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return 0, 0, width, height
    low, high = places.min(axis=0), places.max(axis=0)
    room = max(0.15 * float((high - low).max()), 4.0 * float(result.report["markers"]["radius_px"]))
    wide, tall = (high - low + 2.0 * room).tolist()
    # Panels have one shape where the picture is large enough; a part beyond its border is shifted inside.
    wide, tall = min(max(wide, _SHAPE * tall), float(width)), min(max(tall, wide / _SHAPE), float(height))
    left = min(max(0, round(0.5 * (low[0] + high[0] - wide))), width - round(wide))
    top = min(max(0, round(0.5 * (low[1] + high[1] - tall))), height - round(tall))
    return left, top, left + round(wide), top + round(tall)


def _draw_frame(
    axes: Axes, luma: NDArray[np.uint8] | None, one: Shown, *, result: TrackResult, view: tuple[int, int, int, int]
) -> None:
    if luma is None:
        axes.text(0.5, 0.5, "this frame cannot be decoded", ha="center", transform=axes.transAxes)
        return
    show_frame(axes, luma, view_px=view)
    radius = float(result.report["markers"]["radius_px"])
    read = np.where(result.tracks.valid[one.index, :, None], result.tracks.position_px[one.index], np.nan)
    for stick, colour in ((read[:2], hex_of(BASE_COLOUR)), (read[2:], hex_of(MOVING_COLOUR))):
        axes.plot(*stick.T, "+-", color=colour, linewidth=0.8, markersize=5.0)
        for place in stick[np.isfinite(stick).all(axis=1)].tolist():
            show_ring(axes, place, 1.6 * radius, color=colour)
    if one.index == 0:
        # The dots that may equally be the markers.
        taken = result.report["markers"].get("taken", {})
        for rival in result.report["markers"].get("rivals", []):
            for name in ("base", "moving"):
                if rival[name] != taken[name]:
                    show_named(axes, np.array(rival[name]), [f"or {name}"] * 2, [GIVEN_COLOUR] * 2)


def _draw_angle(axes: Axes, angles: StickAngles, shown: list[Shown]) -> None:
    """Draw the angle over time, its 95 % interval, the gaps as bands, and the times of the frames above."""
    time_s, angle_deg = angles.time_s, np.where(angles.valid, angles.angle_rad, np.nan) / DEG
    band, colour = REACH * angles.sigma_rad / DEG, LIGHT["after"]
    axes.plot(time_s, angle_deg, color=colour, linewidth=0.8, label="angle, with its 95 % interval")
    axes.fill_between(time_s, angle_deg - band, angle_deg + band, color=colour, alpha=0.25, linewidth=0.0)
    half, gaps = 0.5 * (usual_step(time_s) or 1.0), runs(~angles.valid)
    spans = [(time_s[begin] - half, time_s[end - 1] - time_s[begin] + 2.0 * half) for begin, end in gaps]
    if spans:
        style: dict[str, Any] = {"facecolor": LIGHT["before"], "alpha": 0.3, "transform": axes.get_xaxis_transform()}
        axes.broken_barh(spans, (0.0, 1.0), label=f"no angle ({counted(int((~angles.valid).sum()), 'frame')})", **style)
    for one in shown:
        axes.axvline(time_s[one.index], color="black", linewidth=0.8, linestyle="--" if one is shown[-1] else ":")
    axes.margins(x=0.01)
    axes.tick_params(labelsize="small")
    axes.grid(color="0.9")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, **TEXT)
    axes.set(xlabel="time (s); dotted: the frames above, dashed: the worst one", ylabel="angle (°)")
