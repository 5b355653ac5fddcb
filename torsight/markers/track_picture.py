"""``track.png``: frames of the film with the tracked markers drawn on them, and the angle with its gaps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.parameter import REACH
from torsight.core.series import runs, usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG, Floats
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, LIGHT, MOVING_COLOUR, Colour, rgb
from torsight.core.words.wording import counted
from torsight.markers.drawing import (
    Box,
    Canvas,
    FrameView,
    draw_grid,
    round_numbers,
    show_frame,
    show_named,
    show_stick,
)
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
_GAP: Final = rgb(LIGHT["before"])
_ANGLE: Final = rgb(LIGHT["after"])
"""As in the report."""
_GRID: Final[Colour] = (230, 230, 230)


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
    wide = 3 * _PANEL_PX + 4 * 10.0
    high = _HEAD_PX + rows * (tall + _HEAD_PX) + _PLOT_PX + 90.0
    canvas = Canvas.blank((wide, high))
    known = int(angles.valid.sum())
    title = f"{Path(source.name).name}: {known} of {counted(len(angles), 'frame')} have an angle"
    canvas.text((10, 26), title, size_px=18, bold=True)
    lumas = source.pictures([one.index for one in shown])
    for number, one in enumerate(shown):
        row, column = divmod(number, 3)
        left, top = 10.0 + column * (_PANEL_PX + 10.0), 2 * _HEAD_PX + row * (tall + _HEAD_PX)
        angle = f"{angles.angle_rad[one.index] / DEG:.2f}°" if angles.valid[one.index] else "no angle"
        canvas.text((left + _PANEL_PX / 2, top - 24), one.why, align="center")
        below = f"frame {one.index}, {angles.time_s[one.index]:.2f} s: {angle}"
        canvas.text((left + _PANEL_PX / 2, top - 8), below, align="center")
        _draw_frame(canvas.part((left, top, _PANEL_PX, tall)), lumas.get(one.index), one, result=result, view=view)
    top = 2 * _HEAD_PX + rows * (tall + _HEAD_PX) - 10.0
    _draw_angle(canvas, (70.0, top, wide - 90.0, _PLOT_PX), angles, shown)
    canvas.save(path)


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
    canvas: Canvas, luma: NDArray[np.uint8] | None, one: Shown, *, result: TrackResult, view: tuple[int, int, int, int]
) -> None:
    if luma is None:
        width, height = canvas.size_px
        canvas.text((width / 2, height / 2), "this frame cannot be decoded", align="center")
    else:
        frame = show_frame(canvas, luma, view_px=view)
        radius = float(result.report["markers"]["radius_px"])
        read = np.where(result.tracks.valid[one.index, :, None], result.tracks.position_px[one.index], np.nan)
        show_stick(frame, read[:2], colour=BASE_COLOUR, radius_px=radius)
        show_stick(frame, read[2:], colour=MOVING_COLOUR, radius_px=radius)
        if one.index == 0:
            _show_rivals(frame, result)
    canvas.frame_round()


def _show_rivals(frame: FrameView, result: TrackResult) -> None:
    """Draw the dots that may equally be the markers."""
    taken = result.report["markers"].get("taken", {})
    for rival in result.report["markers"].get("rivals", []):
        for stick in ("base", "moving"):
            if rival[stick] != taken[stick]:
                show_named(frame, np.array(rival[stick]), [f"or {stick}"] * 2, [GIVEN_COLOUR] * 2)


def _draw_angle(canvas: Canvas, box_px: Box, angles: StickAngles, shown: list[Shown]) -> None:
    """Draw the angle over time, its 95 % interval, the gaps as bands, and the times of the frames above."""
    left, top, width, height = (round(value) for value in box_px)
    plot = canvas.part(box_px)
    time_s, angle_deg = angles.time_s, np.where(angles.valid, angles.angle_rad, np.nan) / DEG
    band = REACH * angles.sigma_rad / DEG
    reach = np.concatenate([angle_deg - band, angle_deg + band])
    low, high = _limits(reach[np.isfinite(reach)], margin=0.05)
    begin_s, end_s = _limits(time_s, margin=0.01)

    def at(times: Floats, degrees: Floats) -> Floats:
        across = (times - begin_s) / (end_s - begin_s) * (width - 1)
        return np.column_stack([across, (high - degrees) / (high - low) * (height - 1)])

    times, degrees = round_numbers(begin_s, end_s, most=12), round_numbers(low, high, most=7)
    across = zip(at(times, np.full(len(times), low))[:, 0], times, strict=True)
    up = zip(at(np.full(len(degrees), begin_s), degrees)[:, 1], degrees, strict=True)
    draw_grid(canvas, plot, box_px, across, up, colour=_GRID)
    upper, lower = at(time_s, angle_deg + band), at(time_s, angle_deg - band)
    known = [slice(begin, end) for begin, end in runs(np.isfinite(angle_deg + band))]
    plot.tint([np.concatenate([upper[some], lower[some][::-1]]) for some in known], _ANGLE, 0.25)
    plot.line(at(time_s, angle_deg), _ANGLE)
    step = usual_step(time_s) or 1.0
    gaps = [(time_s[begin] - 0.5 * step, time_s[end - 1] + 0.5 * step) for begin, end in runs(~angles.valid)]
    edges = np.array([high, high, low, low])
    plot.tint([at(np.array([begin, end, end, begin]), edges) for begin, end in gaps], _GAP, 0.3)
    for one in shown:
        x = float(at(time_s[[one.index]], np.array([low]))[0, 0])
        plot.dashes(x, dash_px=5 if one is shown[-1] else 2)
    plot.frame_round()
    _write_legend(canvas, (left + width, top - 8), gaps=int((~angles.valid).sum()))
    below = "time (s); dotted: the frames above, dashed: the worst one"
    canvas.text((left + width / 2, top + height + 36), below, align="center")
    canvas.text_upwards((left - 54, top + height / 2), "angle (°)")


def _write_legend(canvas: Canvas, end_px: tuple[int, int], *, gaps: int) -> None:
    """Write the legend of the line and the bands, right-aligned at a position."""
    words = [("angle, with its 95 % interval", _ANGLE)]
    if gaps:
        words.append((f"no angle ({counted(gaps, 'frame')})", _GAP))
    x, y = end_px
    for text, colour in reversed(words):
        canvas.text((x, y), text, align="right")
        x -= canvas.width_of(text) + 8
        canvas.line(np.array([[x - 24.0, y - 4.0], [x, y - 4.0]]), colour, width_px=2)
        x -= 44


def _limits(values: Floats, *, margin: float) -> tuple[float, float]:
    """Return the range of values with a margin, a share of the range, at either side; never an empty range."""
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 0.5
    return low - room, high + room
