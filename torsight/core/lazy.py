"""Public names of a package that are imported on first use, so that importing the package costs nothing.

Which they are stands in the package's stub, ``__init__.pyi``, where editors and type checkers look.
"""

from __future__ import annotations

import functools
import importlib
import re
from collections.abc import Callable
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
