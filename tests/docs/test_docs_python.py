"""The lines of Python of the pages run as they stand, in a folder with the files that they name."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import pandas as pd
import pytest
import tomli_w
from matplotlib import pyplot as plt

from tests.docs.docs_world import small_scene, write_logger
from tests.docs.documented import DOCS
from torsight.core import write_merged
from torsight.synthetic import make_record


def test_the_lines_of_the_page_on_python_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = small_scene()
    table = make_record(scene).table
    write_merged(tmp_path / "merged.csv", table)
    write_logger(tmp_path, pd.read_csv(tmp_path / "merged.csv"))
    (tmp_path / "actuator.toml").write_text(tomli_w.dumps(scene.declared.to_toml()), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "python.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 3
    with mpl.rc_context({"backend": "Agg"}):
        exec("\n".join(blocks), {})  # noqa: S102 - the page's own lines
        plt.close("all")
    assert len(pd.read_csv("fitted.csv")) > 20
    assert Path("log.png").stat().st_size > 5000
