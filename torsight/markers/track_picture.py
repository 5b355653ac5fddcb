"""``track.png``: frames of the film with the tracked markers drawn on them, and the angle with its gaps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from torsight.core.parameter import REACH
from torsight.core.series import runs, usual_step
from torsight.core.tracks import StickAngles
from torsight.core.units import DEG, Floats
from torsight.core.words.colours import BASE_COLOUR, GIVEN_COLOUR, LIGHT, MOVING_COLOUR, rgb
from torsight.core.words.wording import counted
from torsight.markers.sheet import BLACK, MARGIN_PX, RING_PX, Sheet, ticks
from tracker.rows import STATES

if TYPE_CHECKING:
    from tracker.frames.source import Source
    from tracker.track import TrackResult

_GRID: Final = (225, 225, 225)


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
    # Three panels of frames side by side, and the plot of the angle below them.
    panel, plot = 420, 260
    tall = round(min(panel, panel * (view[3] - view[1]) / (view[2] - view[0])))
    rows = (len(shown) + 2) // 3
    wide, high = 3 * panel + 40, MARGIN_PX + rows * (tall + MARGIN_PX) + plot + 90
    sheet = Sheet(wide, high)
    known = f"{int(angles.valid.sum())} of {counted(len(angles), 'frame')} have an angle"
    sheet.text(f"{Path(source.name).name}: {known}", 12, 26, size=17, bold=True)
    lumas = source.pictures([one.index for one in shown])
    for number, one in enumerate(shown):
        row, column = divmod(number, 3)
        left, top = 10 + column * (panel + 10), 2 * MARGIN_PX + row * (tall + MARGIN_PX)
        angle = f"{angles.angle_rad[one.index] / DEG:.2f}°" if angles.valid[one.index] else "no angle"
        sheet.text(one.why, left, top - 21)
        sheet.text(f"frame {one.index}, {angles.time_s[one.index]:.2f} s: {angle}", left, top - 5)
        _draw_frame(sheet, lumas.get(one.index), one, result=result, view=view, place=(left, top, panel, tall))
    top = 2 * MARGIN_PX + rows * (tall + MARGIN_PX) - 10
    _draw_angle(sheet, angles, shown, place=(80, top, wide - 100, plot))
    sheet.write(path)


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
        shown.append(Shown(index, f"{25 * part} % of the film"))
    once = {one.index: one for one in [*reversed(shown), worst]}
    return [*sorted((one for one in once.values() if one is not worst), key=lambda one: one.index), worst]


def _evenly(count: int) -> list[int]:
    """Return the first of ``count`` frames and four more up to the last, evenly spaced."""
    return [round(part * (count - 1) / 4) for part in range(5)]


def _why(result: TrackResult, index: int) -> str:
    """Return the states of the markers that were not tracked in a frame, as words."""
    states = [STATES[code] for code in result.rows["state"][index].tolist()]
    bad = sorted({state for state in states if state != "seen"})
    return ", ".join(f"{states.count(state)} {state}" for state in bad) or "impossible length"


def _view(result: TrackResult) -> tuple[int, int, int, int]:
    """Return the part of the picture that holds all positions of all markers, with a margin.

    It is four wide to three high, where the picture is large enough; a part beyond its border is moved inside.
    """
    width, height = result.tracks.size_px
    rivals = [point for one in result.report["markers"].get("rivals", []) for point in (*one["base"], *one["moving"])]
    places = np.concatenate([result.tracks.position_px.reshape(-1, 2), np.reshape(rivals, (-1, 2))])
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return 0, 0, width, height
    low, high = places.min(axis=0), places.max(axis=0)
    room = max(0.15 * float((high - low).max()), 4.0 * float(result.report["markers"]["radius_px"]))
    wide, tall = (high - low + 2.0 * room).tolist()
    shape = 4.0 / 3.0
    wide, tall = min(max(wide, shape * tall), float(width)), min(max(tall, wide / shape), float(height))
    left = min(max(0, round(0.5 * (low[0] + high[0] - wide))), width - round(wide))
    top = min(max(0, round(0.5 * (low[1] + high[1] - tall))), height - round(tall))
    return left, top, left + round(wide), top + round(tall)


def _draw_frame(
    sheet: Sheet,
    luma: NDArray[np.uint8] | None,
    one: Shown,
    *,
    result: TrackResult,
    view: tuple[int, int, int, int],
    place: tuple[int, int, int, int],
) -> None:
    """Draw the part ``view`` of a frame at a place (left, top, width, height), and the markers as read."""
    left, top, width, height = place
    if luma is None:
        sheet.text("this frame cannot be decoded", left + 0.3 * width, top + 0.5 * height)
        return
    part = luma[view[1] : view[3], view[0] : view[2]]
    drawn = cv2.resize(part, (width, height), interpolation=cv2.INTER_LINEAR)
    sheet.pixels[top : top + height, left : left + width] = drawn[..., None]
    larger = np.array([width / part.shape[1], height / part.shape[0]])

    def at(points: Floats) -> Floats:
        # A pixel's centre lies half a pixel from its edge.
        return np.asarray((points + 0.5 - view[:2]) * larger - 0.5 + (left, top))

    radius = 1.6 * float(result.report["markers"]["radius_px"]) * float(larger[0])
    read = result.tracks.position_px[one.index]
    valid = result.tracks.valid[one.index]
    for first, colour in ((0, BASE_COLOUR), (2, MOVING_COLOUR)):
        stick = read[first : first + 2][valid[first : first + 2]]
        sheet.line(at(stick), colour)
        for marker in stick:
            sheet.ring(at(marker), radius, colour)
    if one.index == 0:
        # The dots that may equally be the markers.
        taken = result.report["markers"].get("taken", {})
        for rival in result.report["markers"].get("rivals", []):
            for name in ("base", "moving"):
                for other in at(np.array(rival[name])) if rival[name] != taken[name] else ():
                    sheet.ring(other, RING_PX, GIVEN_COLOUR)
                    sheet.text(f"or {name}", other[0] + 12.0, other[1] - 4.0)


def _bounds(values: Floats) -> tuple[float, float]:
    """Return bounds of the finite values, with a margin."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    room = 0.05 * (high - low) or 0.5
    return low - room, high + room


