"""``MARKERS.toml``: where the markers are in the first frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.config import get_number, get_text
from torsight.core.errors import ConfigError
from torsight.core.frozen import Frozen
from torsight.core.paths import AnyPath
from torsight.core.storage import check_keys, read_toml
from torsight.core.tracks import MARKERS

_KEYS: Final = ("base", "moving", "kind", "base_mm", "moving_mm")
KINDS: Final = ("dot", "texture")
APART_PX: Final = 2.0
"""Two positions nearer than this are one place."""


@dataclass(frozen=True, slots=True, eq=False)
class MarkerHints(Frozen):
    """Marker positions given by a person.

    Attributes
    ----------
    position_px : (4, 2) float64
        Order of :data:`torsight.core.tracks.MARKERS`; pixels of the first frame.
    kind : str
        ``"dot"`` or ``"texture"``.
    where : str
        File or table that they come from, for messages.
    length_mm : mapping of str to float
        Distance of the markers of ``base`` and ``moving``, where it was measured by hand: a check of scale.
    """

    position_px: NDArray[np.float64]
    kind: str
    where: str
    length_mm: Mapping[str, float] = field(default_factory=dict)

    def check_inside(self, size_px: tuple[int, int]) -> None:
        """Refuse markers outside the picture.

        Raises
        ------
        ConfigError
            Naming the marker and the size of the picture.
        """
        width, height = size_px
        for name, (x, y) in zip(MARKERS, self.position_px.tolist(), strict=True):
            if not (0 <= x <= width - 1 and 0 <= y <= height - 1):
                raise ConfigError(
                    "lies outside the picture",
                    where=f"{self.where}, {name.replace('_', ', ')} marker",
                    value=f"[{x:g}, {y:g}]",
                    limit=f"0 to {width - 1} and 0 to {height - 1}",
                    do="give pixel positions in the first frame, x to the right, y down",
                )


def read_markers(source: AnyPath | Mapping[str, Any]) -> MarkerHints:
    """Read marker positions from a file or from a table that was read already.

    Raises
    ------
    ConfigError
        For an unknown or missing key, or a value that is no pair of positions.
    InputError
        When the file cannot be read.
    """
    content: Mapping[str, Any]
    if not isinstance(source, Mapping):
        content, where = read_toml(Path(source)), str(source)
        # The table may stand in the file under its own name, as it does in an experiment.
        if set(content) == {"markers"} and isinstance(content["markers"], Mapping):
            content = content["markers"]
    else:
        content, where = source, "[markers]"
    check_keys(content, _KEYS, where=where)
    kind = get_text(content, "kind", where=where, default="dot", choices=KINDS)
    position_px = np.array([*_pair(content, "base", where), *_pair(content, "moving", where)])
    for one in range(4):
        for two in range(one):
            if np.hypot(*(position_px[one] - position_px[two])) < APART_PX:
                raise ConfigError(
                    "two markers are at one place",
                    where=where,
                    value=f"{MARKERS[two]} and {MARKERS[one]} at {position_px[one].tolist()}",
                    limit="four different positions",
                )
    length_mm = {
        stick: get_number(content, f"{stick}_mm", where=where, lower=1e-3)
        for stick in ("base", "moving")
        if f"{stick}_mm" in content
    }
    return MarkerHints(position_px=position_px, kind=kind, where=where, length_mm=length_mm)


def _pair(content: Mapping[str, Any], key: str, where: str) -> list[list[float]]:
    value = content.get(key)
    shape_ok = (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(point, list) and len(point) == 2 for point in value)
    )
    if not shape_ok or value is None:
        raise ConfigError(
            f"'{key}' is not two positions",
            where=where,
            value=repr(value),
            limit=f"{key} = [[x, y], [x, y]], inner marker first",
        )
    return [[get_number({key: number}, key, where=where) for number in point] for point in value]
