"""What the blind suite counts an effect as showing."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest
from linear_cases import machine, signals

from tests.scripts import script


@pytest.fixture(scope="module")
def shown() -> ModuleType:
    return script("benchmarks/discovery/shown.py")


def test_an_effect_shows_by_what_the_others_cannot_imitate(shown: ModuleType) -> None:
    s = signals()
    found = shown.shown(machine(0.3 * np.sign(s["speed"]) + 0.06 * (s["warm"] - 20.0), seed=5), ("coulomb", "warmth"))
    fitted = np.column_stack([s["speed"], s["one"]])
    for name, column, other in (
        ("coulomb", 0.3 * np.sign(s["speed"]), s["warm"]),
        ("warmth", 0.06 * (s["warm"] - 20.0), np.sign(s["speed"])),
    ):
        columns = np.column_stack([fitted, other])
        left = column - columns @ np.linalg.lstsq(columns, column)[0]
        # Unseen blocks are missed by a little more than those in the fit: four values from eight blocks.
        assert found[name] == pytest.approx(np.sqrt(np.mean(left**2)), rel=0.15)


def test_what_the_model_takes_up_does_not_show(shown: ModuleType) -> None:
    s = signals()
    candidates = {"coulomb": {"coulomb_n": np.sign(s["speed"])}, "more": {"more_n": s["speed"]}}
    problem = machine(0.3 * np.sign(s["speed"]) + 0.5 * s["speed"], seed=5, candidates=candidates)
    found = shown.shown(problem, ("coulomb", "more"))
    assert found["coulomb"] > 0.1
    assert found["more"] < 0.01
