"""What ``predict`` gets as its first argument: parameters and laws by name."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Values(Mapping[str, Any]):
    """Parameters (floats) and laws (functions), as ``p["name"]`` or ``p.name``; nothing can be changed in it."""

    def __init__(self, items: Mapping[str, Any]) -> None:
        self.__dict__.update(items)

    def __getitem__(self, name: str) -> Any:
        try:
            return self.__dict__[name]
        except KeyError:
            raise KeyError(_missing(name, self.__dict__)) from None

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name if name.startswith("__") else _missing(name, self.__dict__))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"the model's values cannot be changed ('{name}'); use a variable of your own")

    def __iter__(self) -> Iterator[str]:
        return iter(self.__dict__)

    def __len__(self) -> int:
        return len(self.__dict__)


def _missing(name: str, known: Mapping[str, Any]) -> str:
    return f"the model has no parameter or law '{name}'; it has {', '.join(known)}; declare it, or its candidate"


class Curve:
    """A law as ``predict`` calls it: lines between nodes, held beyond the ends; remembers where it was asked.

    Parameters
    ----------
    nodes, values : (k,) float64
        Places and the function's values there; without them the law is off, and zero.

    Attributes
    ----------
    asked : (2,) float64
        The least and the greatest value that it was asked for; infinite the wrong way round where it never was.
    """

    def __init__(self, nodes: Array | None = None, values: Array | None = None) -> None:
        self.off = nodes is None or values is None
        # As compiled code reads them.
        self.nodes = np.zeros(1) if nodes is None else np.ascontiguousarray(nodes, np.float64)
        self.values = np.zeros(1) if values is None else np.ascontiguousarray(values, np.float64)
        self.asked = np.array([np.inf, -np.inf])

    def __call__(self, at: Any) -> Any:
        """Return the function's value, a float for a float."""
        if isinstance(at, float):  # once per step of an integrator in plain Python
            self._remember(at, at)
            return 0.0 if self.off else float(np.interp(at, self.nodes, self.values))
        given = np.asarray(at, np.float64)
        if given.size:
            self._remember(float(np.min(given)), float(np.max(given)))
        found = np.interp(given, self.nodes, self.values)
        return float(found) if given.ndim == 0 else found

    def afresh(self) -> Curve:
        """Return the same law, asked nowhere yet."""
        return Curve(self.nodes, self.values)

    def _remember(self, low: float, high: float) -> None:
        self.asked[0] = min(self.asked[0], low)
        self.asked[1] = max(self.asked[1], high)


KINDS: dict[tuple[str, ...], Any] = {}
"""Classes of named tuples by their names: numba compiles anew for every class."""


def kind_of(names: tuple[str, ...]) -> Any:
    """Return the class of named tuples with these names."""
    if names not in KINDS:
        KINDS[names] = namedtuple("Values", names)  # noqa: PYI024 - the names are known at run time only
    return KINDS[names]


def by_name(items: Mapping[str, Any]) -> Any:
    """Return values as a named tuple, which numba understands; what has no name in Python is left out."""
    names = tuple(name for name in items if name.isidentifier() and not name.startswith("_"))
    return kind_of(names)(*(items[name] for name in names))
