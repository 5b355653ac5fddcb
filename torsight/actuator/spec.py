"""The actuator's characterised values: reading ``ACTUATOR.toml``, checking physical order, parameters of a fit.

Values stay in the public units that their names end in; :class:`torsight.actuator.springs.Rig` converts them once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from torsight.actuator.springs import SPRING_B, common, own_of_b, values_of_b
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_table
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.frozen import Frozen
from torsight.core.parameter import Parameter
from torsight.core.series import rounding_variance


@dataclass(frozen=True, slots=True)
class _Key:
    """One key: table, unit, range, what to do about a value outside of it; the paper's symbol, title, reference rig."""

    table: str
    unit: str
    lower: float
    upper: float
    hint: str
    symbol: str
    title: str
    reference: float | None = None

    def number(self, table: Mapping[str, Any], name: str, *, where: str) -> float:
        """Return the value of a name in a table, checked against the range of the key."""
        return get_number(table, name, where=where, lower=self.lower, upper=self.upper, hint=self.hint)


_GPA: Final = "give it in GPa, not Pa or MPa"
_CELSIUS: Final = "give it in °C, not kelvin"
_MPA: Final = "give it in MPa/K, not Pa/K"
_MM: Final = "give it in mm"
_DEGREES: Final = "give it in degrees, not radians"

KEYS: Final[Mapping[str, _Key]] = {
    "wire_diameter_mm": _Key("geometry", "mm", 0.01, 20.0, _MM, "d", "wire diameter", 0.5),
    "wire_length_mm": _Key("geometry", "mm", 1.0, 1e4, _MM, "L", "wire length"),
    "mean_diameter_mm": _Key("geometry", "mm", 0.1, 500.0, _MM, "D", "mean coil diameter", 6.8),
    "active_coils": _Key("geometry", "", 0.25, 200.0, "count the coils that deform", "n", "active coils", 3.0),
    "E_A_gpa": _Key("material", "GPa", 1.0, 500.0, _GPA, "E_A", "modulus of austenite", 60.0),
    "E_M_gpa": _Key("material", "GPa", 1.0, 500.0, _GPA, "E_M", "modulus of martensite below the critical angle", 20.0),
    "E_S_gpa": _Key(
        "material", "GPa", 0.01, 500.0, _GPA, "E_S", "modulus of martensite beyond the critical angle", 5.0
    ),
    "A_s_c": _Key("material", "°C", -150.0, 200.0, _CELSIUS, "A_s", "austenite start", 36.0),
    "A_f_c": _Key("material", "°C", -150.0, 200.0, _CELSIUS, "A_f", "austenite finish", 54.0),
    "M_s_c": _Key("material", "°C", -150.0, 200.0, _CELSIUS, "M_s", "martensite start", 42.0),
    "M_f_c": _Key("material", "°C", -150.0, 200.0, _CELSIUS, "M_f", "martensite finish", 28.0),
    "C_A_mpa_per_k": _Key("material", "MPa/K", 0.5, 500.0, _MPA, "C_A", "stress coefficient of austenite", 32.0),
    "C_M_mpa_per_k": _Key("material", "MPa/K", 0.5, 500.0, _MPA, "C_M", "stress coefficient of martensite", 32.0),
    "theta_cr_deg": _Key("material", "°", 5.0, 5000.0, _DEGREES, "θ_cr", "critical angle", 180.0),
    "theta_p_deg": _Key("assembly", "°", 20.0, 20000.0, _DEGREES, "θ_P", "total winding of both springs", 1080.0),
    "tau_c_mnm": _Key("friction", "mN·m", 0.0, 1e4, "give it in mN·m", "τ_c", "friction torque", 0.79),
    "zero_deg": _Key("sticks", "°", -360.0, 360.0, _DEGREES, "φ_z", "zero of the sticks"),
}
"""Every key of ``ACTUATOR.toml`` with its table, its unit and the range outside which a value must be a mistake;
with its symbol in the paper (an underscore before an index), its meaning, and its value of the reference rig."""


