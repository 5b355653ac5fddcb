"""Findings say where a larger set predicts held-out blocks better, and where the answer predicts them no better."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from torsight.discovery import candidate, find_missing, linear_problem, model_problem, parameter

Array = np.ndarray
ROWS, PER_BLOCK, NOISE = 72, 12, 0.3


def unseen(columns: list[Array], y: Array, block: Array) -> float:
    """Return the root mean square of what least squares miss of blocks that were left out (NumPy's own)."""
    made, missed = np.column_stack(columns), np.empty(len(y))
    for one in np.unique(block):
        out = block == one
        missed[out] = y[out] - made[out] @ np.linalg.lstsq(made[~out], y[~out])[0]
    return float(np.sqrt(np.mean(missed**2)))


@pytest.mark.parametrize(
    ("seed", "larger_is_better"), [(0, True), (1, True), (2, True), (7, True), (5, False), (6, False)]
)
def test_a_larger_set_that_predicts_better_is_told_and_no_other(seed: int, *, larger_is_better: bool) -> None:
    """A small effect beside a large one: in six short blocks it predicts, but is too little to be sure of."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, ROWS)
    u, w = rng.uniform(-1.0, 1.0, (2, ROWS))
    y = 2.0 * u + u**2 + 0.2 * w + rng.normal(0.0, NOISE, ROWS)
    base, block = {"gain": u, "offset": np.ones(ROWS)}, np.arange(ROWS) // PER_BLOCK
    offered = {"bow": {"bow": u**2}, "side": {"side": w}}
    found = find_missing(linear_problem(y, base, offered, time_s=t, block=block, drivers={}, sigma=NOISE))
    answer = [*base.values(), u**2]
    own, larger = unseen(answer, y, block), unseen([*answer, w], y, block)
    assert found.effects == ("bow",)
    assert (larger < 0.95 * own) is larger_is_better
    assert [one.effects for one in found.predicts_better] == [("bow", "side")] * larger_is_better
    assert ("bow + side predicts held-out blocks better" in str(found)) is larger_is_better
    assert found.to_json()["predicts_better"] == [["bow", "side"]] * larger_is_better
    both = next(one for one in found.best_fits if one.effects == ("bow", "side"))
    assert both.rmse_held_out == pytest.approx(larger, rel=0.01)


@pytest.mark.parametrize(("per_s", "predicted"), [(0.9, False), (0.5, True)])
def test_a_law_over_time_that_predicts_no_block_is_told(per_s: float, *, predicted: bool) -> None:
    """A wave over time has to be continued over each block that is left out: of a quick one that is lost."""
    rng = np.random.default_rng(1)
    t, u = 0.1 * np.arange(400), np.repeat(rng.uniform(-1.0, 1.0, 20), 20)
    y = 2.0 * u + 0.3 * np.sin(per_s * t) + rng.normal(0.0, 0.05, 400)

    def predict(p: Any, record: Any) -> Array:
        return np.asarray(p.gain * record.u + p.offset)

    table = {"time_s": t, "u": u, "y": y}
    found = find_missing(model_problem(predict, table, [parameter("gain", 1.0), parameter("offset", 0.0)], output="y"))
    before, after = found.errors["y"]
    assert found.verdict == "unknown"
    assert found.decision.chosen.members == ("y(time_s)",)
    assert (after.rmse_held_out < before.rmse_held_out) is predicted
    assert ("predicts held-out blocks no better" in str(found)) is not predicted


def test_a_law_over_time_beside_a_name_is_told_and_that_it_predicts_nothing() -> None:
    """A bow, and a wave over time that no block predicts: both are there, and without the wave less is missed."""
    rng = np.random.default_rng(1)
    t, u = 0.1 * np.arange(400), np.repeat(rng.uniform(-1.0, 1.0, 20), 20)
    y = 2.0 * u + 1.2 * u**2 + 0.3 * np.sin(0.9 * t) + rng.normal(0.0, 0.05, 400)

    def predict(p: Any, record: Any) -> Array:
        return np.asarray(p.gain * record.u + p.offset + p.bow * record.u**2)

    free, bow = [parameter("gain", 1.0), parameter("offset", 0.0)], candidate("bow", parameter("bow", 0.1, null=0.0))
    found = find_missing(model_problem(predict, {"time_s": t, "u": u, "y": y}, free, bow, output="y", drivers=[]))
    assert found.effects == ("bow",)
    found = find_missing(
        model_problem(predict, {"time_s": t, "u": u, "y": y}, free, bow, output="y", drivers=["time_s"])
    )
    assert (found.verdict, found.decision.chosen.members) == ("unknown", ("bow", "y(time_s)"))
    assert abs(found.values["bow"] - 1.2) < 0.06
    assert "y(time_s) describes what was recorded, but held-out blocks are predicted no better with it" in str(found)
    assert [law["share"] for law in found.to_json()["laws"]] == [1.0]
