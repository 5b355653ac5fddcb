"""The plots: round ticks, thinning that keeps what matters, nothing outside the picture, no legend over the data."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torsight.report.svg import Axis, Plot, path_data, thin_path, thin_points, thin_series, tick_texts

SVG = "{http://www.w3.org/2000/svg}"


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e5), st.integers(3, 12))
def test_ticks_are_round_evenly_spaced_and_inside(low: float, span: float, ticks: int) -> None:
    positions = Axis("x", low, low + span, ticks).positions()
    assert 1 <= len(positions) <= ticks + 1
    assert all(low - 1e-6 * span <= value <= low + span * (1 + 1e-6) for value in positions)
    if len(positions) > 1:
        step = positions[1] - positions[0]
        mantissa = step / 10.0 ** math.floor(math.log10(step * 1.0000001))
        assert min(abs(mantissa - round_one) for round_one in (1.0, 2.0, 5.0, 10.0)) < 1e-3


def test_tick_texts_have_the_decimals_that_their_step_needs() -> None:
    assert tick_texts([-0.5, 0.0, 0.5]) == ["−0.5", "0.0", "0.5"]
    assert tick_texts([0.0, 20.0, 40.0]) == ["0", "20", "40"]


def test_thinning_a_series_keeps_every_bins_lowest_and_highest_value_and_its_gaps() -> None:
    random = np.random.default_rng(5)
    x = np.arange(50_000.0)
    y = random.normal(size=len(x))
    y[[777, 31_000]] = 40.0, -40.0
    y[20_000:21_000] = np.nan
    thin_x, thin_y = thin_series(x, y, bins=300)
    assert len(thin_x) <= 3 * 300 + 2
    assert {40.0, -40.0} <= set(thin_y.tolist())
    for part in np.array_split(np.arange(len(x)), 300):
        known = y[part][np.isfinite(y[part])]
        if len(known):
            assert np.isin([known.min(), known.max()], thin_y).all()
    inside = (thin_x >= 20_000) & (thin_x < 21_000)
    assert inside.any()
    assert np.isnan(thin_y[inside]).all()


def test_thinning_a_path_leaves_no_point_further_away_than_the_limit() -> None:
    turn = np.linspace(0.0, 12.0, 5_000)
    x, y = 100.0 * np.cos(turn), 80.0 * np.sin(turn)
    kept_x, kept_y = thin_path(x, y, least_px=1.0)
    assert len(kept_x) < len(x) / 2
    gaps = np.hypot(x[:, None] - kept_x[None, :], y[:, None] - kept_y[None, :]).min(axis=1)
    assert gaps.max() <= math.sqrt(2.0) * 1.0 + 1e-9


def test_thinning_points_keeps_one_of_every_spot() -> None:
    random = np.random.default_rng(6)
    x, y = random.uniform(0, 30, 9_000), random.uniform(0, 30, 9_000)
    kept_x, kept_y = thin_points(x, y, spot_px=3.0, most=10_000)
    spots = {tuple(spot) for spot in np.round(np.column_stack([x, y]) / 3.0).astype(int).tolist()}
    kept = [tuple(spot) for spot in np.round(np.column_stack([kept_x, kept_y]) / 3.0).astype(int).tolist()]
    assert set(kept) == spots
    assert len(kept) == len(spots)


def test_a_gap_lifts_the_pen() -> None:
    assert path_data(np.array([0.0, 1, 2, 3]), np.array([0.0, np.nan, 2, 3])) == "M0.0 0.0M2.0 2.0L3.0 3.0"


@pytest.mark.parametrize("legend", [1, 2])
def test_everything_lies_inside_and_the_legend_above_the_data(legend: int) -> None:
    plot = Plot(Axis("time (s)", 0.0, 7200.0), Axis("angle (°)", -250.0, 250.0), "t", legend_rows=legend)
    time_s = np.linspace(0.0, 7200.0, 500)
    plot.band(100.0, 900.0, "held", label="half-cycle that the fit did not see")
    plot.line(time_s, 240.0 * np.sin(time_s / 300.0), "measured", label="measured")
    plot.points(time_s, 240.0 * np.cos(time_s / 300.0), "before", label="plain model")
    root = ET.fromstring(plot.render())  # noqa: S314 - our own text
    width, height = plot.width, plot.height
    for text in root.iter(f"{SVG}text"):
        if text.get("transform"):
            continue
        x, y, long = float(text.get("x", "0")), float(text.get("y", "0")), 7.0 * len(text.text or "")
        left = {"end": x - long, "middle": x - long / 2}.get(text.get("text-anchor", "start"), x)
        assert left >= 0.0
        assert left + long <= width + 1.0
        assert 8.0 <= y <= height
    for mark in root.iter(f"{SVG}path"):
        kind = mark.get("class", "")
        numbers = [float(word) for word in re.findall(r"-?\d+\.\d", mark.get("d", ""))]
        if "key" in kind:
            assert max(numbers[1::2]) < plot.top
        elif kind.startswith(("line", "points")):
            assert min(numbers[1::2]) >= plot.top - 0.1
            assert max(numbers[1::2]) <= plot.bottom + 0.1
