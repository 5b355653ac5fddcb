"""Events are found where other values of the model have taken up a part of the step."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.discovery.event_scan import EventScan
from torsight.discovery.weight import Weight

TIME_S = np.linspace(0.0, 1000.0, 1001)
SIGMA = 0.1


def scan(event: np.ndarray, columns: np.ndarray) -> EventScan:
    """Return a scan beside a linear model that was fitted to an event and to noise."""
    measured = event + SIGMA * np.random.default_rng(4).standard_normal(len(TIME_S))
    weight = Weight.of(np.full(len(TIME_S), SIGMA**-2))
    normal = weight.normal(columns)
    prediction = columns @ np.linalg.solve(normal, columns.T @ weight.times(measured))
    residual = measured - prediction

    def predict(events: list[tuple[float, float]]) -> list[np.ndarray]:
        # What steps up takes longer than what steps down.
        return [prediction + size * np.heaviside(TIME_S - at - 30.0 * (size > 0.0), 0.0) for at, size in events]

    return EventScan(predict, prediction, residual, columns, normal, columns.T @ weight.times(residual), weight)


@pytest.mark.parametrize(("size", "seen_s"), [(0.4, 637.0), (-0.4, 667.0)])
def test_an_event_is_found_that_the_other_values_have_taken_up(size: float, seen_s: float) -> None:
    columns = np.vander(TIME_S / 1000.0, 6)
    best = scan(size * (TIME_S > 667.0), columns).events(0.0, 1000.0, size=1.0, closest=1.0)[0]
    assert best.at == pytest.approx(seen_s, abs=2.0)
    # √(1 / h): the columns leave a quarter of 333 rows' information about a step.
    assert best.size == pytest.approx(size, abs=3.0 * SIGMA / np.sqrt(80.0))
    assert best.gain > 100.0


def test_what_the_other_values_do_themselves_is_no_event() -> None:
    step = (TIME_S > 500.0).astype(float)
    found = scan(step, np.column_stack([step, np.ones_like(step)])).events(0.0, 1000.0, size=1.0, closest=1.0)
    # Noise alone gains about as many units as there are times to choose from, in logarithms.
    assert all(event.gain < 2.0 * np.log(1e3) for event in found)
