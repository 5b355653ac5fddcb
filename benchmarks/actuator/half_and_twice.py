"""A constant of a module at half and at twice of its value."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType


def half_and_twice(module: ModuleType, name: str) -> Iterator[float]:
    """Give 0.5 and 2 while the constant is so many times its value, whole where it is; it is as before at the end."""
    was = getattr(module, name)
    try:
        for factor in (0.5, 2.0):
            changed = factor * was
            setattr(module, name, max(1, round(changed)) if isinstance(was, int) else changed)
            yield factor
    finally:
        setattr(module, name, was)
