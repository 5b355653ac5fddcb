"""True values of a rig's springs and friction, which differ from the declared values of ``actuator.toml``.

Symbols, equations and the reference values are those of the quasi-static model (section 3 of the paper); these are all
that the rig shares with the fitted model. The compiled integrator takes them as one flat record of constants, with
every effect at its null unless it is on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.spec import REFERENCE_UNCERTAINTY, REFERENCE_VALUES, actuator_from, keys_of
from torsight.actuator.springs import Rig, wire_length_mm
from torsight.core.compiled import lending, numbers
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_table
from torsight.core.files.storage import check_keys
from torsight.core.frozen import Frozen
from torsight.core.units import DEG, Floats
from torsight.synthetic.effects.hidden import NonuniformTemperature
from torsight.synthetic.effects.mechanisms import HiddenEffect, UnlikeSprings
from torsight.synthetic.effects.rig_laws import NODES, SLOTS, RigLaw
from torsight.synthetic.keys import constants_of

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
        numbers = {item: get_number(given, item, where=place) for item in given}
        wound = name == "geometry" and "mean_diameter_mm" in numbers
        base = {"wire_diameter_mm": REFERENCE["geometry"]["wire_diameter_mm"]} if wound else REFERENCE[name]
        tables[name] = {**base, **numbers}
    spread = table.get("uncertainty", UNCERTAINTY)
    if not isinstance(spread, Mapping):
        raise ConfigError("'uncertainty' is not a table", where=where, value=repr(spread))
    check_keys(spread, _KEYS, where=f"{where}, [uncertainty]")
    sigmas = {item: get_number(spread, item, where=f"{where}, [uncertainty]") for item in spread}
    declared = Declared(tables=tables, uncertainty=sigmas)
    # What is written as actuator.toml has to be one.
    actuator_from(declared.to_toml(), where=where)
    return declared


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


ONSET_SCALE_RAD: Final = 100.0 * DEG
"""Torques that grow past an onset are given at this distance from it."""


Constants: TypeAlias = Any
"""All numbers of one rig as a record, SI units and °C; forms are small integers (0 is the usual law)."""

_NUMBERS: Final = numbers(
    # Springs and friction.
    "k_a k_m k_s theta_cr theta_p stress_per_nm a_s a_width m_s m_width c_a c_m tau_c bristle "
    # Sections of a scene.
    "inertia damping room_c resistance capacity to_room to_body between body_capacity body_to_room gain_p gain_i "
    "current_max quantum_c "
    # Hidden effects.
    "between_more lag_s lag_b_s lag_stages sensor_gain sensor_form bulge_c crosstalk crosstalk_share zone_scale "
    "zone_form coil coil_onset coil_form viscous viscous_form position position_phase position_form stiff stiff_onset "
    "stiff_form fatigue fatigue_cycles fatigue_form creep creep_onset bias gravity gravity_phase grease static_excess "
    "static_ageing asymmetry r_step r_start r_width latent stop_low stop_high stop_stiffness imbalance local "
    "local_angle local_width local_form bend tanaka loop_memory c_a_scale c_m_scale drift_heating drift_cooling"
)
_ONES: Final = "lag_stages sensor_gain crosstalk_share fatigue_cycles creep_onset static_ageing r_width local_width"
_NULLS: Final = {
    **dict.fromkeys((*_ONES.split(), "c_a_scale", "c_m_scale"), 1.0),
    "zone_scale": 5.0,
    "stop_low": -1e9,
    "stop_high": 1e9,
}
"""Constants without their effects, where they are not zero."""


def to_records(
    constants: Mapping[str, float], effects: Mapping[str, HiddenEffect], laws: Sequence[RigLaw]
) -> NDArray[np.void]:
    """Return the constants as two records, with spring A's and with B's values, as the compiled functions take them.

    ``law`` holds each law's values on its nodes, one row per slot; a slot with ``law_step`` 0 is empty.
    """
    layout = [
        ("law", np.float64, (len(SLOTS), NODES)),
        *((name, np.float64, len(SLOTS)) for name in ("law_start", "law_step")),
    ]
    records = np.zeros(2, dtype=[*_NUMBERS.descr, *layout])
    for record, own in zip(records, (constants, _second(constants, effects)), strict=True):
        for name, value in {**_NULLS, **own}.items():
            record[name] = value
    for item in laws:
        if (item.port, item.driver) in SLOTS:
            row = SLOTS[item.port, item.driver]
            for number in {"a": (0,), "b": (1,), "both": (0, 1)}[item.spring]:
                records["law"][number, row] = item.on_nodes()
                records["law_start"][number, row] = item.start
                records["law_step"][number, row] = (item.stop - item.start) / (NODES - 1)
    return records


def _second(constants: Mapping[str, float], effects: Mapping[str, HiddenEffect]) -> Mapping[str, float]:
    """Return the constants with spring B's values."""
    effect = effects.get("unlike_springs")
    if not isinstance(effect, UnlikeSprings):
        return constants
    scaled = {name: constants[name] * effect.modulus_scale for name in ("k_a", "k_m", "k_s")}
    moved = {"a_s": constants["a_s"] + effect.a_shift_c, "m_s": constants["m_s"] + effect.m_shift_c}
    return {**constants, **scaled, **moved}


