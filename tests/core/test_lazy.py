"""Public names that are imported on first use: each is where its package's stub says."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

PACKAGES = ("torsight.core", "torsight.actuator", "torsight.synthetic", "torsight.viewer", "calibration", "tracker")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_of_the_stub_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__file__ is not None
    text = Path(module.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    told = re.findall(r"^from (\S+) import (\w+) as \2$", text, flags=re.MULTILINE)
    # Nothing else stands in a stub: what is spelled otherwise would be known to editors and not to Python.
    assert len(told) == text.count("import ") > 0
    assert sorted(name for _, name in told) == dir(module)
    given: dict[str, object] = {}
    exec(f"from {package} import *", given)  # noqa: S102 - as people do in a notebook
    assert set(given) - {"__builtins__"} == set(dir(module))
    for home, name in told:
        assert getattr(module, name) is getattr(importlib.import_module(home), name)


def test_what_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        importlib.import_module("torsight.core").no_such_name  # noqa: B018
