"""Compiled functions: the same digits whether they were just compiled or come from the disk."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

from torsight.core.compiled import (
    FOLDERS,
    LOADING,
    compiled,
    drop_outdated,
    inlined,
    internal,
    lending,
    shared,
    sources,
)

IMPORT = "from torsight.core.compiled import compiled"
PACKAGES = ("calibration", "sync", "torsight", "tracker")


def compiled_functions(package: str) -> dict[str, Dispatcher]:
    found = {}
    for info in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
        content = vars(importlib.import_module(info.name))
        found |= {f"{info.name}.{name}": each for name, each in content.items() if isinstance(each, Dispatcher)}
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_no_compiled_function_adds_in_an_order_of_the_compilers_choice(package: str) -> None:
    functions = compiled_functions(package)
    assert functions or package in {"calibration", "sync"}
    free = [name for name, each in functions.items() if each.targetoptions.get("fastmath")]
    assert not free, "compiled again, or put together with callers from the disk, their sums end in other digits"


def test_machine_code_goes_when_anything_that_is_in_it_has_changed_and_only_then(tmp_path: Path) -> None:
    folder, stamp = tmp_path / "package", tmp_path / "cache" / "stamp"
    code = folder / "inner" / "__pycache__" / "caller.f-3.py311.nbi"
    code.parent.mkdir(parents=True)
    (folder / "callee.py").write_text(f"from package.limits import MOST\n{IMPORT}\n@compiled\ndef g(): ...")
    (folder / "limits.py").write_text("from package.units import DEG\nMOST = 3 * DEG")
    (folder / "units.py").write_text("DEG = 0.017")
    (folder / "inner" / "caller.py").write_text(f"{IMPORT}\n@compiled\ndef f(): ...")

    def gone() -> bool:
        code.write_text("machine code")
        changed = drop_outdated([folder], stamp, root=tmp_path)
        assert code.exists() != changed
        return changed

    assert gone()
    assert not gone()
    (folder / "other.py").write_text("nothing compiled")
    assert not gone()
    for name, content in (
        ("callee", f"from package.limits import MOST\n{IMPORT}\n@compiled\ndef g(): return 1"),
        ("units", "DEG = 1"),
    ):
        (folder / f"{name}.py").write_text(content)
        assert gone()
        assert not gone()


def scaled(x: float, power: int) -> float:
    return x**power


@pytest.mark.parametrize("decorate", [compiled, internal, lending, shared, inlined])
def test_a_number_that_a_caller_writes_out_compiles_nothing_anew(
    decorate: Callable[..., Dispatcher], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Not beside this file: its machine code would be kept there, and more of it with every run.
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    inner = decorate(scaled)

    @compiled
    def caller(x: float) -> float:
        return inner(x, 2) + inner(x, 3) + inner(x, power=4)

    assert caller(2.0) == 28.0
    assert len(inner.signatures) == 1


@pytest.mark.parametrize("decorate", [internal, lending])
def test_what_only_compiled_code_calls_tells_python_so(
    decorate: Callable[..., Dispatcher], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    with pytest.raises(TypeError, match="scaled is there for compiled callers"):
        decorate(scaled)(2.0, 3)


USER = """
import sys
import numpy as np
from package.solver import solved, twice, wave
print(float(solved(np.array([[2.0, 1.0], [1.0, 3.0]]))), "numba.typed.typeddict" in sys.modules)
print(*(wave(0.0), twice(0.5) / wave(0.5)) if len(sys.argv) > 1 else "")
"""
SOLVER = """
import math
import numpy as np
from torsight.core.compiled import compiled, shared

@shared
def wave(x):
    return math.sin(x) * abs(complex(x, 1.0))

@compiled
def solved(matrix):
    product = np.dot(matrix, matrix)
    return wave(product[0, 1]) + product.max() + np.log(product).sum()

@compiled
def twice(x):
    return 2.0 * wave(x)
"""


def test_kept_code_is_loaded_without_the_compiler_and_gives_the_same_digits(tmp_path: Path) -> None:
    # A newer numba loads in its own way until somebody has run this with it and named it there.
    assert numba.__version__.rpartition(".")[0] in LOADING
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "solver.py").write_text(SOLVER)
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])

    def run(*more: str) -> list[str]:
        command = [sys.executable, "-c", USER, *more]
        environment = {**os.environ, "PYTHONPATH": path}
        return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.splitlines()

    (value, compiler), _ = (line.split() for line in run())
    assert compiler == "True"
    # One that compiles after it has loaded sets the compiler up, and puts loaded code into what calls it.
    (again, compiler), after = (line.split() for line in run("compile"))
    assert (again, compiler, after) == (value, "False", ["0.0", "2.0"])


@pytest.mark.parametrize("package", PACKAGES)
def test_the_source_of_each_function_whose_machine_code_is_kept_is_looked_at(package: str) -> None:
    watched = sources(FOLDERS, Path(__file__).parents[2])
    kept = [each for each in compiled_functions(package).values() if each.stats.cache_path]
    made_of = {Path(inspect.getfile(each.py_func)) for each in kept}
    assert made_of or package in {"calibration", "sync"}
    assert made_of <= set(watched)


@pytest.mark.parametrize("folder", ["torsight", "tracker", "calibration", "sync"])
def test_every_compiled_module_takes_its_decorator_from_where_that_is_looked_at(folder: str) -> None:
    root = Path(__file__).parents[2]
    own = root / "torsight" / "core" / "compiled.py"
    direct = [path for path in (root / folder).rglob("*.py") if "from numba import" in path.read_text(encoding="utf-8")]
    assert direct == ([own] if folder == "torsight" else [])