def keys_of(*tables: str) -> tuple[str, ...]:
    """Return the keys of some tables, in their order."""
    return tuple(name for name, key in KEYS.items() if key.table in tables)


_OF_SPRINGS: Final = keys_of("geometry", "material")
ALL_KEYS: Final[Mapping[str, _Key]] = {**KEYS, **{SPRING_B + name: KEYS[name] for name in _OF_SPRINGS}}
"""``KEYS``, and the keys of values that may be given for spring B alone."""
_CHARACTERISED: Final = tuple(name for name in keys_of("material") if not name.startswith("C_"))
ZERO_SIGMA_DEG: Final = math.sqrt(rounding_variance(360.0))
"""Standard deviation of the sticks' zero where it was not measured: any direction is as likely."""

TABLES: Final = ("geometry", "material", "assembly", "friction", "sticks", "spring_b", "uncertainty")
_REQUIRED: Final = TABLES[:4]
_ORDERS: Final = (
    ("A_s_c", "A_f_c", "austenite starts to form below the temperature at which it is complete"),
    ("M_f_c", "M_s_c", "martensite is complete below the temperature at which it starts to form"),
    ("M_s_c", "A_f_c", "the hysteresis lies between the start of cooling's and the end of heating's transformation"),
    ("M_f_c", "A_s_c", "the hysteresis lies between the end of cooling's and the start of heating's transformation"),
    ("E_S_gpa", "E_M_gpa", "stress-induced martensite is the softest state"),
    ("E_M_gpa", "E_A_gpa", "austenite is stiffer than martensite"),
    ("theta_cr_deg", "theta_p_deg", "the critical angle lies below the total winding of both springs"),
)


@dataclass(frozen=True, slots=True, repr=False)
class ActuatorSpec(Frozen):
    """Characterised values of both springs and the rig, with their uncertainties.

    Attributes
    ----------
    values : mapping of str to float
        Value by public name, in the unit that the name ends in (``E_A_gpa``, ``tau_c_mnm``).
    uncertainty : mapping of str to float
        Standard deviations of the values that are not exact: the widths of their priors in a fit.
    source : str
        File that the values come from, for messages.
    """

    values: Mapping[str, float]
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    source: str = "actuator"

    def __post_init__(self) -> None:
        plain, own = common(self.values), own_of_b(self.values)
        check_keys(self.values, tuple(ALL_KEYS), where=f"{self.source}, values")
        check_keys(self.uncertainty, tuple(self.values), where=f"{self.source}, uncertainty")
        wire_keys(plain, where=f"{self.source}, [geometry]")
        for name in dict.fromkeys((*plain, *keys_of(*_REQUIRED[1:]))):
            KEYS[name].number(plain, name, where=f"{self.source}, [{KEYS[name].table}]")
        _check_sigmas(common(self.uncertainty), plain, where=f"{self.source}, [uncertainty]")
        check_order(plain, where=self.source)
        if own:
            where, whole = f"{self.source}, [spring_b]", values_of_b(self.values)
            wire_keys(whole, where=where)
            for name in own:
                KEYS[name].number(own, name, where=where)
            _check_sigmas(own_of_b(self.uncertainty), own, where=f"{self.source}, [spring_b.uncertainty]")
            check_order(whole, where=where)
        sigmas = {name: float(sigma) for name, sigma in self.uncertainty.items() if sigma > 0.0}
        object.__setattr__(self, "values", {name: float(value) for name, value in self.values.items()})
        object.__setattr__(self, "uncertainty", sigmas)
        Frozen.__post_init__(self)

    def __repr__(self) -> str:
        return f"ActuatorSpec({self.source}, {len(self.values)} values, {len(self.uncertainty)} with an uncertainty)"

    def parameters(self) -> tuple[Parameter, ...]:
        """Return all values as parameters; those with an uncertainty are free, and the friction torque always is.

        The sticks' zero is included, with the standard deviation :data:`ZERO_SIGMA_DEG` where it was not measured.
        """
        parameters = []
        zero = {} if "zero_deg" in self.values else {"zero_deg": 0.0}
        for name, value in {**self.values, **zero}.items():
            sigma = ZERO_SIGMA_DEG if name in zero else self.uncertainty.get(name)
            free = sigma is not None or name == "tau_c_mnm"
            bounds = fit_bounds(name, value, sigma) if free else (-math.inf, math.inf)
            parameters.append(Parameter(name, value, ALL_KEYS[name].unit, *bounds, sigma=sigma, fixed=not free))
        return tuple(parameters)

    @property
    def exact(self) -> tuple[str, ...]:
        """Names of the moduli, temperatures and the critical angle without an uncertainty, which count as exact."""
        return tuple(name for name in _CHARACTERISED if name in self.values and name not in self.uncertainty)

    def to_tables(self) -> dict[str, dict[str, Any]]:
        """Return the tables of ``ACTUATOR.toml``."""
        tables: dict[str, dict[str, Any]] = {name: {} for name in TABLES}
        for name, value in common(self.values).items():
            tables[KEYS[name].table][name] = float(value)
        tables["uncertainty"] = {name: float(sigma) for name, sigma in common(self.uncertainty).items()}
        tables["spring_b"] = {name: float(value) for name, value in own_of_b(self.values).items()}
        if own_sigmas := own_of_b(self.uncertainty):
            tables["spring_b"]["uncertainty"] = {name: float(sigma) for name, sigma in own_sigmas.items()}
        return {name: table for name, table in tables.items() if table}


