"""Public names that are imported on first use: each is where it is said to be, and editors are told the same names."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

PACKAGES = ("torsight.core", "torsight.actuator", "torsight.synthetic", "calibration")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_name_is_there_and_its_stub_says_from_where(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__file__ is not None
    text = Path(module.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    told = re.findall(r"^from (\S+) import (\w+) as \2$", text, flags=re.MULTILINE)
    assert sorted(name for _, name in told) == dir(module)
    for home, name in told:
        assert getattr(module, name) is getattr(importlib.import_module(home), name)


def test_what_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        importlib.import_module("torsight.core").no_such_name  # noqa: B018
