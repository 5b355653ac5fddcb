"""Checks of the arguments that a user gives.

Every check raises an InputError that says what was given where, what is allowed and what to do.
"""

from __future__ import annotations

import keyword
import math
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeVar

import numpy as np

from torsight.core.errors import InputError

_TAKEN: Final = frozenset({"get", "items", "keys", "values"})
"""Names of a mapping's own methods."""
_T = TypeVar("_T")


def number(given: Any, where: str, *, positive: bool = False, finite: bool = True) -> float:
    """Return a number as a float."""
    value = np.asarray(given)
    plain = value.ndim == 0 and value.dtype.kind in "fiu"
    found = float(value) if plain else math.nan
    if math.isnan(found) or (finite and math.isinf(found)) or (positive and found <= 0.0):
        kind = "positive number" if positive else "number"
        limit = f"a {'finite ' if finite else ''}{kind}"
        raise InputError(f"is no {kind}", where=where, value=repr(given), limit=limit, do="give one, or leave it out")
    return found


def text(given: Any, where: str) -> str:
    """Return a text, which may be empty."""
    if not isinstance(given, str):
        raise InputError("is no text", where=where, value=repr(given), do="give it in quotes")
    return given


def name(given: Any, where: str) -> str:
    """Return a name that can be used as in ``p.name``."""
    found = text(given, where)
    if not found.isidentifier() or keyword.iskeyword(found) or found.startswith("_") or found in _TAKEN:
        limit = f"letters, digits and _, as in p.name; no word of Python, none of {', '.join(sorted(_TAKEN))}"
        do = "give it another name"
        raise InputError("is no name that a model can use", where=where, value=repr(found), limit=limit, do=do)
    return found


def several(given: Any, kind: type[_T] | tuple[type[_T], ...], where: str, *, do: str) -> tuple[_T, ...]:
    """Return one or several objects of a type as a tuple."""
    if isinstance(given, kind):
        return (given,)
    if given is None or isinstance(given, (str, Mapping)) or not isinstance(given, Iterable):
        raise InputError("cannot be used", where=where, value=repr(given), do=do)
    found = tuple(given)
    for one in found:
        if not isinstance(one, kind):
            raise InputError("cannot be used", where=where, value=repr(one), do=do)
    return found


def names(given: Any, where: str) -> tuple[str, ...]:
    """Return one or several names of columns or parameters."""
    found = several(given, str, where, do="give a name, or a list of names")
    if len(set(found)) < len(found):
        raise InputError("holds a name twice", where=where, value=", ".join(found), do="remove one of the two")
    return found


def one_of(given: Any, kind: type[_T], where: str, *, do: str) -> _T:
    """Return an object of a type."""
    if not isinstance(given, kind):
        raise InputError("cannot be used", where=where, value=repr(given), do=do)
    return given


def function(given: Any, where: str) -> Any:
    """Return a callable."""
    if not callable(given):
        raise InputError("is no function", where=where, value=repr(given), do="give the function itself, not its name")
    return given
