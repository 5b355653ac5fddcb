"""What the blind suite counts an effect as showing: on a linear rig, against least squares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import ModuleType

import numpy as np
import pytest

from tests.scripts import script


@pytest.fixture(scope="module")
def shown() -> ModuleType:
    return script("benchmarks/discovery/shown.py")


PLACE = np.linspace(0.0, 1.0, 2000)
VALUE = 5.0 * PLACE  # what one unit of the only value does
WAVES = [4.0 * PLACE + 0.5 * np.sin(40.0 * PLACE), 2.0 * np.sin(40.0 * PLACE) + np.cos(25.0 * PLACE)]


def angle_deg(off: Mapping[str, float], times: Sequence[float]) -> np.ndarray:
    return 30.0 + off.get("value", 0.0) * VALUE + sum(by * wave for by, wave in zip(times, WAVES, strict=True))


def left(column: np.ndarray, others: Sequence[np.ndarray]) -> float:
    design = np.column_stack(others)
    return float(np.sqrt(np.mean((column - design @ np.linalg.lstsq(design, column)[0]) ** 2)))


def test_a_piece_shows_by_what_values_and_the_other_piece_cannot_imitate(shown: ModuleType) -> None:
    found = shown.shown(angle_deg, {"value": 100.0}, 2)
    expected = [left(WAVES[i], [np.ones_like(PLACE), VALUE, WAVES[1 - i]]) for i in range(2)]
    # A strength is free within once itself: of 2000 rows of 2° that leaves 1 / 1000 of it.
    assert found == pytest.approx(expected, rel=0.01)


def test_a_value_that_is_known_well_imitates_nothing(shown: ModuleType) -> None:
    known, free = (shown.shown(angle_deg, {"value": sigma}, 2)[0] for sigma in (1e-4, 100.0))
    assert known > 2.0 * free
