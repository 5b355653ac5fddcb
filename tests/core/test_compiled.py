"""Compiled functions: the same digits whether they were just compiled or come from the disk."""

from __future__ import annotations

import importlib
import pkgutil

import pytest
from numba.core.dispatcher import Dispatcher

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
