"""Printing of a pair of tags, one for each stick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import cv2

from calibration.boards.board_file import dictionary_of
from calibration.boards.printing import LAYOUT, PAGES_MM, Drawing, Rectangle, Text, check_bar, draw_tag
from torsight.core.errors import ConfigError

_STICKS: Final = ("base", "moving")


@dataclass(frozen=True, slots=True)
class TagPair:
    """The sticks' tags: OpenCV's family without ``DICT_``, numbers of base and moving tag, side of the black square."""

    family: str
    ids: tuple[int, int]
    side_mm: float

    def content(self) -> dict[str, Any]:
        """Return the tags as keys of ``MARKERS.toml``."""
        base, moving = self.ids
        return {
            "kind": "tag",
            "family": self.family,
            "base_id": base,
            "moving_id": moving,
            "base_mm": self.side_mm,
            "moving_mm": self.side_mm,
        }


def tag_pair(family: str, *, base_id: int, moving_id: int, side_mm: float) -> TagPair:
    """Return a pair of tags; a family or a number that does not exist is refused."""
    name = f"DICT_{family.removeprefix('DICT_')}"
    if not isinstance(getattr(cv2.aruco, name, None), int):
        usual = "4X4_50, 5X5_50, 6X6_50, APRILTAG_16h5, APRILTAG_25h9, APRILTAG_36h11"
        raise ConfigError("is no family of tags", where="--family", value=family, limit=f"one of OpenCV's, as {usual}")
    count = len(dictionary_of(name).bytesList)
    for option, number in (("--base-id", base_id), ("--moving-id", moving_id)):
        if not 0 <= number < count:
            raise ConfigError("is no tag of this family", where=option, value=number, limit=f"0 to {count - 1}")
    if base_id == moving_id:
        raise ConfigError(
            "both sticks would have the tag of one number",
            where="--base-id and --moving-id",
            value=base_id,
            limit="two different numbers",
        )
    return TagPair(name.removeprefix("DICT_"), (base_id, moving_id), side_mm)


def draw_tags(pair: TagPair, *, page: str = "a4") -> Drawing:
    """Return both tags beside each other on a page, with ticks to cut along and a bar to check the scale."""
    width_mm, height_mm = PAGES_MM[page]
    border_mm = LAYOUT.tag_border * pair.side_mm / (dictionary_of(f"DICT_{pair.family}").markerSize + 2)
    whole_mm = pair.side_mm + 2.0 * border_mm
    room_mm = (
        0.5 * width_mm - LAYOUT.margin_mm - 2.0 * LAYOUT.tick_mm,
        height_mm - 2.0 * LAYOUT.margin_mm - 4.0 * LAYOUT.line_mm,
    )
    if whole_mm > min(room_mm):
        raise ConfigError(
            f"the tags do not fit on a page {page}",
            where="--side-mm",
            value=f"{pair.side_mm:g}, {whole_mm:.0f} mm with the white border",
            limit=f"{min(room_mm) * pair.side_mm / whole_mm:.0f}",
            do="take smaller tags or a larger --page",
        )
    shapes: list[Rectangle] = []
    words: list[Text] = []
    top = LAYOUT.margin_mm + 2.0 * LAYOUT.tick_mm
    for place, (stick, number) in enumerate(zip(_STICKS, pair.ids, strict=True)):
        left = LAYOUT.margin_mm + LAYOUT.tick_mm + place * 0.5 * width_mm
        shapes += draw_tag(f"DICT_{pair.family}", number, left + border_mm, top + border_mm, side_mm=pair.side_mm)
        shapes += _ticks(left, top, whole_mm)
        below = top + whole_mm + LAYOUT.tick_mm + LAYOUT.line_mm
        words.append(Text(left, below, f"{stick} stick: {pair.family}, number {number}"))
        words.append(Text(left, below + LAYOUT.line_mm, "left edge towards the axis, top edge along the stick"))
    bar, label = check_bar(page)
    foot = Text(LAYOUT.margin_mm, height_mm - LAYOUT.margin_mm, f"black squares of {pair.side_mm:g} mm; print at 100 %")
    return Drawing((width_mm, height_mm), (*shapes, bar), (*words, foot, label))


def _ticks(left_mm: float, top_mm: float, whole_mm: float) -> list[Rectangle]:
    """Return short lines outside the corners of the white border."""
    found: list[Rectangle] = []
    for x in (left_mm, left_mm + whole_mm):
        for y in (top_mm, top_mm + whole_mm):
            out_x = x - LAYOUT.tick_mm if x == left_mm else x
            out_y = y - LAYOUT.tick_mm if y == top_mm else y
            found.append(Rectangle(out_x, y - 0.5 * LAYOUT.tick_width_mm, LAYOUT.tick_mm, LAYOUT.tick_width_mm))
            found.append(Rectangle(x - 0.5 * LAYOUT.tick_width_mm, out_y, LAYOUT.tick_width_mm, LAYOUT.tick_mm))
    return found
