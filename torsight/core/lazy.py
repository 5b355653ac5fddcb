"""Fast start-up: names imported on first use, SciPy's extensions alone, a garbage collector that runs less often.

The names of a package are listed in its stub, ``__init__.pyi``, where editors and type checkers look.
"""

from __future__ import annotations

import atexit
import functools
import gc
import importlib
import importlib.util
import re
import sys
from collections.abc import Callable
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any


def lazily(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package by its name and the path of its ``__init__.py``."""

    @functools.cache
    def homes() -> dict[str, str]:
        stub = Path(file).with_suffix(".pyi").read_text(encoding="utf-8")
        return {name: home for home, name in re.findall(r"^from (\S+) import (\w+) as \2$", stub, flags=re.MULTILINE)}

    def attribute(name: str) -> Any:
        if name == "__all__":  # what ``from package import *`` asks for
            return sorted(homes())
        if name not in homes():
            msg = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(msg)
        return getattr(importlib.import_module(homes()[name]), name)

    return attribute, lambda: sorted(homes())


def scipy_extension(name: str) -> Any:
    """Return an extension module of SciPy by its full name, without importing the packages that it is in.

    ``scipy.optimize`` imports most of SciPy, which takes a quarter of the start-up time of tracking.
    """
    if name not in sys.modules:
        import scipy

        spec = PathFinder.find_spec(name, [str(Path(scipy.__path__[0], *name.split(".")[1:-1]))])
        if spec is None or spec.loader is None:
            return importlib.import_module(name)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules[name] = module
    return sys.modules[name]


def collect_seldom() -> None:
    """Let Python's garbage collector run after every 10,000 new objects, not after every 700.

    Importing, compiling and drawing create many small objects that persist: collecting among them takes a fifteenth of
    the time of a track or a fit of a few seconds, and a seventh of that of a report. Without any collection the
    compiler is a fourteenth faster than with Python's default, but needs 0.8 GB.
    """
    gc.set_threshold(10_000, 20, 10)
    # What is left at the end of the process is not looked through: that took a fifth of a short track.
    atexit.register(gc.freeze)
