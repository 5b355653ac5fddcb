"""Immutable mappings and arrays for the fields of frozen objects, and objects whose fields are columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.units import Floats

_COLUMN_TYPES: Final = {"Floats": np.float64, "Flags": np.bool_, "Ints": np.int64}
"""Type of a column's elements by the annotation of its field."""


class ReadOnly(dict[Any, Any]):
    """A dict that refuses every change; ``copy()``, ``copy.deepcopy`` and ``dict(...)`` return a mutable one."""

    def _refuse(self, *_arguments: object, **_options: object) -> NoReturn:
        msg = "belongs to a frozen object: change a dict(...) of it, and make another with dataclasses.replace"
        raise TypeError(msg)

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def copy(self) -> dict[Any, Any]:
        """Return a dict with the same content."""
        return dict(self)

    def __deepcopy__(self, memo: dict[int, Any]) -> dict[Any, Any]:
        from copy import deepcopy

        return {key: deepcopy(value, memo) for key, value in self.items()}

    def __reduce__(self) -> tuple[Any, ...]:
        # A dict is unpickled item by item, which this class refuses.
        return read_only, (dict(self),)


def read_only(mapping: Mapping[Any, Any]) -> ReadOnly:
    """Return an immutable copy of a mapping and of the mappings inside it."""
    if isinstance(mapping, ReadOnly):
        return mapping
    return ReadOnly({key: _unchanging(value) for key, value in mapping.items()})


def _unchanging(value: Any) -> Any:
    """Return an immutable view or copy of a mapping or an array; anything else unchanged."""
    if isinstance(value, Mapping):
        return read_only(value)
    if isinstance(value, np.ndarray) and value.flags.writeable:
        value = value.copy()
        value.flags.writeable = False
    return value


def refuse_plainly(cls: type) -> None:
    """Give a frozen dataclass with slots a clear error message, whichever name is set.

    Such a class is created twice, the second time by ``dataclass``; its built-in refusal then raises an error about
    ``super()`` where the name is no field.
    """

    def refuse(self: object, name: str, *_value: object) -> NoReturn:
        msg = (
            f"cannot change '{name}' of a frozen {type(self).__name__}: make another one with "
            "dataclasses.replace(it, field=value)"
        )
        raise FrozenInstanceError(msg)

    if "__dataclass_fields__" in vars(cls) and "__setattr__" in vars(cls):
        cls.__setattr__ = cls.__delattr__ = refuse  # type: ignore[method-assign,assignment]


class Frozen:
    """Base of frozen dataclasses: mappings and arrays are copied at creation and are immutable afterwards."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        refuse_plainly(cls)

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]
            object.__setattr__(self, one.name, _unchanging(getattr(self, one.name)))


class Columns(Frozen):
    """Base of frozen dataclasses with ``time_s`` (n,) and further columns (n,), also those of ``extra``.

    A column may be given as anything that numpy converts to an array: a list, a column of a data frame, an array of
    another type. The annotation of its field (``Floats``, ``Flags``, ``Ints``) is its type afterwards.

    Raises InputError when a column is not numeric, or has another length than the times.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]
            given, kind = getattr(self, one.name), _COLUMN_TYPES.get(str(one.type).removesuffix(" | None"))
            if kind is not None and given is not None:
                object.__setattr__(self, one.name, _converted(given, kind, where=f"{type(self).__name__}, {one.name}"))
            elif one.name == "extra":
                object.__setattr__(self, "extra", {name: np.asarray(column) for name, column in given.items()})
        Frozen.__post_init__(self)
        self._require_one_length()

    def _require_one_length(self) -> None:
        values = {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]
        rows = values["time_s"].size
        for name, column in {**values, **values.get("extra", {})}.items():
            if isinstance(column, np.ndarray) and column.shape != (rows,):
                raise InputError(
                    "has not one value for every time",
                    where=f"{type(self).__name__}, {name}",
                    value=f"shape {column.shape}",
                    limit=f"({rows},), as time_s",
                    do="give columns of one length, NaN where a value is not known",
                )


def _converted(given: Any, kind: type[np.generic], *, where: str) -> NDArray[Any]:
    """Return a column as an array of another type of numbers; a value that this type cannot hold is refused."""
    exact = _numbers(given)
    if exact is None:
        raise InputError(
            "is no column of numbers",
            where=where,
            value=f"elements of type {np.asarray(given).dtype}",
            limit=f"{np.dtype(kind)}",
            do="give numbers, NaN where a value is not known; times are seconds, not dates",
        )
    if kind is np.float64:
        return exact
    with np.errstate(invalid="ignore"):
        column = exact.astype(kind)
    for row in np.flatnonzero(np.ravel(column != exact))[:1]:
        raise InputError(
            "is no switch" if kind is np.bool_ else "is no whole number",
            where=f"{where}, row {row}",
            value=f"{np.ravel(exact)[row]:g}",
            limit="0 or 1" if kind is np.bool_ else None,
            do="correct that row",
        )
    return column


def _numbers(given: Any) -> Floats | None:
    """Return a column as floating-point numbers; None where it holds texts, dates or objects that are no numbers."""
    # Texts and dates would be converted to numbers that nobody meant.
    if np.asarray(given).dtype.kind not in "biufO":
        return None
    try:
        return np.asarray(given, np.float64)
    except (TypeError, ValueError):
        return None
