"""Numbers are written as CSV by our own code: byte for byte as the table library writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

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
