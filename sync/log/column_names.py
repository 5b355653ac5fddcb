"""Assignment of a log's columns to time and the temperatures of springs A and B: by the user, by contract, or by guess.

A column that the user names is taken by that name. Without such a name the contract's own name counts (``time_s``,
``temp_a_c``, ``temp_b_c``), and if this name is missing an unambiguous one: "Time", "Temp A (°C)". A channel's number
does not identify a spring, so that no spring is ever guessed from it.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from sync.log.column_units import AMPERE, CELSIUS, SECONDS, Unit, split_unit, unit_of
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.kinds import TABLE_KINDS, other_kind, table_kind
from torsight.core.files.storage import check_keys
from torsight.core.frozen import Frozen

CONTRACT: Final = {
    "time": "time_s",
    "a": "temp_a_c",
    "b": "temp_b_c",
    "heat_a": "heat_a",
    "heat_b": "heat_b",
    "current_a": "current_a_a",
    "current_b": "current_b_a",
}
"""Roles of columns (the keys of ``[temperature] columns``) and their names in ``TEMPS.csv``."""
NEEDED: Final = ("time", "a", "b")
DATE: Final = "date"
"""Role of a column with the date where the time of day is in another column."""
ROLES: Final = (*CONTRACT, DATE)
_KIND: Final = {"time": SECONDS, "a": CELSIUS, "b": CELSIUS, "current_a": AMPERE, "current_b": AMPERE}
"""Unit of the contract by role, for roles that have one."""

_PLAIN_TIMES: Final = frozenset((
    *("time", "timestamp", "time stamp", "date time", "datetime", "date and time", "elapsed", "elapsed time"),
    *("relative time", "scan time", "sample time", "log time", "x value", "uptime"),
    *("millis", "millisecond", "milliseconds", "second", "seconds", "sec"),
))  # fmt: skip
ARRIVED: Final = "arrived"
"""Name of the column of times at which a serial monitor received the lines; the time where there is no other."""
_LESS_PLAIN_TIMES: Final[tuple[list[str], ...]] = (["date"], [ARRIVED], [])
"""Names of columns that may be the time where no other is: a date with its time, or a first column without a name."""
_SENSOR_WORDS: Final = frozenset((
    *("temp", "temperature", "t", "tc", "thermocouple", "thermistor", "sensor", "probe", "spring", "wire"),
    *("channel", "chan", "ch"),
))  # fmt: skip
_SWITCH_WORDS: Final = frozenset(("heat", "heater", "heating", "relay", "switch"))
_OTHER_WORDS: Final = frozenset((
    *("alarm", "current", "power", "voltage", "volt", "volts", "pwm", "duty", "room", "ambient"),
    *("set", "setpoint", "target", "reference", "min", "minimum", "max", "maximum", "std", "dev", "deviation"),
    *("variance", "error"),
))  # fmt: skip
"""Words that exclude a column from being the temperature of a spring, whatever else its name contains."""
_WORDS: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_ENTRY: Final = re.compile(r",(?=\s*[A-Za-z_]+\s*=)")


@dataclass(frozen=True, slots=True)
class LogColumn:
    """A column of a log that is used: its name as the header spells it, and its index, from 0.

    ``unit`` comes from the header, a row below the header or the user; None: not stated, that of the contract.
    ``guessed`` is true where the role follows from the name alone.
    """

    name: str
    index: int
    unit: Unit | None = None
    guessed: bool = False

    def to_json(self) -> dict[str, object]:
        """Return the column's form in ``sync.json``."""
        return {"name": self.name, "unit": None if self.unit is None else self.unit.name, "guessed": self.guessed}


@dataclass(frozen=True, slots=True)
class ChosenColumns(Frozen):
    """The user's names and units of a log's columns, by the roles :data:`ROLES`."""

    names: Mapping[str, str]
    units: Mapping[str, Unit]

    @property
    def required(self) -> tuple[str, ...]:
        """Roles whose columns must exist: those that the model needs, and those that the user named."""
        return tuple(role for role in ROLES if role in NEEDED or role in self.names)


NOTHING_CHOSEN: Final = ChosenColumns({}, {})


def chosen_columns(
    columns: Mapping[str, Any] | None, units: Mapping[str, Any] | None = None, *, where: str = "columns"
) -> ChosenColumns:
    """Return the user's names and units of a log's columns, checked."""
    names, spelled = dict(columns or {}), dict(units or {})
    check_keys(names, ROLES, where=f"{where}, columns")
    check_keys(spelled, ROLES, where=f"{where}, units")
    for role, name in names.items():
        if not isinstance(name, str) or not name.strip():
            raise ConfigError(
                f"'{role}' names no column",
                where=where,
                value=repr(name),
                limit="the column's name in the log's header",
            )
    for name in names.values():
        sharing = [role for role, other in names.items() if other == name]
        if len(sharing) > 1:
            raise ConfigError(
                f"'{sharing[0]}' and '{sharing[1]}' name one column",
                where=where,
                value=repr(name),
                limit="a column for each",
                do="name another for one of them; two columns of one name need names of their own in the log's header",
            )
    found: dict[str, Unit] = {}
    for role, text in spelled.items():
        unit = unit_of(text) if isinstance(text, str) else None
        needed = _KIND.get(role)
        if unit is None or needed is None or unit.kind != needed.kind:
            allowed = {"time": "s, ms, µs, min, h, d", "temperature": "°C, °F, K", "current": "A, mA"}
            limit = "no unit" if needed is None else allowed[needed.kind]
            raise ConfigError(f"unit of '{role}' is not known", where=where, value=repr(text), limit=limit)
        found[role] = unit
    return ChosenColumns({role: name.strip() for role, name in names.items()}, found)


