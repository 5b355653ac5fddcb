"""Sections of a scene file as frozen dataclasses: every key has a default, bounds and one line of help.

A section is a dataclass whose fields are made by :func:`key`. :func:`read_section` fills a section from a TOML table
and refuses unknown keys.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from torsight.core.files.config import get_number, get_numbers, get_switch, get_text, get_whole
from torsight.core.files.storage import check_keys
from torsight.core.units import DEG, MNM

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class KeyRule:
    """Allowed values of a key: a number (each, in a list) within its bounds, or one of the choices if given.

    ``help`` is one line, the unit is in the key's name; ``constant`` is the constant of the integrator that the key
    sets directly, if any.
    """

    help: str
    lower: float = -math.inf
    upper: float = math.inf
    choices: tuple[str, ...] = ()
    constant: str = ""


def key(default: T, text: str, **rule: Any) -> T:
    """Declare one key of a section: default, one line of help, and the other fields of its :class:`KeyRule`."""
    declared: T = field(default=default, metadata={"rule": KeyRule(text, **rule)})
    return declared


def rule_of(item: Field[Any]) -> KeyRule:
    """Return the rule that :func:`key` attached to a field."""
    rule: KeyRule = item.metadata["rule"]
    return rule


def is_section(kind: Any) -> bool:
    """Return whether a type is a section: a dataclass, every field of which was declared by :func:`key`."""
    return is_dataclass(kind) and all("rule" in item.metadata for item in fields(kind))


def constants_of(section: Any) -> dict[str, float]:
    """Return the integrator's constants that a section's keys set, in SI; a text gives its index among the choices."""
    rules = {item.name: rule_of(item) for item in fields(section)}
    return {rule.constant: _in_si(name, getattr(section, name), rule) for name, rule in rules.items() if rule.constant}


def _in_si(name: str, value: float | str, rule: KeyRule) -> float:
    if isinstance(value, str):
        return rule.choices.index(value)
    return value * DEG if name.endswith("_deg") else value * MNM if "_mnm" in name else value


def read_section(kind: type[T], table: Mapping[str, Any], *, where: str) -> T:
    """Fill a section from a TOML table; absent keys have their defaults.

    Raises ConfigError for an unknown key (naming the nearest), a value of the wrong kind, or one out of its bounds.
    """
    items: tuple[Field[Any], ...] = fields(kind)  # type: ignore[arg-type]  # every section is a dataclass
    known = {item.name: item for item in items}
    check_keys(table, tuple(known), where=where)
    return kind(**{name: _value(known[name], table, where=where) for name in table})


def _value(item: Field[Any], table: Mapping[str, Any], *, where: str) -> Any:
    rule, name, default = rule_of(item), item.name, item.default
    if isinstance(default, bool):
        return get_switch(table, name, where=where)
    if isinstance(default, str):
        return get_text(table, name, where=where, choices=rule.choices)
    if isinstance(default, tuple):
        return get_numbers(table, name, len(default), where=where, lower=rule.lower, upper=rule.upper)
    get = get_whole if isinstance(default, int) else get_number
    return get(table, name, where=where, lower=rule.lower, upper=rule.upper)
