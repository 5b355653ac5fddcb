"""Records with little or nothing in them: sections are left out, the rest is said, nothing breaks."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from made_up_run import LOST_S, discovery, rewrite, write_made_up_run
from report_words import figures_of, words_of

from tests.plain_report import draw_no_plots
from torsight.report import write_report
from torsight.report.plots.panels import Band
from torsight.report.plots.still import still
from torsight.report.write import NAMES, write_figures

TABLES = ("angle", "markers", "merged", "curves")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    write_made_up_run(tmp_path, rate_hz=1.0)
    return tmp_path


def change(folder: Path, name: str, how: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    table = pd.read_csv(folder / f"{name}.csv")
    how(table).to_csv(folder / f"{name}.csv", index=False)


def nothing_valid(table: pd.DataFrame) -> pd.DataFrame:
    for name in table.columns:
        if name.endswith(("_px", "_deg")):
            table[name] = np.nan
        if name == "valid" or name.endswith("_valid"):
            table[name] = 0
    return table


@pytest.mark.parametrize("rows", [1, 2])
def test_tables_of_hardly_any_rows_leave_their_figures_out(run: Path, rows: int) -> None:
    for name in TABLES:
        change(run, name, lambda table: table.head(rows))
    text = words_of(run)
    assert "The model lacks an effect: sensor lag." in text
    assert ('id="before_after"' in text) == (rows == 2)


def test_a_film_with_nothing_valid_is_said_and_not_drawn(run: Path) -> None:
    for name in TABLES:
        change(run, name, nothing_valid)
    text = words_of(run)
    assert "The angle is not known in 400 of 400 frames." in text
    assert "Where the markers went" not in text
    assert "before_after" not in text
    assert not re.search(r"\bnan\b", text, flags=re.IGNORECASE)


def test_a_long_gap_is_a_gap_in_the_curves_and_shaded_in_the_measurement(run: Path) -> None:
    def lose(table: pd.DataFrame) -> pd.DataFrame:
        lost = table["time_s"].between(100.0, 250.0)
        columns = [name for name in table.columns if name.startswith(("angle", "residual"))]
        table.loc[lost, columns] = np.nan
        if "valid" in table.columns:
            table.loc[lost, "valid"] = 0
        return table

    for name in ("angle", "merged", "curves"):
        change(run, name, lose)
    figures = figures_of(run)
    assert "nan" not in still(figures["before_after"].panels).lower()
    shaded = [(mark.low, mark.high) for mark in figures["angle_sigma"].panels[0].marks if isinstance(mark, Band)]
    # One frame a second: the film's own gap, and the one that was made here.
    assert shaded == [pytest.approx((LOST_S[0], LOST_S[1] - 1.0)), pytest.approx((100.0, 250.0))]
    bars = figures["residual_direction"].data
    assert bars is not None
    assert np.isfinite(bars["before_deg"]).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"effects": None, "alternatives": None, "drivers": None, "held_out": None, "evidence": None, "verdict": "none"},
        {"effects": [{"id": "sensor_lag"}], "before": {}, "after": {}, "noise_floor_deg": None},
        {"evidence": {"gains": {"sensor_lag": None, "clock_offset": -3.0}}},
        {"evidence": {"gains": {}}, "parameters": {}},
        {"verdict": "ambiguous", "alternatives": [["clock_offset"]], "next_experiment": {"segments": [None, {}]}},
        {"verdict": "ambiguous", "alternatives": [["clock_offset"]], "next_experiment": "repeat it"},
        {"verdict": "unknown", "effects": [], "drivers": [], "evidence": {"gains": {"fatigue": 3.0}, "best_set": []}},
        {"before": {"rmse_held_out_deg": 0.0}, "after": {"rmse_held_out_deg": 0.0}},
    ],
)
def test_answers_with_little_in_them_still_make_a_page(run: Path, changes: dict[str, object]) -> None:
    rewrite(run, "discovery", **changes)
    text = words_of(run)
    assert "Torsight report" in text
    assert ">None<" not in text


def planned_table() -> pd.DataFrame:
    time_s = np.arange(0.0, 100.0, 0.5)
    angle = 100.0 * np.sin(time_s / 20.0)
    return pd.DataFrame(
        {
            "time_s": time_s,
            "temp_a_c": 25.0 + time_s / 2.0,
            "temp_b_c": 25.0,
            "heat_a": 1,
            "heat_b": 0,
            "sensor_lag_deg": angle,
            "clock_offset+fatigue_deg": angle + 2.0,
        }
    )


def test_the_next_experiment_is_drawn_and_goes_when_the_answer_is_another(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    segment = {"spring": "a", "action": "heat", "from_c": 25.0, "to_c": 60.0, "rate_c_per_s": 0.4, "duration_s": 87.5}
    plan = {
        "text": "Heat A fast.",
        "duration_s": 600.0,
        "separation_sigmas": 12.3,
        "repeat_separation_sigmas": 0.4,
        "needed_gain": 12.0,
        "segments": [segment, {**segment, "action": "cool", "rate_c_per_s": None}],
    }
    planned_table().to_csv(run / "next_experiment.csv", index=False)
    rewrite(run, "discovery", verdict="ambiguous", alternatives=[["clock_offset", "fatigue"]], next_experiment=plan)
    text = write_report(run).read_text(encoding="utf-8")
    for words in ("Heat A fast.", "12.3 standard deviations", "3.46 standard deviations", "10 min", "by itself"):
        assert words in text, words
    assert "clock offset with fatigue less sensor lag" in text
    assert (run / "figures" / "next_experiment.svg").exists()
    rewrite(run, "discovery")
    draw_no_plots(monkeypatch)
    assert "next_experiment.svg" not in write_report(run).read_text(encoding="utf-8")
    assert not (run / "figures" / "next_experiment.svg").exists()


@pytest.mark.parametrize(
    ("verdict", "best_set", "percent"),
    [
        ("none", ["fatigue"], None),
        ("unknown", [], None),
        ("unknown", ["fatigue"], None),
        ("identified", ["fatigue"], {"fatigue": 100.0, "stiffening": 25.0}),
    ],
)
def test_candidates_are_drawn_only_where_something_was_explained(
    run: Path, verdict: str, best_set: list[str], percent: dict[str, float] | None
) -> None:
    gains = {"fatigue": 80.0, "stiffening": 20.0}
    rewrite(run, "discovery", verdict=verdict, effects=[], evidence={"gains": gains, "best_set": best_set})
    figure = figures_of(run).get("candidates")
    found = None if figure is None else dict(zip(figure.data["effect"], figure.data["percent"], strict=True))
    assert found == (None if percent is None else pytest.approx(percent))


def test_what_others_keep_in_the_figures_folder_stays(run: Path) -> None:
    own = run / "figures" / "for_the_paper.svg"
    own.parent.mkdir()
    own.write_text("<svg/>", encoding="utf-8")
    figure = figures_of(run)["temperatures"]
    write_figures(run, [figure], {"temperatures": "<svg>1</svg>"})
    assert (run / "figures" / "temperatures.svg").exists()
    write_figures(run, [], {})
    assert sorted((run / "figures").iterdir()) == [own]
    assert own.read_text(encoding="utf-8") == "<svg/>"


def test_every_figure_stands_alone_beside_the_page_with_its_numbers(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Only the files beside the page are looked at; its interactive plots are those of test_report_drawn.py.
    monkeypatch.setattr("torsight.report.write.drawing", lambda _: "")
    rewrite(
        run,
        "discovery",
        evidence={"gains": {"sensor_lag": 4000.0, "clock_offset": 3000.0, "fatigue": -1.0}, "best_set": []},
    )
    text = write_report(run).read_text(encoding="utf-8")
    pictures = sorted((run / "figures").glob("*.svg"))
    assert len(pictures) >= 12
    assert {path.stem for path in pictures} <= NAMES
    assert {"both_clocks.svg", "angle_sigma.svg", "before_after.svg"} <= {path.name for path in pictures}
    for path in pictures:
        picture = path.read_text(encoding="utf-8")
        ET.fromstring(picture)  # noqa: S314 - our own text
        assert "var(--" not in picture
        assert "http" not in picture.split("<g id", 1)[1].replace("http://www.w3.org", "")
        assert f'href="figures/{path.name}"' in text
    shares = pd.read_csv(run / "figures" / "candidates.csv").set_index("effect")["percent"]
    assert shares.to_dict() == pytest.approx({"sensor_lag": 100.0, "clock_offset": 75.0, "fatigue": 0.0})
    assert "it makes the record over a million times less probable" in text
    table = pd.read_csv(run / "curves.csv")
    rest = table[table["direction"] == "heating"]["residual_before_deg"]
    bars = pd.read_csv(run / "figures" / "residual_direction.csv").set_index("direction")
    assert bars.loc["heating", "before_deg"] == pytest.approx(float(np.sqrt(np.mean(rest.dropna() ** 2))), rel=1e-6)


def test_the_errors_of_unseen_half_cycles_are_those_of_the_answer(run: Path) -> None:
    before = discovery()["before"] | {"by_half_cycle_deg": [31.0, 35.5]}  # type: ignore[operator]
    after = discovery()["after"] | {"by_half_cycle_deg": [0.4, None]}  # type: ignore[operator]
    rewrite(run, "discovery", before=before, after=after, held_out=[2, 3])
    figures = figures_of(run)
    assert "residual_half_cycle" not in figures
    table = figures["unseen_half_cycles"].data
    assert table is not None
    assert table["half_cycle"] == ["3", "4"]
    assert table["before_deg"] == [31.0, 35.5]
    assert np.isnan(table["after_deg"][1])
