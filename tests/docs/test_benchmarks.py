"""Every benchmark that is named is there, with the names it imports and the constants it halves and doubles."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path

import pytest

from tests.docs.documented import ROOT

PACKAGES = ("torsight", "tracker", "sync", "calibration")
SOURCES = [path for name in PACKAGES for path in (ROOT / name).rglob("*.py")]
BENCHMARKS = list((ROOT / "benchmarks").rglob("*.py"))
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9]*(_[A-Z0-9]+)*")


def assigned(path: Path) -> dict[str, ast.expr]:
    """Return the constants of a module and what each is set to."""
    plain = [
        node
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign | ast.AnnAssign)
    ]
    pairs = [(node.target if isinstance(node, ast.AnnAssign) else node.targets[0], node.value) for node in plain]
    return {one.id: value for one, value in pairs if isinstance(one, ast.Name) and value is not None}


def test_every_benchmark_that_is_named_is_there() -> None:
    pages = [*SOURCES, *BENCHMARKS, *(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")]
    named = {
        name for page in pages for name in re.findall(r"\bbenchmarks/[\w/]+\.py", page.read_text(encoding="utf-8"))
    }
    assert named
    assert not [name for name in named if not (ROOT / name).is_file()]


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_everything_that_a_benchmark_imports_is_there(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] in PACKAGES:
            module = importlib.import_module(str(node.module))
            missing = [one.name for one in node.names if not hasattr(module, one.name)]
            assert all(importlib.util.find_spec(f"{node.module}.{name}") for name in missing), missing


def test_every_constant_that_is_halved_and_doubled_is_there() -> None:
    known = {name for path in SOURCES for name in assigned(path)}
    lists = [
        value
        for path in BENCHMARKS
        if "halving and doubling" in path.read_text(encoding="utf-8")
        for name, value in assigned(path).items()
        if name in {"CONSTANTS", "CLOCK", "LOG", "WINDOWS", "FITS"}
    ]
    changed = [
        node.value
        for value in lists
        for node in ast.walk(value)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and CONSTANT.fullmatch(node.value)
    ]
    assert len(changed) > 20
    assert set(changed) <= known
