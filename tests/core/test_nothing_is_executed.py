"""No code of ours evaluates, unpickles or executes what stands in a file, or hands words to a shell."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path for package in ("torsight", "tracker", "calibration", "sync") for path in (ROOT / package).rglob("*.py")
)
NAMES = {"eval", "exec", "compile", "__import__", "breakpoint"}
MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "yaml", "runpy", "code", "imp"}
METHODS = {
    *{("os", "system"), ("os", "popen"), ("np", "load"), ("pd", "read_pickle"), ("pd", "eval"), ("joblib", "load")},
    *{("torch", "load"), ("subprocess", "getoutput"), ("subprocess", "getstatusoutput")},
}


# Between a process and those it has started objects pass in memory, never through a file: a model of one's own, which
# is Python that its owner asks to be run (torsight missing MODEL.py), and what copies of the process have found.
IN_MEMORY = {
    "torsight/discovery/own/model/evaluate.py": "cloudpickle",
    "torsight/discovery/own/model/model_file.py": "cloudpickle",
    "torsight/core/parallel/processes.py": "pickle",
}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_of_a_file_is_executed(path: Path) -> None:
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in NAMES:
            found.append((node.lineno, node.func.id))
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and isinstance(node.func.value, ast.Name)
        ):
            called = (node.func.value.id, node.func.attr)
            found += [(node.lineno, called)] if called in METHODS else []
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            module = node.module if isinstance(node, ast.ImportFrom) else None
            names = [module] if module else [alias.name for alias in node.names]
            banned = MODULES - {IN_MEMORY.get(path.relative_to(ROOT).as_posix())}
            found += [(node.lineno, name) for name in names if name and name.split(".")[0] in banned]
        if isinstance(node, ast.keyword) and node.arg in {"shell", "allow_pickle"}:
            found.append((node.value.lineno, node.arg))
    assert not found
