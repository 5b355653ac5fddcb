"""The first argument of ``predict``: parameters and laws by name."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np

from torsight.core.units import Floats

_T = TypeVar("_T")


class ByName(Mapping[str, _T]):
    """Read-only values that a model's functions get: ``p["name"]`` or ``p.name``."""

    MISSING: ClassVar[str]
    """Message about a ``{name}`` that is not among the ``{known}`` ones."""
    UNCHANGED: ClassVar[str] = "the model's values cannot be changed ('{}'); use a variable of your own"
    _items: Mapping[str, _T]

    def __init__(self, items: Mapping[str, _T]) -> None:
        self.__dict__.update(items)
        self.__dict__["_items"] = items

    def __getitem__(self, name: str) -> _T:
        try:
            return self._items[name]
        except KeyError:
            raise KeyError(self._missing(name)) from None

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name if name.startswith("_") else self._missing(name))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(self.UNCHANGED.format(name))

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def _missing(self, name: str) -> str:
        return self.MISSING.format(name=name, known=", ".join(self) or "nothing")


class Values(ByName[Any]):
    """Parameters (floats) and laws (functions) by name."""

    MISSING = "the model has no parameter or law '{name}'; it has {known}; declare it, or its candidate"


class Curve:
    """A law as ``predict`` calls it: linear between nodes, constant beyond the ends; it records its arguments' range.

    ``nodes`` and ``values`` (k,) are those of the law; without them it is off, and zero. ``asked`` (2,) is the smallest
    and the largest argument so far, (∞, −∞) before the first call.
    """

    def __init__(self, nodes: Floats | None = None, values: Floats | None = None) -> None:
        # Contiguous float64, as compiled code reads them.
        self.nodes = np.zeros(1) if nodes is None else np.ascontiguousarray(nodes, np.float64)
        self.values = np.zeros(1) if values is None else np.ascontiguousarray(values, np.float64)
        self.asked = np.array([np.inf, -np.inf])

    def __call__(self, at: Any) -> Any:
        """Return the function's value, a float for a float."""
        if isinstance(at, float):  # as Python integrators call a law, at every step
            self._remember(at, at)
            return float(np.interp(at, self.nodes, self.values))
        given = np.asarray(at, np.float64)
        if given.size:
            self._remember(float(np.min(given)), float(np.max(given)))
        found = np.interp(given, self.nodes, self.values)
        return float(found) if given.ndim == 0 else found

    def afresh(self) -> Curve:
        """Return a copy of the law that has not been called yet."""
        return Curve(self.nodes, self.values)

    def _remember(self, low: float, high: float) -> None:
        if low < self.asked.item(0):
            self.asked[0] = low
        if high > self.asked.item(1):
            self.asked[1] = high


KINDS: dict[tuple[str, ...], Any] = {}
"""Classes of named tuples by the names of their fields, each made once: numba compiles anew for every class."""


def kind_of(names: tuple[str, ...]) -> Any:
    """Return the class of named tuples with these names."""
    if names not in KINDS:
        KINDS[names] = namedtuple("Values", names)  # noqa: PYI024 - the names are known at run time only
    return KINDS[names]


def by_name(items: Mapping[str, Any]) -> Any:
    """Return values as a named tuple, which numba understands; values without a valid field name are left out."""
    names = tuple(name for name in items if name.isidentifier() and not name.startswith("_"))
    return kind_of(names)(*(items[name] for name in names))