def fit_bounds(name: str, value: float, sigma: float | None) -> tuple[float, float]:
    """Return the bounds of a value in a fit: 40 standard deviations to either side, within the range of its key.

    The bounds are wide on purpose: an estimate many standard deviations from the characterised value is a finding,
    which a bound would hide.
    """
    key = ALL_KEYS[name]
    if name == "tau_c_mnm":
        return 0.0, max(20.0 * value, 20.0 * (sigma or 0.0), 10.0)
    reach = 40.0 * (sigma or 0.0)
    return max(key.lower, value - reach), min(key.upper, value + reach)


def read_actuator(path: AnyPath) -> ActuatorSpec:
    """Read ``ACTUATOR.toml``.

    Raises
    ------
    ConfigError
        For an unknown or missing key, a value of the wrong kind, in the wrong unit or out of physical order.
    InputError
        When the file cannot be read.
    """
    path = Path(path)
    return actuator_from(read_toml(path, kind="actuator"), where=str(path))


def actuator_from(content: Mapping[str, Any], *, where: str) -> ActuatorSpec:
    """Return the spec given by the tables of ``ACTUATOR.toml``.

    Raises ConfigError as :func:`read_actuator`.
    """
    check_keys(content, TABLES, where=where)
    values: dict[str, float] = {}
    for name in (*_REQUIRED, "sticks"):
        table = get_table(content, name, where=where, required=name in _REQUIRED)
        check_keys(table, keys_of(name), where=f"{where}, [{name}]")
        values |= table
    for name in keys_of(*_REQUIRED[1:]):
        KEYS[name].number(values, name, where=f"{where}, [{KEYS[name].table}]")
    sigmas = _uncertainty(content, values, where=f"{where}, [uncertainty]")
    of_b = get_table(content, "spring_b", where=where)
    check_keys(of_b, (*_OF_SPRINGS, "uncertainty"), where=f"{where}, [spring_b]")
    own = {name: value for name, value in of_b.items() if name != "uncertainty"}
    own_sigmas = _uncertainty(of_b, own, where=f"{where}, [spring_b.uncertainty]")
    return ActuatorSpec(
        values={**values, **{SPRING_B + name: value for name, value in own.items()}},
        uncertainty={**sigmas, **{SPRING_B + name: sigma for name, sigma in own_sigmas.items()}},
        source=where,
    )


