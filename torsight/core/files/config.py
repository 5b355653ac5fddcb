"""Typed values from a TOML table.

Every function raises a :class:`~torsight.core.errors.ConfigError` that names file, key, value and limit: for a missing
key without a default, and for a value of another type or out of range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from torsight.core.errors import ConfigError


def get_table(content: Mapping[str, Any], key: str, *, where: str, required: bool = False) -> Mapping[str, Any]:
    """Return the sub-table ``key`` (empty where it is absent and not required)."""
    if key not in content:
        if required:
            raise ConfigError(f"has no table [{key}]", where=where, do="add it")
        return {}
    table = content[key]
    if not isinstance(table, Mapping):
        raise ConfigError(f"'{key}' is not a table", where=where, value=repr(table), limit=f"[{key}] with keys")
    return table


def get_number(
    table: Mapping[str, Any],
    key: str,
    *,
    where: str,
    default: float | None = None,
    lower: float = -math.inf,
    upper: float = math.inf,
    hint: str | None = None,
) -> float:
    """Return a finite number within [lower, upper]; ``hint`` tells the user what to do with any other value."""
    value = _given(table, key, default, where=where)
    if not is_number(value):
        raise ConfigError(f"'{key}' is not a number", where=where, value=repr(value), limit="a finite number", do=hint)
    if not lower <= value <= upper:
        limit = f"{lower:g} or more" if upper == math.inf else f"{lower:g} to {upper:g}"
        raise ConfigError(f"'{key}' is out of range", where=where, value=f"{value:g}", limit=limit, do=hint)
    return float(value)


def _given(table: Mapping[str, Any], key: str, default: Any, *, where: str) -> Any:
    """Return a key's value or the default; without either the key is missing."""
    value = table.get(key, default)
    if value is None:
        raise ConfigError(f"has no key '{key}'", where=where, do="add it")
    return value


def shown_value(content: Mapping[str, Any], key: str) -> str:
    """Return the words of a message for a key's value, also where there is no such key."""
    return repr(content[key]) if key in content else "no such key"


def is_number(value: Any) -> bool:
    """Return whether a value of a file is a finite number (not a boolean, and not too large for a float)."""
    try:
        return not isinstance(value, bool) and isinstance(value, (int, float)) and math.isfinite(value)
    except OverflowError:
        return False


def get_whole(
    table: Mapping[str, Any],
    key: str,
    *,
    where: str,
    default: int | None = None,
    lower: float = -math.inf,
    upper: float = math.inf,
) -> int:
    """Return a whole number within [lower, upper]."""
    value = get_number(table, key, where=where, default=default, lower=lower, upper=upper)
    if value != int(value):
        raise ConfigError(f"'{key}' is no whole number", where=where, value=f"{value:g}")
    return int(value)


def get_numbers(
    table: Mapping[str, Any],
    key: str,
    count: int,
    *,
    where: str,
    default: Sequence[float] | None = None,
    lower: float = -math.inf,
    upper: float = math.inf,
) -> tuple[float, ...]:
    """Return a list of ``count`` finite numbers, each within [lower, upper]."""
    value = table.get(key, default)
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != count:
        raise ConfigError(f"'{key}' is not a list of {count} numbers", where=where, value=repr(value))
    return tuple(get_number({key: item}, key, where=where, lower=lower, upper=upper) for item in value)


def get_switch(table: Mapping[str, Any], key: str, *, where: str) -> bool:
    """Return true or false; false where the key is absent."""
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise ConfigError(f"'{key}' is not a switch", where=where, value=repr(value), limit="true or false")
    return value


def get_tables(
    content: Mapping[str, Any], key: str, *, where: str, required: bool = False
) -> list[tuple[Mapping[str, Any], str]]:
    """Return the tables ``[[key]]``, each with its location for messages."""
    items = content.get(key, ())
    if not isinstance(items, Sequence) or isinstance(items, str) or (required and not items):
        kind = "is not a list of tables" if key in content else "is absent"
        raise ConfigError(f"'{key}' {kind}", where=where, do=f"write [[{key}]], one table for each")
    places = [f"{where}, [[{key}]] {number}" for number in range(1, len(items) + 1)]
    return [(get_table({key: item}, key, where=place), place) for item, place in zip(items, places, strict=True)]


def get_names(table: Mapping[str, Any], key: str, *, where: str) -> tuple[str, ...]:
    """Return a list of names."""
    names = table.get(key)
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"'{key}' is not a list of names", where=where, value=repr(names))
    return tuple(names)


def get_text(
    table: Mapping[str, Any],
    key: str,
    *,
    where: str,
    default: str | None = None,
    choices: tuple[str, ...] = (),
    empty: bool = False,
) -> str:
    """Return a string, one of ``choices`` where given; an ``empty`` one, which names nothing, only where allowed."""
    value = _given(table, key, default, where=where)
    if not isinstance(value, str):
        raise ConfigError(f"'{key}' is not a text", where=where, value=repr(value), limit="a text in quotes")
    if "\0" in value:
        raise ConfigError(f"'{key}' holds a character that no name has", where=where, value=repr(value))
    if key in table and not (empty or value.strip()):
        raise ConfigError(f"'{key}' is empty", where=where, value=repr(value), do="fill it in, or remove the key")
    if choices and value not in choices:
        raise ConfigError(f"'{key}' is not known", where=where, value=repr(value), limit=", ".join(choices))
    return value
