"""A constant at half and at twice its value."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import ModuleType


def half_and_twice(name: str, *modules: ModuleType, most: float = math.inf) -> Iterator[float]:
    """Yield 0.5 and 2 while a constant is multiplied by that factor; its value is restored at the end.

    The constant changes in the first of the modules, which defines it, and in those of the others that have imported
    it. A whole number stays whole; for a share near one the distance from one is multiplied; no value exceeds ``most``.
    """
    was = getattr(modules[0], name)
    holders = [one for one in modules if getattr(one, name, None) is was]
    try:
        for factor in (0.5, 2.0):
            changed = 1.0 - factor * (1.0 - was) if 0.9 < was < 1.0 else factor * was
            for one in holders:
                setattr(one, name, max(1, round(changed)) if isinstance(was, int) else min(changed, most))
            yield factor
    finally:
        for one in holders:
            setattr(one, name, was)
