"""What ``predict`` gets as its first argument: parameters and laws by name."""

from __future__ import annotations

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
        Places and the function's values there.
    """

    def __init__(self, nodes: Array, values: Array) -> None:
        self.nodes = nodes
        self.values = values

    def __call__(self, at: Any) -> Any:
        """Return the function's value, a float for a float."""
        found = np.interp(at, self.nodes, self.values)
        return float(found) if np.ndim(found) == 0 else found


class Off:
    """A law that is switched off: zero; the least and the greatest value that it is asked for are kept."""

    def __init__(self) -> None:
        self.low = np.inf
        self.high = -np.inf

    def __call__(self, at: Any) -> Any:
        """Return zero, in the shape of what is given."""
        if isinstance(at, float):  # once per step of an integrator in plain Python
            self.low, self.high = min(self.low, at), max(self.high, at)
            return 0.0
        values = np.asarray(at, np.float64)
        if values.size:
            self.low = min(self.low, float(np.min(values)))
            self.high = max(self.high, float(np.max(values)))
        return 0.0 if values.ndim == 0 else np.zeros(values.shape)
