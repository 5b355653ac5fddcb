"""Constants of the rig for the compiled integrator: one flat record, with every effect at its null unless it is on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import lending, numbers
from torsight.core.units import DEG, Floats
from torsight.synthetic.effects.hidden import NonuniformTemperature
from torsight.synthetic.effects.mechanisms import HiddenEffect, UnlikeSprings
from torsight.synthetic.effects.rig_laws import NODES, SLOTS, RigLaw
from torsight.synthetic.keys import constants_of
from torsight.synthetic.rig.rig_values import RigValues

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
