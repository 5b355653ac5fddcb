"""A constant at half and at twice of its value."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import ModuleType


def half_and_twice(name: str, *modules: ModuleType, most: float = math.inf) -> Iterator[float]:
    """Give 0.5 and 2 while a constant is so many times its value; it is as before at the end.

    It changes in the first of the modules, whose own it is, and in those of the others that have imported it. A whole
    number stays whole, a share near one keeps so many times its distance from one, and none becomes more than ``most``.
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
