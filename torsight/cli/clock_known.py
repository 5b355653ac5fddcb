"""How well a merged record's clocks are known, from the ``sync.json`` beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from torsight.core.errors import InputError
from torsight.core.files.storage import read_json
from torsight.core.parameter import REACH
from torsight.core.records import GIVEN_OFFSET

_LEAST_S: Final = 0.05
"""An event that both recorders saw is read to a frame of one, 0.03 s at 30 per second, and a row of the other."""


def clock_sigma_s(merged: Path) -> float | None:
    """Return the standard deviation of the clocks' offset; None where nothing says how well they were put together.

    An offset that was given is a claim like any other.
    """
    path = merged.parent / "sync.json"
    if not path.is_file():
        return None
    content = read_json(path)
    if str(content.get("method", "")).startswith(GIVEN_OFFSET):
        return None
    try:
        low, high = (float(end) for end in content["offset_s"]["ci95"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            "'offset_s' has no interval", where=str(path), do="write it again with 'torsight sync', or take it away"
        ) from error
    return max((high - low) / (2.0 * REACH), _LEAST_S) if low <= high else None
