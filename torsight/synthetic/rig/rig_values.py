"""True values of a rig: what the springs and the friction are, as against what ``actuator.toml`` declares of them.

Symbols, equations and the reference values are those of the quasi-static model (section 3 of the paper); the rig
shares them with the model that is fitted, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from torsight.actuator.spec import KEYS, REFERENCE_UNCERTAINTY, REFERENCE_VALUES
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_table
from torsight.core.files.storage import check_keys
from torsight.core.frozen import Frozen
from torsight.core.units import DEG, GPA, MM, MNM, MPA

_WIRE_LENGTH_MM: Final = math.pi * REFERENCE_VALUES["mean_diameter_mm"] * REFERENCE_VALUES["active_coils"]
REFERENCE: Final[Mapping[str, Mapping[str, float]]] = {
    "geometry": {
        "wire_diameter_mm": REFERENCE_VALUES["wire_diameter_mm"],
        # As a lab would write it down: to a tenth of a millimetre.
        "wire_length_mm": round(_WIRE_LENGTH_MM, 1),
    },
    **{
        table: {name: REFERENCE_VALUES[name] for name, key in KEYS.items() if key.table == table}
        for table in ("material", "assembly", "friction")
    },
}
"""The reference rig, in the layout of ``actuator.toml``."""

UNCERTAINTY: Final[Mapping[str, float]] = {
    **REFERENCE_UNCERTAINTY,
    # No spring test measures the friction: its prior is a start value's, and rigs are built within half of it.
    "tau_c_mnm": 0.5 * REFERENCE_UNCERTAINTY["tau_c_mnm"],
}
"""By how much a rig's own values differ from the declared ones: one standard deviation of each."""

_GEOMETRY: Final = ("wire_diameter_mm", "wire_length_mm", "mean_diameter_mm", "active_coils")
_TABLES: Final[Mapping[str, tuple[str, ...]]] = {
    "geometry": _GEOMETRY,
    "material": tuple(REFERENCE["material"]),
    "assembly": ("theta_p_deg",),
    "friction": ("tau_c_mnm",),
}
_KEYS: Final = tuple(name for names in _TABLES.values() for name in names)
_SIGNED: Final = ("A_s_c", "A_f_c", "M_s_c", "M_f_c")


@dataclass(frozen=True, slots=True)
class Declared(Frozen):
    """What ``actuator.toml`` says of a rig.

    Attributes
    ----------
    tables : mapping
        The tables geometry, material, assembly and friction, in the file's units.
    uncertainty : mapping of str to float
        One standard deviation of each value that is not exact.
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
    """One rig in SI units.

    Attributes
    ----------
    stress_per_nm : float
        C2 (11).
    stiffness_a, stiffness_m, stiffness_s : float
        K_A, K_M, K_S (16, 17), N·m/rad.
    a_s_c, a_f_c, m_s_c, m_f_c : float
        Transformation temperatures without stress.
    c_a, c_m : float
        Stress influence, Pa/K.
    theta_cr_rad, theta_p_rad : float
        Onset of stress-induced martensite; total pre-deformation.
    friction_nm : float
        Coulomb friction torque.
    public : mapping of str to float
        The same values under the names and in the units of ``actuator.toml``.
    """

    stress_per_nm: float
    stiffness_a: float
    stiffness_m: float
    stiffness_s: float
    a_s_c: float
    a_f_c: float
    m_s_c: float
    m_f_c: float
    c_a: float
    c_m: float
    theta_cr_rad: float
    theta_p_rad: float
    friction_nm: float
    public: Mapping[str, float]


def declared_from(table: Mapping[str, Any], *, where: str) -> Declared:
    """Read the declared actuator from tables in the layout of ``actuator.toml``; what is absent is the reference rig's.

    Raises
    ------
    ConfigError
        For an unknown key or a value that is no number.
    """
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
    """Return the rig's own values: declared ones, each off by its uncertainty, and ``given`` ones as they are.

    Parameters
    ----------
    declared : Declared
        What ``actuator.toml`` says.
    given : mapping of str to float
        True values that are set, by the file's keys.
    rng : numpy Generator or None
        Draws the deviations (normal, within 2.5 standard deviations); None leaves the declared values.
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
    """Convert values under their public names to SI.

    Raises
    ------
    ConfigError
        When a transformation would start after its finish.
    """
    for start, finish in (("A_s_c", "A_f_c"), ("M_f_c", "M_s_c")):
        if public[start] >= public[finish]:
            raise ConfigError(
                f"'{finish}' is not above '{start}'",
                where="the rig's true values",
                value=f"{public[finish]:g} and {public[start]:g}",
                do="lower their [actuator.uncertainty], or set them in [rig.true]",
            )
    diameter_m = public["wire_diameter_mm"] * MM
    if "mean_diameter_mm" in public and "wire_length_mm" not in public:
        length_m = public["active_coils"] * math.pi * public["mean_diameter_mm"] * MM
    else:
        length_m = public["wire_length_mm"] * MM
    c1 = diameter_m / (2.0 * length_m)
    c2 = 32.0 / (math.pi * diameter_m**3)
    return RigValues(
        stress_per_nm=c2,
        stiffness_a=c1 / c2 * public["E_A_gpa"] * GPA,
        stiffness_m=c1 / c2 * public["E_M_gpa"] * GPA,
        stiffness_s=c1 / c2 * public["E_S_gpa"] * GPA,
        a_s_c=public["A_s_c"],
        a_f_c=public["A_f_c"],
        m_s_c=public["M_s_c"],
        m_f_c=public["M_f_c"],
        c_a=public["C_A_mpa_per_k"] * MPA,
        c_m=public["C_M_mpa_per_k"] * MPA,
        theta_cr_rad=public["theta_cr_deg"] * DEG,
        theta_p_rad=public["theta_p_deg"] * DEG,
        friction_nm=public["tau_c_mnm"] * MNM,
        public=dict(public),
    )