def parse_entries(text: str | None, *, option: str) -> dict[str, str]:
    """Return ``{"time": "Time", "a": "Temp A (°C)"}`` for ``time=Time,a=Temp A (°C)``; empty for None."""
    entries: dict[str, str] = {}
    for entry in _ENTRY.split(text) if text is not None else ():
        key, sign, value = (part.strip() for part in entry.partition("="))
        if not sign or not value or key in entries:
            raise ConfigError(
                "is no list of columns", where=option, value=repr(entry), limit='"time=NAME,a=NAME,b=NAME", each once'
            )
        entries[key] = value
    return entries


def resolve(header: Sequence[str], chosen: ChosenColumns = NOTHING_CHOSEN) -> dict[str, LogColumn | InputError]:
    """Return the column of a header for each role, or an error; roles without any candidate column are left out."""
    found: dict[str, LogColumn | InputError] = {}
    taken: set[int] = set()
    for guess in (False, True):
        for role in ROLES:
            if role in found or (guess and (role in chosen.names or header.count(CONTRACT.get(role, "")) > 0)):
                continue
            places = _guesses(role, header, taken, chosen) if guess else _named(role, header, chosen)
            if len(places) > 1:
                found[role] = _ambiguous(role, [header[place] for place in places], chosen)
            elif places:
                found[role] = _column(role, header[places[0]], places[0], chosen, guessed=guess)
                taken.add(places[0])
    if DATE in found and "time" not in found:
        found["time"] = found.pop(DATE)
    return found


def _named(role: str, header: Sequence[str], chosen: ChosenColumns) -> list[int]:
    """Return the indices of columns with the name by user or contract; without any, those of its other spellings."""
    name = chosen.names.get(role)
    if name is None:
        return [index for index, one in enumerate(header) if one == CONTRACT.get(role)]
    tests = (lambda one: one, _folded, lambda one: _folded(split_unit(one)[0]))
    for spelling in tests:
        places = [index for index, one in enumerate(header) if spelling(one) == spelling(name)]
        if places:
            return places
    return []


def _folded(name: str) -> str:
    """Return a name without the usual variations of spelling: case, blanks, degree signs."""
    return re.sub(r"[\s_°º˚]+", " ", name).strip().casefold()


def _guesses(role: str, header: Sequence[str], taken: set[int], chosen: ChosenColumns) -> list[int]:
    if role == DATE:
        return [] if "time" in chosen.names else _places(header, taken, lambda words, _unit: words == ["date"])
    if role == "time":
        # A unit may be stated twice: "time_s (ms)".
        bare = [split_unit(split_unit(name)[0])[0] for name in header]
        return _places(bare, taken, lambda words, _unit: " ".join(words) in _PLAIN_TIMES) or _less_plain_time(header)
    if role in NEEDED:
        return _places(header, taken, lambda words, unit: _says_temperature(words, unit, role))
    if role in ("heat_a", "heat_b"):
        return _places(header, taken, lambda words, unit: unit is None and _says_switch(words, role[-1]))
    return []


def _less_plain_time(header: Sequence[str]) -> list[int]:
    for wanted in _LESS_PLAIN_TIMES:
        places = [index for index, name in enumerate(header) if _words(name) == wanted and (wanted or index == 0)]
        if places:
            return places
    return []


def _places(header: Sequence[str], taken: set[int], says: Any) -> list[int]:
    parts = [split_unit(name) for name in header]
    return [index for index, (name, unit) in enumerate(parts) if index not in taken and says(_words(name), unit)]


def _words(name: str) -> list[str]:
    """Return the words of a name in lower case: those of ``TempA``, ``temp_a`` and ``Temp. A`` are the same."""
    return [word.lower() for word in _WORDS.findall(name)]


def _says_temperature(words: Sequence[str], unit: Unit | None, spring: str) -> bool:
    if spring not in words or len({"a", "b"} & set(words)) > 1 or set(words) & (_OTHER_WORDS | _SWITCH_WORDS):
        return False
    kind = None if unit is None else unit.kind
    return kind == "temperature" or (kind is None and (len(words) == 1 or bool(_SENSOR_WORDS & set(words))))


def _says_switch(words: Sequence[str], spring: str) -> bool:
    return spring in words and bool(_SWITCH_WORDS & set(words)) and not _OTHER_WORDS & set(words)


