"""Symbols and titles of quantities by their names in files: ``E_A_gpa`` is E_A, the austenite's modulus, in GPa.

The actuator's keys and every effect declare symbol and title of their own quantities.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from torsight.actuator.spec import KEYS
from torsight.actuator.springs import SPRING_B
from torsight.core.words.wording import effect_name, estimate


class Quantity(NamedTuple):
    """A symbol, with an underscore before its index, and its meaning in a few words; empty strings where unknown."""

    symbol: str
    title: str


OF_THE_ACTUATOR: Final[Mapping[str, Quantity]] = {
    **{name: Quantity(key.symbol, key.title) for name, key in KEYS.items()},
    "theta_1_deg": Quantity("θ_1", "winding before heating"),
    "theta_2_deg": Quantity("θ_2", "winding at the extremum"),
    "theta_3_deg": Quantity("θ_3", "winding after cooling"),
    "beta_cr_deg": Quantity("β_cr", "critical angle of the two cases"),
}
"""The actuator's quantities, with the symbols of the paper."""

_SUFFIXES: Final = re.compile(
    r"_(deg_per_hour|mnm_per_rad3|mnm_per_rad|mnm_s_per_rad|mpa_per_k|deg_per_s|c_per_s|gpa|mpa|mnm|deg|rad|ppm|mm|px|s|c)$"
)
"""Unit at the end of a quantity's name."""
_RECORD: Final = re.compile(r"_(\d+)$")


@functools.cache
def quantities() -> Mapping[str, Quantity]:
    """Return the actuator's quantities and those of all effects, by their names in files."""
    from torsight.actuator.effects import load_effects

    found = dict(OF_THE_ACTUATOR)
    for effect in load_effects().values():
        found |= {one.name: Quantity(one.symbol, one.title) for one in effect.parameters if one.symbol}
        found |= {one.name: Quantity(one.symbol, one.title) for one in effect.derived if one.symbol}
    return MappingProxyType(found)


def quantity(name: str) -> Quantity:
    """Return symbol and title of a value of the JSON outputs, also of one for spring B or for a further record."""
    known = quantities()
    if name in known:
        return known[name]
    if name.startswith(SPRING_B):
        own = quantity(name.removeprefix(SPRING_B))
        return Quantity(own.symbol and f"{own.symbol},B", own.title and f"{own.title}, spring B")
    record = _RECORD.search(name)
    if record is not None:
        own = quantity(name[: record.start()])
        return Quantity(own.symbol, own.title and f"{own.title}, record {record.group(1)}")
    return Quantity("", "")


def plain_symbol(name: str) -> str:
    """Return a quantity's symbol for plain text, or its name in words without the unit where it has no symbol."""
    law, at, place = name.partition("@")
    if at and place.isdecimal():
        return f"{candidate_name(law)}, coefficient {int(place) + 1}"
    return quantity(name).symbol or effect_name(_SUFFIXES.sub("", name))


def candidate_name(identifier: str) -> str:
    """Return an effect's name or a law's title: ``sensor lag``, ``spring B's torque over its winding``."""
    from torsight.actuator.laws import FAMILIES

    return FAMILIES[identifier].title if identifier in FAMILIES else effect_name(identifier)


def with_title(name: str) -> str:
    """Return ``friction torque τ_c``, or the name in words where there is no symbol."""
    found = quantity(name)
    return f"{found.title} {found.symbol}" if found.symbol and found.title else plain_symbol(name)


def in_symbols(words: str, symbol: Callable[[str], str] = plain_symbol) -> str:
    """Return a sentence with symbols in place of the quantities' names."""
    pattern = r"\b(?:" + "|".join(sorted(map(re.escape, quantities()), key=len, reverse=True)) + r")\b"
    return re.sub(pattern, lambda found: symbol(found.group()), words)


def for_people(effect: Mapping[str, Any]) -> dict[str, Any]:
    """Return the derived values of an effect of ``discovery.json``; all its values where none are derived.

    Amplitude and phase, for example, are more meaningful than sine and cosine parts.
    """
    from torsight.actuator.effects import load_effects

    own, known = dict(effect.get("parameters") or {}), load_effects().get(str(effect.get("id")))
    derived = {one.name for one in known.derived} if known is not None else set()
    return {name: one for name, one in own.items() if name in derived} or own


def effect_values(effect: Mapping[str, Any]) -> str:
    """Return the values of an effect of ``discovery.json`` on one line: title, symbol, value with its interval."""
    return "; ".join(f"{with_title(name)} {estimate(one)}" for name, one in for_people(effect).items())