@lending
def has_law(c: Any, slot: int) -> bool:
    """Return whether a rig has a law in a slot."""
    return bool(c.law_step[slot] != 0.0)


@lending
def law(c: Any, slot: int, x: float) -> float:
    """Return a law's value, linear between nodes and constant beyond the ends; 0 where the slot is empty."""
    if not has_law(c, slot):
        return 0.0
    place = min(max((x - c.law_start[slot]) / c.law_step[slot], 0.0), NODES - 1.0)
    node = min(int(place), NODES - 2)
    part = place - node
    return float((1.0 - part) * c.law[slot, node] + part * c.law[slot, node + 1])


def pack(
    values: RigValues, sections: Iterable[Any], *, presliding_rad: float, effects: Mapping[str, HiddenEffect]
) -> dict[str, float]:
    """Return a rig's constants from its springs and friction, sections of the scene, and its hidden effects."""
    plain = {
        "k_a": values.rig.k_austenite,
        "k_m": values.rig.k_martensite,
        "k_s": values.rig.k_stress_induced,
        "theta_cr": values.rig.theta_cr_rad,
        "theta_p": values.rig.theta_p_rad,
        "stress_per_nm": values.rig.stress_per_torque,
        "a_s": values.rig.a_start_c,
        "a_width": values.rig.a_finish_c - values.rig.a_start_c,
        "m_s": values.rig.m_start_c,
        "m_width": values.rig.m_start_c - values.rig.m_finish_c,
        "c_a": values.rig.c_austenite,
        "c_m": values.rig.c_martensite,
        "tau_c": values.rig.tau_c_nm,
        "bristle": values.rig.tau_c_nm / presliding_rad,
    }
    for section in sections:
        plain |= constants_of(section)
    for effect in effects.values():
        plain |= effect.constants()
    return plain


def zones(effects: Mapping[str, HiddenEffect]) -> tuple[Floats, Floats]:
    """Return the weights of the wire's zones and their temperatures below that of the middle, °C."""
    effect = effects.get("nonuniform_temperature")
    if not isinstance(effect, NonuniformTemperature):
        return np.ones(1), np.zeros(1)
    if effect.form == "two_zone":
        return np.array([1.0 - effect.share, effect.share]), np.array([0.0, effect.cooler_c])
    # A parabola from the middle to the end, seven points of equal length.
    place = (np.arange(7, dtype=np.float64) + 0.5) / 7.0
    return np.full(7, 1.0 / 7.0), effect.cooler_c * place**2
