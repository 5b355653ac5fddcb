"""Units as headers of logs write them: times in seconds, milliseconds, minutes, ..., temperatures in °C, °F or K.

A unit follows the name in brackets (``Temp A (°C)``, ``Time [ms]``) or after a slash or a comma (``T_A / °C``), ends
the name (``time_ms``, ``Temp A °F``), or is in a separate row below the header.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal["time", "temperature", "current", "other"]


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a column, with its conversion to the contract's unit (s, °C, A): ``number · factor + offset``."""

    name: str
    kind: Kind
    factor: float = 1.0
    offset: float = 0.0


_TIMES: Final = {
    "s": (1.0, "s sec secs second seconds"),
    "ms": (1e-3, "ms msec msecs millis millisecond milliseconds"),
    "µs": (1e-6, "µs μs us usec micros microsecond microseconds"),
    "min": (60.0, "min mins minute minutes"),
    "h": (3600.0, "h hr hrs hour hours"),
    "d": (86400.0, "d day days"),
}
_OTHERS: Final = "v mv µv vdc vac volt volts ohm ohms ω kω w mw hz khz % %rh bar mbar pa kpa hpa psi mm m n rpm lux"

SECONDS: Final = Unit("s", "time")
CELSIUS: Final = Unit("°C", "temperature")
AMPERE: Final = Unit("A", "current")
_FAHRENHEIT: Final = Unit("°F", "temperature", 5.0 / 9.0, -32.0 * 5.0 / 9.0)
_KELVIN: Final = Unit("K", "temperature", 1.0, -273.15)
_UNITS: Final[dict[str, Unit]] = {
    **{word: Unit(name, "time", factor) for name, (factor, words) in _TIMES.items() for word in words.split()},
    **dict.fromkeys(("c", "celsius", "centigrade"), CELSIUS),
    **dict.fromkeys(("f", "fahrenheit"), _FAHRENHEIT),
    **dict.fromkeys(("k", "kelvin"), _KELVIN),
    **dict.fromkeys(("a", "amp", "amps", "ampere"), AMPERE),
    "ma": Unit("mA", "current", 1e-3),
    **{word: Unit(word, "other") for word in _OTHERS.split()},
}
_DEGREE: Final = re.compile(r"[°º˚�]|deg(?:rees?|\.)?(?![a-bd-eg-jl-z])\s*|Â", flags=re.IGNORECASE)
"""Spellings of a degree sign, and the remains of one that was decoded wrongly."""
_BRACKETS: Final = re.compile(r"^(?P<name>.*?)\s*[(\[{]\s*(?P<unit>[^()\[\]{}]*?)\s*[)\]}]\s*$")
_PARTED: Final = re.compile(r"^(?P<name>.+?)(?:\s*/\s*|\s*,\s+|\s+in\s+)(?P<unit>[^/,]+)$")
_WITH_DEGREE: Final = re.compile(
    r"^(?P<name>.*?)[\s_]*(?P<unit>[°º˚�]\s*[CFK]|℃|℉|deg\s?[CFK])\s*$", flags=re.IGNORECASE
)
_SUFFIX: Final = re.compile(r"^(?P<name>.+)_(?P<unit>[A-Za-zµμ]+)$")
_TIME_WORD: Final = re.compile(r"time|elapsed|stamp|clock|uptime", flags=re.IGNORECASE)
_TEMPERATURE_WORD: Final = re.compile(r"temp", flags=re.IGNORECASE)


def unit_of(text: str) -> Unit | None:
    """Return the unit that a text spells; None if it is no known unit."""
    plain = text.strip().strip("()[]").replace("℃", "C").replace("℉", "F")
    plain = _DEGREE.sub("", plain).strip().lower()
    return _UNITS.get(plain)


def split_unit(header: str) -> tuple[str, Unit | None]:
    """Return a header's name without its unit, and the unit; None where the header states none.

    A letter or word after an underscore counts as a unit only if the name states the quantity: ``temp_a_c`` is in °C
    and ``time_ms`` in ms, but the ``a`` of ``temp_a`` is no ampere and the ``k`` of ``thermocouple_k`` no kelvin.
    """
    whole = unit_of(header)
    if whole is not None and whole.kind == "time" and len(header.strip()) > 1:
        return header.strip(), whole
    for pattern in (_BRACKETS, _PARTED, _WITH_DEGREE):
        found = pattern.match(header)
        if found is not None:
            unit = unit_of(found["unit"])
            # "Temp (A)" is the temperature of spring A, not a current.
            if unit is not None and not (unit.kind == "current" and _TEMPERATURE_WORD.search(found["name"])):
                return found["name"].strip(), unit
    found = _SUFFIX.match(header.strip())
    if found is not None:
        unit = unit_of(found["unit"])
        word = {"time": _TIME_WORD, "temperature": _TEMPERATURE_WORD}.get(unit.kind if unit else "")
        if word is not None and word.search(found["name"]):
            return found["name"], unit
    return header.strip(), None
