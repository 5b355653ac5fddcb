"""What plots draw: thinning that keeps what matters, one entry per name, the same in both libraries."""

from __future__ import annotations

import base64
import gzip
import json
import math
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from torsight.core.words.colours import DARK, LIGHT
from torsight.report.plots.interactive import drawing
from torsight.report.plots.panels import BINS, Axis, Panel, style_of, thin_path, thin_points, thin_series
from torsight.report.plots.still import still
from torsight.report.write import at_night

SVG = "{http://www.w3.org/2000/svg}"


def test_thinning_a_series_keeps_every_bins_lowest_and_highest_value_and_its_gaps() -> None:
    random = np.random.default_rng(5)
    x = np.arange(50_000.0)
    y = random.normal(size=len(x))
    y[[777, 31_000]] = 40.0, -40.0
    y[20_000:21_000] = np.nan
    thin_x, thin_y = thin_series(x, y)
    assert len(thin_x) <= 3 * BINS + 2
    assert {40.0, -40.0} <= set(thin_y.tolist())
    for part in np.array_split(np.arange(len(x)), BINS):
        known = y[part][np.isfinite(y[part])]
        if len(known):
            assert np.isin([known.min(), known.max()], thin_y).all()
    inside = (thin_x >= 20_000) & (thin_x < 21_000)
    assert inside.any()
    assert np.isnan(thin_y[inside]).all()


def test_thinning_a_path_leaves_no_point_further_away_than_the_limit_and_one_point_of_a_gap() -> None:
    turn = np.linspace(0.0, 12.0, 5_000)
    x, y = 100.0 * np.cos(turn), 80.0 * np.sin(turn)
    kept_x, kept_y = thin_path(x, y, least=(1.0, 1.0))
    assert len(kept_x) < len(x) / 2
    gaps = np.hypot(x[:, None] - kept_x[None, :], y[:, None] - kept_y[None, :]).min(axis=1)
    assert gaps.max() <= math.sqrt(2.0) * 1.0 + 1e-9
    y[1_000:2_000] = np.nan
    _, kept_y = thin_path(x, y, least=(1.0, 1.0))
    assert np.count_nonzero(np.isnan(kept_y)) == 1


def test_thinning_points_keeps_one_of_every_spot() -> None:
    random = np.random.default_rng(6)
    x, y = random.uniform(0, 30, 9_000), random.uniform(0, 30, 9_000)
    kept_x, kept_y = thin_points(x, y, spot=(3.0, 3.0))
    spots = {tuple(spot) for spot in np.round(np.column_stack([x, y]) / 3.0).astype(int).tolist()}
    kept = [tuple(spot) for spot in np.round(np.column_stack([kept_x, kept_y]) / 3.0).astype(int).tolist()]
    assert set(kept) == spots
    assert len(kept) == len(spots)


def test_every_colour_tells_its_meaning_and_has_one_for_the_night() -> None:
    assert len(set(LIGHT.values())) == len(LIGHT)
    assert at_night()[style_of("before mean").colour] == DARK["before"]
    assert set(DARK) == set(LIGHT)


def panel() -> Panel:
    found = Panel(Axis.along("time (s)", np.array([0.0, 100.0])), Axis("angle (°)", -1.0, 1.0))
    time_s = np.linspace(0.0, 100.0, 300)
    found.band(10.0, 20.0, "held", label="held out")
    found.band(40.0, 50.0, "held", label="held out")
    found.line(time_s, np.sin(time_s / 10.0), "before", label="plain $model$")
    found.points([5.0, 6.0], [0.1, 0.2], "after", label="extended", radius=4.5)
    found.box((60.0, 70.0), (0.0, 0.5), "before", tip="before 0.5")
    found.rule(80.0, "event", tip="covered", label="event")
    found.note(70.0, 0.5, "50 %")
    return found


def arrays(content: Any) -> list[np.ndarray]:
    """Return every array of a Bokeh document."""
    if isinstance(content, dict) and content.get("type") == "ndarray":
        raw = base64.b64decode(content["array"]["data"])
        return [np.frombuffer(gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw, content["dtype"])]
    parts = content.values() if isinstance(content, dict) else content if isinstance(content, list) else ()
    return [one for part in parts for one in arrays(part)]


def test_both_libraries_draw_all_of_it_under_the_same_names() -> None:
    shown = panel()
    labels = [label for _, label in shown.legend()]
    assert labels == ["held out", "plain $model$", "extended", "event"]
    picture = ET.fromstring(still([shown]))  # noqa: S314 - our own text
    words = " ".join(text.text or "" for text in picture.iter(f"{SVG}text"))
    for label in [*labels, "time (s)", "angle (°)", "50 %"]:
        assert label in words
    document = json.loads(drawing({"one": [shown]}))["document"]
    found = arrays(document)
    for expected in ([10.0, 40.0], [20.0, 50.0], [5.0, 6.0], [60.0], [80.0]):
        assert any(np.array_equal(one, np.float32(expected)) for one in found), expected
    text = json.dumps(document, ensure_ascii=False)
    for said in ("plain $model$", "extended", "before 0.5", "covered", "50 %"):
        assert said in text


def test_axes_of_one_clock_are_one_axis_that_holds_all_of_them() -> None:
    other = Panel(Axis.along("", np.array([-50.0, 80.0])), Axis("sigma (°)", 0.0, 1.0))
    apart = Panel(Axis.along("", np.array([0.0, 9.0]), clock="programme"), Axis("angle (°)", 0.0, 1.0))
    content = json.loads(drawing({"one": [panel()], "two": [other], "three": [apart]}))
    ends = {(one.get("start", 0.0), one.get("end", 1.0)) for one in ranges(content["document"])}
    assert ends >= {(-50.0, 100.0), (0.0, 9.0)}
    assert (0.0, 100.0) not in ends
    assert set(content["roots"]) == {"one", "two", "three"}


def ranges(content: Any) -> list[dict[str, float]]:
    if isinstance(content, dict):
        own = [content["attributes"]] if content.get("name") == "Range1d" and "attributes" in content else []
        return own + [one for part in content.values() for one in ranges(part)]
    return [one for part in content for one in ranges(part)] if isinstance(content, list) else []


@pytest.mark.parametrize("words", ["</script><b>", "<!--"])
def test_no_word_of_a_plot_can_end_the_element_around_it(words: str) -> None:
    shown = panel()
    shown.note(1.0, 0.5, words)
    assert "<" not in drawing({"one": [shown]})