def wire_keys(table: Mapping[str, Any], *, where: str) -> tuple[str, ...]:
    """Return the keys that give a wire: its diameter with its length, or with number and mean diameter of its coils."""
    coils = ("mean_diameter_mm", "active_coils")
    given = [name for name in coils if name in table]
    if given and "wire_length_mm" in table:
        raise ConfigError(
            f"'wire_length_mm' and '{given[0]}' both determine the length of the wire",
            where=where,
            limit="wire_length_mm, or mean_diameter_mm with active_coils",
            do="remove one of them",
        )
    if not given and "wire_length_mm" not in table:
        raise ConfigError(
            "has no key 'wire_length_mm'", where=where, do="add it, or mean_diameter_mm with active_coils"
        )
    keys = ("wire_diameter_mm", *(coils if given else ("wire_length_mm",)))
    for name in keys:
        KEYS[name].number(table, name, where=where)
    return keys


def _uncertainty(content: Mapping[str, Any], values: Mapping[str, float], *, where: str) -> Mapping[str, Any]:
    """Return the table of standard deviations, each of one of the values."""
    table = get_table(content, "uncertainty", where=where)
    for name in table:
        if name in KEYS and name not in values:
            raise ConfigError(
                f"'{name}' has a standard deviation and no value",
                where=where,
                limit=", ".join(values) or "none",
                do=f"give the value beside it, too, or remove '{name}'",
            )
    check_keys(table, tuple(values), where=where)
    return table


def _check_sigmas(sigmas: Mapping[str, Any], values: Mapping[str, float], *, where: str) -> None:
    """Refuse what is no standard deviation of a value; one larger than the value is in another unit.

    The friction torque is a start value, which may be far from the truth, or zero.
    """
    for name in sigmas:
        key = KEYS[name]
        upper = 30.0 if key.unit == "°C" else max(abs(values[name]), 1e-3)
        if name == "zero_deg":
            upper = key.upper
        elif name == "tau_c_mnm":
            upper = min(10.0 * values[name], key.upper) or key.upper
        hint = f"one standard deviation, in the value's unit; the value is {values[name]:g} {key.unit}".rstrip()
        get_number(sigmas, name, where=where, lower=0.0, upper=upper, hint=hint)


def check_order(values: Mapping[str, float], *, where: str) -> None:
    """Refuse values out of physical order."""
    for low, high, why in _ORDERS:
        if not values[low] < values[high]:
            raise ConfigError(
                f"'{low}' is not below '{high}' ({why})",
                where=where,
                value=f"{low} = {values[low]:g}, {high} = {values[high]:g}",
                limit=f"{low} < {high}",
                do="check the two values and their units",
            )


REFERENCE_VALUES: Final[Mapping[str, float]] = {
    name: key.reference for name, key in KEYS.items() if key.reference is not None
}
"""The reference rig: chosen to satisfy every number in the paper's text, whose tables are lost."""

REFERENCE_UNCERTAINTY: Final[Mapping[str, float]] = {
    "E_A_gpa": 1.8, "E_M_gpa": 0.8, "E_S_gpa": 0.25, "theta_cr_deg": 5.4,
    "A_s_c": 0.4, "A_f_c": 0.4, "M_s_c": 0.6, "M_f_c": 0.6, "tau_c_mnm": 0.3,
}  # fmt: skip
"""Usual errors of characterised values (3 to 5 % of moduli, 3 % of the critical angle, 0.4 and 0.6 °C)."""


def reference_spec() -> ActuatorSpec:
    """Return the reference rig with the usual uncertainties."""
    return ActuatorSpec(values=REFERENCE_VALUES, uncertainty=REFERENCE_UNCERTAINTY, source="reference rig")
