"""Four picked markers: from the page's requests to ``markers.toml``, checked by the tracker's own rules."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import ConfigError, InputError, NoResultError
from torsight.core.files.storage import read_toml, write_text
from torsight.core.tracks import MARKERS
from tracker.detect.marker_file import APART_PX, KINDS, STICKS, MarkerHints, read_markers

if TYPE_CHECKING:
    from tracker.frames.frame import FrameSource

PICKED: Final = tuple(kind for kind in KINDS if kind != "tag")
"""Kinds of markers that are given by position; a tag is found by its number."""
SNAPS: Final = "dot"
"""The kind of marker whose position is the centre of a dot; other kinds are followed where they were picked."""


def place(
    luma: NDArray[np.uint8], x_px: float, y_px: float, *, kind: str, others: Mapping[str, tuple[float, float]]
) -> dict[str, float | None]:
    """Return ``x``, ``y`` and ``radius`` of a pick in the first frame (h, w), px: of the nearest dot, or as picked.

    Only markers of the ``kind`` dot are moved to a centre; the radius is None for a point without a dot. ``others`` are
    the earlier picks, by the markers' names.
    """
    from tracker.detect.dots import dot_near
    from tracker.detect.given_positions import SNAP_PX

    height, width = luma.shape
    where = f"[{x_px:.1f}, {y_px:.1f}]"
    if not (0.0 <= x_px <= width - 1 and 0.0 <= y_px <= height - 1):
        raise ConfigError(
            "this point lies outside the picture",
            value=where,
            limit=f"0 to {width - 1} and 0 to {height - 1}",
            do="pick a point in the picture",
        )
    radius_px = None
    if kind == SNAPS:
        dot = dot_near(luma, x_px, y_px, reach_px=SNAP_PX)
        if dot is None:
            raise NoResultError(
                "there is no round dot next to this point",
                value=where,
                limit=f"a dot within {SNAP_PX:g} px",
                do="pick its middle, or choose another kind of marker for this stick",
            )
        x_px, y_px, radius_px = dot.x_px, dot.y_px, dot.radius_px
    apart_px = max(APART_PX, 0.5 * (radius_px or 0.0))
    for name, (x, y) in others.items():
        if math.hypot(x_px - x, y_px - y) < apart_px:
            raise ConfigError(
                f"this is the point of the {name.replace('_', ' ')} marker",
                value=where,
                limit="four different points",
                do="pick another one",
            )
    return {"x": x_px, "y": y_px, "radius": radius_px}


def content_of(picks: Mapping[str, Any], kept: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``markers.toml`` from the page's request.

    The request holds ``points``, a pair of numbers by the name of each marker, and ``kind`` by the name of each stick;
    the measured lengths of ``kept``, the content of the replaced file, are kept.
    """
    points, kind = picks.get("points"), picks.get("kind")
    points = points if isinstance(points, Mapping) else {}
    kind = kind if isinstance(kind, Mapping) else {}
    missing = [name.replace("_", " ") for name in MARKERS if not points.get(name)]
    if missing:
        raise ConfigError("not all markers have a position", value=f"none for {', '.join(missing)}", do="pick them")
    kinds = {stick: kind.get(stick, SNAPS) for stick in STICKS}
    same = kinds["base"] == kinds["moving"]
    content: dict[str, Any] = {
        **{stick: [_pair(points[f"{stick}_{end}"]) for end in ("inner", "outer")] for stick in STICKS},
        "kind": kinds["base"] if same else kinds,
        **lengths_of(kept),
    }
    read_markers(content)
    return content


def lengths_of(kept: Mapping[str, Any], *, kind: str | None = None) -> dict[str, Any]:
    """Return the measured lengths in a marker file, of markers of one ``kind`` where this is given."""
    if kind is not None and kept.get("kind", SNAPS) != kind:
        return {}
    return {key: kept[key] for key in (f"{stick}_mm" for stick in STICKS) if key in kept}


def _pair(value: Any) -> Any:
    """Return a position rounded to hundredths of a pixel; anything else unchanged, for the tracker to refuse."""
    if isinstance(value, Sequence) and all(isinstance(number, (int, float)) for number in value):
        return [round(float(number), 2) for number in value]
    return value


def hints_of(content: Mapping[str, Any], source: FrameSource) -> MarkerHints:
    """Return the markers in the tracker's form, refusing those from which it cannot start.

    Raises ConfigError or NoResultError as ``torsight track`` would.
    """
    from tracker.initialise import find_start

    hints = read_markers(content)
    find_start(source, hints)
    return hints


def write_markers(path: Path, content: Mapping[str, Any], *, film: str, size_px: tuple[int, int]) -> None:
    """Write ``markers.toml``."""
    import tomli_w

    head = f"# Markers in the first frame of {' '.join(film.split())} ({size_px[0]} × {size_px[1]} px)"
    head += ": x to the right, y down, inner marker first.\n" if STICKS[0] in content else ".\n"
    # One line per stick, as in the documentation; the library would write one line per number.
    sticks = "".join(f"{stick} = {json.dumps(content[stick])}\n" for stick in STICKS if stick in content)
    write_text(path, head + sticks + tomli_w.dumps({key: content[key] for key in content if key not in STICKS}))


def read_earlier(path: Path) -> tuple[dict[str, Any], str]:
    """Return the content of an existing marker file, and a message where the file cannot be used."""
    if not path.exists():
        return {}, ""
    try:
        content = read_toml(path, kind="markers")
        # The file may hold the keys in a table [markers], as an experiment does.
        content = dict(content["markers"]) if set(content) == {"markers"} else content
        read_markers(content)
    except (ConfigError, InputError) as error:
        return {}, f"{path} is there already and cannot be used ({error}); saving replaces it"
    return content, f"the positions of {path} are shown; saving replaces it"