def _ambiguous(role: str, names: Sequence[str], chosen: ChosenColumns) -> InputError:
    if len(set(names)) < len(names):
        return InputError(
            "two columns have one name", value=repr(names[0]), do="give the columns that are used a name each"
        )
    if role in chosen.names:
        return InputError(f"two columns are called like '{chosen.names[role]}'", value=", ".join(names))
    return InputError(
        f"more than one column may be {_spoken(role)}",
        value=", ".join(repr(name) for name in names),
        do=f'say which: --columns "{role}={names[0]}", or [temperature] columns',
    )


def _column(role: str, name: str, index: int, chosen: ChosenColumns, *, guessed: bool) -> LogColumn | InputError:
    """Return a column with its unit, or the error for a unit that its role cannot have."""
    bare, unit = split_unit(name)
    inner = split_unit(bare)[1]
    column = LogColumn(name, index, None, guessed)
    for one in (inner, unit, chosen.units.get(role)):
        if one is not None:
            column = with_unit(column, one, role)
            if isinstance(column, InputError):
                return column
    return column


def with_unit(column: LogColumn, unit: Unit, role: str) -> Any:
    """Return the column with the unit from a row below the header or from the user, or an error if units contradict."""
    needed = _KIND.get(role)
    if role == DATE or (needed is None and unit.kind == "other"):
        return column
    if needed is None or unit.kind != needed.kind:
        return InputError(
            f"column '{column.name}' is in {unit.name}, and that is no unit of {_spoken(role)}",
            value=unit.name,
            limit=None if needed is None else f"a unit of {needed.kind}",
            do="name another column in --columns or [temperature] columns",
        )
    if column.unit is not None and column.unit != unit:
        return InputError(
            f"column '{column.name}' is said to be in {column.unit.name} and in {unit.name}",
            value=f"{column.unit.name} and {unit.name}",
            do="correct the header, or the units that are given with --units or [temperature] units",
        )
    return replace(column, unit=unit)


def _spoken(role: str) -> str:
    if role in ("a", "b"):
        return f"the temperature of spring {role.upper()}"
    if role in ("heat_a", "heat_b", "current_a", "current_b"):
        return f"the {'heating switch' if role[0] == 'h' else 'current'} of spring {role[-1].upper()}"
    return f"the {role}"


def missing_column(header: Sequence[str], chosen: ChosenColumns, role: str, *, where: str) -> InputError:
    """Return the error for a missing column, with the most similar name or with the option that names columns."""
    name = chosen.names.get(role, CONTRACT.get(role, role))
    shown = ", ".join(header[:12])[:200]
    if role in chosen.names:
        taken = {place for other in chosen.names if other != role for place in _named(other, header, chosen)}
        folded = {_folded(one): one for place, one in enumerate(header) if place not in taken}
        near = difflib.get_close_matches(_folded(name), folded, n=1)
        hint = f"did you mean '{folded[near[0]]}'?" if near else "name a column of the header"
        return InputError(f"has no column '{name}'", where=where, value=shown, do=f"it is named for {role}: {hint}")
    other = table_kind(header)
    if other is not None and not chosen.names:
        return other_kind(InputError, other, TABLE_KINDS["log"], where=where)
    if header and all(re.fullmatch(r"[-+]?\d+([.,]\d+)?", field) for field in header):
        line = ",".join(CONTRACT[one] for one in NEEDED)
        do = f"write a line like '{line}' above the numbers, in the order of the columns"
        return InputError("has no header", where=where, value=shown, do=do)
    # A column that is needed itself keeps its name.
    other_names = [one for one in header if one not in CONTRACT.values()]
    near = difflib.get_close_matches(name, other_names, n=1, cutoff=0.8)
    example = ",".join(f"{one}=NAME" for one in NEEDED)
    hint = f"rename '{near[0]}', or " if near else ""
    do = f'{hint}say which columns to use: --columns "{example}", or [temperature] columns of an experiment'
    return InputError(f"has no column '{name}'", where=where, value=shown, do=do)


def columns_note(columns: Mapping[str, LogColumn]) -> str | None:
    """Return a sentence on columns that were guessed or converted; None where there are none."""
    guessed = any(column.guessed for column in columns.values())
    converted = [role for role, column in columns.items() if is_converted(column)]
    if not guessed and not converted:
        return None
    words = []
    for role, column in columns.items():
        unit = "" if column.unit is None or not is_converted(column) else f", {column.unit.name} converted"
        name = f"'{column.name}'" if column.name else "the first column, which has no name and is taken as seconds"
        words.append(f"{_spoken(role).removeprefix('the ')} from {name}{unit}")
    where = "; guessed from the names, --columns or [temperature] columns say otherwise" if guessed else ""
    return f"columns of the log: {', '.join(words)}{where}"


def is_converted(column: LogColumn) -> bool:
    """Return whether a column's numbers need a conversion to the contract's unit."""
    return column.unit is not None and (column.unit.factor, column.unit.offset) != (1.0, 0.0)
