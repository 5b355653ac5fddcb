"""Numbers are written as CSV by our own code: byte for byte as the table library writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from torsight.core.files.storage import write_table


def test_numbers_are_written_as_the_table_library_writes_them(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    n = 5000
    columns = {
        "frame": np.arange(n),
        "wide": rng.normal(size=n) * 10.0 ** rng.integers(-12, 12, n),
        "gaps": np.where(rng.uniform(size=n) < 0.1, np.nan, rng.normal(size=n)),
        "valid": rng.uniform(size=n) > 0.5,
        "odd": np.resize([np.inf, -np.inf, -0.0], n),
        "single": rng.normal(size=n).astype(np.float32),
    }
    write_table(tmp_path / "ours.csv", columns)
    table = pd.DataFrame({**columns, "valid": columns["valid"].astype(np.int8)})
    table.to_csv(tmp_path / "theirs.csv", index=False, float_format="%.10g", lineterminator="\n")
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "theirs.csv").read_bytes()


def test_texts_are_written_too(tmp_path: Path) -> None:
    write_table(tmp_path / "t.csv", {"name": np.array(["a,b", "c"]), "value": np.array([1.5, np.nan])})
    again = pd.read_csv(tmp_path / "t.csv")
    assert again["name"].tolist() == ["a,b", "c"]
    assert np.isnan(again["value"][1])


@pytest.mark.parametrize("more", [{}, {"name": ["a"] * 300}], ids=["numbers", "texts"])
@pytest.mark.parametrize(
    ("began_s", "step_s"), [(1774749300.0, 0.5), (1774749300.0, 1 / 3), (1.2e5, 1 / 240), (1.7e12, 0.001), (-4e9, 0.04)]
)
def test_times_stay_apart_whenever_their_clock_began(
    tmp_path: Path, began_s: float, step_s: float, more: dict[str, list[str]]
) -> None:
    time_s = began_s + step_s * np.arange(300)
    write_table(tmp_path / "t.csv", {"time_s": time_s, "angle_deg": time_s, **more})
    again = pd.read_csv(tmp_path / "t.csv")["time_s"].to_numpy()
    np.testing.assert_allclose(again, time_s, rtol=0.0, atol=0.005 * step_s)
    assert (np.diff(again) > 0.0).all()


def test_times_that_ten_digits_hold_are_written_as_before(tmp_path: Path) -> None:
    time_s = np.append(np.arange(300) / 30.0, np.nan)
    write_table(tmp_path / "t.csv", {"time_s": time_s})
    assert (tmp_path / "t.csv").read_text().split("\n")[1:-1] == [f"{time:.10g}" for time in time_s[:-1]] + [""]
    write_table(tmp_path / "e.csv", {"time_s": 1774749300.0 + np.array([0.0, 0.5, 1.0])})
    assert (tmp_path / "e.csv").read_text() == "time_s\n1774749300\n1774749300.5\n1774749301\n"
