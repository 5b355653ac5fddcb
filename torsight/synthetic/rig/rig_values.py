"""True values of a rig's springs and friction, which differ from the declared values of ``actuator.toml``.

Symbols, equations and the reference values are those of the quasi-static model (section 3 of the paper); these are all
that the rig shares with the fitted model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from torsight.actuator.spec import REFERENCE_UNCERTAINTY, REFERENCE_VALUES, keys_of
from torsight.actuator.springs import Rig, wire_length_mm
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_table
from torsight.core.files.storage import check_keys
from torsight.core.frozen import Frozen

REFERENCE: Final[Mapping[str, Mapping[str, float]]] = {
    "geometry": {
        "wire_diameter_mm": REFERENCE_VALUES["wire_diameter_mm"],
        # As a lab would write it down: to a tenth of a millimetre.
        "wire_length_mm": round(wire_length_mm(REFERENCE_VALUES), 1),
    },
    **{
        table: {name: REFERENCE_VALUES[name] for name in keys_of(table)}
        for table in ("material", "assembly", "friction")
    },
}
"""The reference rig, in the layout of ``actuator.toml``."""

UNCERTAINTY: Final[Mapping[str, float]] = {
    **REFERENCE_UNCERTAINTY,
    # No spring test measures the friction: its prior belongs to a start value, and rigs deviate by half of it.
    "tau_c_mnm": 0.5 * REFERENCE_UNCERTAINTY["tau_c_mnm"],
}
"""One standard deviation of the difference between each of a rig's own values and the declared one."""

_TABLES: Final[Mapping[str, tuple[str, ...]]] = {table: keys_of(table) for table in REFERENCE}
_KEYS: Final = tuple(name for names in _TABLES.values() for name in names)
_SIGNED: Final = ("A_s_c", "A_f_c", "M_s_c", "M_f_c")


@dataclass(frozen=True, slots=True)
class Declared(Frozen):
    """Declared values of a rig, as in ``actuator.toml``: geometry, material, assembly and friction in the file's units.

    They include one standard deviation of each value that is not exact.
    """

    tables: Mapping[str, Mapping[str, float]]
    uncertainty: Mapping[str, float]

    def flat(self) -> dict[str, float]:
        """Return all values by key."""
        return {name: value for table in self.tables.values() for name, value in table.items()}

    def to_toml(self) -> dict[str, Any]:
        """Return the content of ``actuator.toml``."""
        return {**{name: dict(table) for name, table in self.tables.items()}, "uncertainty": dict(self.uncertainty)}


@dataclass(frozen=True, slots=True)
class RigValues(Frozen):
    """True values of a rig: in SI, and by the names and in the units of ``actuator.toml``."""

    rig: Rig
    public: Mapping[str, float]


def declared_from(table: Mapping[str, Any], *, where: str) -> Declared:
    """Read the declared actuator from tables as in ``actuator.toml``; absent keys have the reference rig's values."""
    check_keys(table, (*_TABLES, "uncertainty"), where=where)
    tables: dict[str, dict[str, float]] = {}
    for name, keys in _TABLES.items():
        given = get_table(table, name, where=where)
        place = f"{where}, [{name}]"
        check_keys(given, keys, where=place)
        lower = -273.15 if name == "material" else 0.0
        numbers = {item: get_number(given, item, where=place, lower=lower) for item in given}
        wound = name == "geometry" and "mean_diameter_mm" in numbers
        base = {"wire_diameter_mm": REFERENCE["geometry"]["wire_diameter_mm"]} if wound else REFERENCE[name]
        tables[name] = {**base, **numbers}
    spread = table.get("uncertainty", UNCERTAINTY)
    if not isinstance(spread, Mapping):
        raise ConfigError("'uncertainty' is not a table", where=where, value=repr(spread))
    check_keys(spread, _KEYS, where=f"{where}, [uncertainty]")
    sigmas = {item: get_number(spread, item, where=f"{where}, [uncertainty]", lower=0.0) for item in spread}
    return Declared(tables=tables, uncertainty=sigmas)


def draw_values(declared: Declared, *, given: Mapping[str, float], rng: np.random.Generator | None) -> RigValues:
    """Return the rig's own values: the declared ones with random deviations by their uncertainty, or ``given`` ones.

    Deviations are normal, within 2.5 standard deviations; without ``rng`` the declared values stay.
    """
    values = declared.flat()
    for name, sigma in declared.uncertainty.items():
        # Drawn for every key in the file's order, so that one value set by hand does not change the others.
        deviation = 0.0 if rng is None else float(np.clip(rng.standard_normal(), -2.5, 2.5))
        values[name] += sigma * deviation
        if name not in _SIGNED:
            values[name] = max(values[name], 0.1 * declared.flat()[name])
    return rig_values({**values, **given})


def rig_values(public: Mapping[str, float]) -> RigValues:
    """Convert values under their public names to SI."""
    for start, finish in (("A_s_c", "A_f_c"), ("M_f_c", "M_s_c")):
        if public[start] >= public[finish]:
            raise ConfigError(
                f"'{finish}' is not above '{start}'",
                where="the rig's true values",
                value=f"{public[finish]:g} and {public[start]:g}",
                do="lower their [actuator.uncertainty], or set them in [rig.true]",
            )
    return RigValues(Rig.from_values(public), dict(public))