def _draw_angle(sheet: Sheet, angles: StickAngles, shown: list[Shown], *, place: tuple[int, int, int, int]) -> None:
    """Draw the angle over time, its 95 % interval, the gaps as bands, and the times of the frames above."""
    left, top, width, height = place
    angle_deg = np.where(angles.valid, angles.angle_rad, np.nan) / DEG
    band = REACH * angles.sigma_rad / DEG
    times = _bounds(angles.time_s)
    # A turn that is not certain would leave nothing else to see.
    narrow = np.where(angles.branch_certain, band, 0.0)
    values = _bounds(np.concatenate([angle_deg - narrow, angle_deg + narrow]))

    def at(time_s: Floats, value: Floats) -> Floats:
        x = left + width * (np.asarray(time_s) - times[0]) / (times[1] - times[0])
        y = top + height * (values[1] - np.clip(value, *values)) / (values[1] - values[0])
        return np.column_stack([x, y])

    for number in ticks(*times):
        ends = at(np.full(2, number), np.array(values))
        sheet.line(ends, _GRID)
        sheet.text(f"{number:g}", ends[0, 0] - 8, top + height + 18)
    for number in ticks(*values):
        ends = at(np.array(times), np.full(2, number))
        sheet.line(ends, _GRID)
        sheet.text(f"{number:g}°", left - 6, ends[0, 1] + 5, right=True)
    half, colour, gone = 0.5 * (usual_step(angles.time_s) or 1.0), rgb(LIGHT["after"]), rgb(LIGHT["before"])
    for begin, end in runs(~angles.valid):
        first_s, last_s = angles.time_s[begin] - half, angles.time_s[end - 1] + half
        sheet.tint(at(np.array([first_s, first_s, last_s, last_s]), np.array([*values, *values[::-1]])), gone, 0.3)
    for begin, end in runs(angles.valid):
        part = np.s_[begin:end]
        low, high = (at(angles.time_s[part], angle_deg[part] + sign * band[part]) for sign in (-1.0, 1.0))
        sheet.tint(np.concatenate([low, high[::-1]]), colour, 0.25)
        sheet.line(at(angles.time_s[part], angle_deg[part]), colour)
    for one in shown:
        x = float(at(angles.time_s[[one.index]], np.array([values[0]]))[0, 0])
        sheet.dashed(x, top, top + height, dash=6 if one is shown[-1] else 2)
    sheet.line(np.array([[left, top], [left, top + height], [left + width, top + height]], float), BLACK)
    lost = int((~angles.valid).sum())
    gaps = f"; shaded: no angle ({counted(lost, 'frame')})" if lost else ""
    sheet.text(f"angle, with its 95 % interval{gaps}", left + 8, top - 6)
    sheet.text("time (s); dotted: the frames above, dashed: the worst one", left + 0.33 * width, top + height + 40)
