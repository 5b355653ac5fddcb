"""Immutable mappings and arrays for the fields of frozen objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields
from typing import Any, NoReturn

import numpy as np


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
