"""What the rigs of the blind suite hide: laws drawn at random, and the library's effects in several forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from blind_rig import ROOM_C, Array, DrawnRig, Hidden, Run, on_log_clock
from cases import LIBRARY, Draw
from drawn_laws import draw_law
from shown import shown

from torsight.core.units import DEG, MNM
from torsight.synthetic.effects.rig_laws import RigLaw
from torsight.synthetic.rig.rig_values import declared_from, rig_values

Key = tuple[str, str]

_WITHIN: Final = 0.1


class Place(NamedTuple):
    """Where a hidden law acts, as an answer may say it; names that are members of the same family; springs.

    ``steepest`` bounds the slope in units of the driver as the rig has it, ``most`` the size.
    """

    ports: tuple[str, ...]
    drivers: tuple[str, ...]
    names: tuple[str, ...]
    most: float
    springs: tuple[str, ...] = ("both",)


PLACES: Final[Mapping[Key, Place]] = {
    ("torque", "angle"): Place(
        ("torque",), ("angle_deg",), ("gravity", "stray_torque", "local_torque", "end_stop", "end_stops"), 1.0 * MNM
    ),
    ("friction", "angle"): Place(("friction",), ("angle_deg",), ("position_friction",), 0.85),
    ("friction", "temperature"): Place(("friction",), ("temp_active_c",), ("warm_friction",), 0.85),
    ("friction", "rate"): Place(("friction",), ("angle_rate_deg_s",), ("viscous_friction",), 4.0),
    ("friction", "dwell"): Place(("friction",), ("dwell_s",), ("static_friction",), 4.0),
    ("reading", "angle"): Place(("reading",), ("angle_deg",), ("eccentricity",), 30.0 * DEG),
    ("reading", "time"): Place(("reading",), ("time_s",), ("reading_drift",), 30.0 * DEG),
    ("temperature", "temperature"): Place(
        ("temperature",),
        ("temp_active_c", "temp_passive_c", "temp_c"),
        ("sensor_gain", "thermistor_curve"),
        6.0,
        ("a", "b", "both"),
    ),
    ("temperature", "temp_rate"): Place(
        ("temperature",), ("temp_rate_c_s",), ("sensor_lag",), 12.0, ("a", "b", "both")
    ),
    ("winding", "winding"): Place(("winding",), ("winding_deg",), ("stiffening",), 1.0 * MNM, ("a", "b", "both")),
    ("loading", "winding"): Place(
        ("loading", "winding"), ("winding_deg",), ("stiffening",), 1.0 * MNM, ("a", "b", "both")
    ),
    ("recoverable", "half_cycle"): Place(
        ("recoverable", "winding", "phase"), ("half_cycle", "cycle"), ("fatigue",), 0.4
    ),
    ("recoverable", "cycle"): Place(("recoverable", "winding", "phase"), ("cycle", "half_cycle"), ("fatigue",), 0.4),
    ("phase", "temperature"): Place(("phase",), ("temp_active_c",), (), 8.0),
    ("values", "spring"): Place(("values",), ("spring",), ("unlike_springs", "spring_values"), 1.0),
}
"""Where random laws act, by the rig's port and driver."""

PHASE: Final[Key] = ("phase", "temperature")
_BESIDE_C: Final = 3.0
"""How far past both windows a phase law of another shape differs: what is further off is no part of it."""
_STEEPEST: Final = {
    ("temperature", "temperature"): 0.6,
    ("phase", "temperature"): 0.9,
    # Of K_S: the springs' stiffness stays positive, and a loading curve nowhere as steep as K_M.
    ("torque", "angle"): 1.0,
    ("winding", "winding"): 0.8,
    ("loading", "winding"): 0.6,
}

FORMS: Final[Mapping[str, tuple[Draw, ...]]] = {
    "sensor_lag": (lambda _: {"lag_s": 6.0, "form": "two_stage"},),
    "sensor_gain": (lambda _: {"gain": 0.95, "form": "curved"},),
    "clock_offset": (lambda g: {"offset_s": float(g.choice([-3.0, 3.0])), "wander": g.uniform(0.3, 0.7)},),
    "heat_crosstalk": (lambda g: {"conductance_w_per_k": 0.02, "share": g.uniform(0.3, 0.7)},),
    "nonuniform_temperature": (lambda _: {"cooler_c": 8.0, "form": "profile"},),
    "coil_friction": (
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "quadratic"},
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "exponential"},
    ),
    "viscous_friction": (lambda _: {"viscous_mnm_s_per_rad": 5.0, "form": "power"},),
    "position_friction": (lambda g: {"amplitude": 0.3, "phase_rad": g.uniform(-3, 3), "form": "flattened"},),
    "stiffening": (
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "bend"},
        lambda g: {"rise_mnm": 0.2, "onset_deg": g.uniform(600, 680), "form": "quadratic"},
    ),
    "eccentricity": (lambda g: {"amplitude_deg": 2.0, "phase_rad": g.uniform(-3, 3), "form": "lever"},),
    "fatigue": (
        lambda g: {"loss": 0.05, "form": "saturating", "cycles": g.uniform(1, 3)},
        lambda g: {"loss": 0.05, "form": "plastic", "cycles": g.uniform(1, 3)},
    ),
    "marker_slip": (lambda g: {"step_deg": 4.0, "time_s": g.uniform(0.15, 0.85), "lasts_s": g.uniform(3, 20)},),
}
"""The library's effects in forms that are usual, too, and not the library's; the first number is the strength."""

_STRONGEST: Final = {
    "lag_s": 25.0, "gain": 0.75, "offset_s": 20.0, "conductance_w_per_k": 0.06, "cooler_c": 25.0, "rise_mnm": 2.0,
    "viscous_mnm_s_per_rad": 60.0, "amplitude": 0.9, "amplitude_deg": 15.0, "loss": 0.3, "step_deg": 25.0,
}  # fmt: skip
"""Largest strength, by its key (a gain: the smallest)."""


def drawn_effect(name: str, kind: str, rng: np.random.Generator, duration_s: float) -> dict[str, object]:
    """Draw an effect's numbers: in another usual form, in the library's range of forms, or (pairs) in either."""
    other = kind == "form" or (kind == "pair" and rng.random() < 0.5)
    choice = FORMS[name][int(rng.integers(len(FORMS[name])))] if other else LIBRARY[name]
    made = {key: str(value) if isinstance(value, str) else float(str(value)) for key, value in choice(rng).items()}
    if kind == "single" and "form" in made:
        del made["form"]
    if name == "marker_slip":
        made = {"step_deg": made["step_deg"], **made, "time_s": float(made["time_s"]) * duration_s}
    return dict(made)


_MOST_TRIES: Final = 12


def factor_for(wanted: float, change: Callable[[float], float], *, first: float, most: float, within: float) -> float:
    """Return the factor at which a change has the wanted size; ``most`` where it stays below it.

    Parameters
    ----------
    wanted : float
        Size of the change.
    change : callable
        Size for a factor; it grows with it, about.
    first, most : float
        A guess, and the largest factor allowed.
    within : float
        Relative error of the size that is good enough.
    """
    low, high, factor = 0.0, most, min(first, most)
    for _ in range(_MOST_TRIES):
        size = change(factor)
        if abs(size / wanted - 1.0) < within or (size < wanted and factor >= most):
            return factor
        low, high = (factor, high) if size < wanted else (low, factor)
        # In proportion where that stays between the bounds, else the middle.
        guess = factor * wanted / max(size, 1e-3 * wanted)
        factor = min(guess, most) if low < guess < high or guess >= most == high else 0.5 * (low + high)
    return factor


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Something hidden as a function of its strength, and the strength to begin with and the largest one.

    ``at`` takes the strength and the share of it that acts: at 0 the rig is as it would be without the piece, and that
    is the plain rig if the piece ``leaves_nothing`` there.
    """

    name: str
    at: Callable[[float, float], Hidden]
    first: float
    most: float
    leaves_nothing: bool = True

    def sized(self, rig: DrawnRig, plain: Run, *, wanted_deg: float) -> tuple[float, float]:
        """Return the strength that makes the wanted size, and the size."""
        sizes: dict[float, float] = {}

        def size(factor: float) -> float:
            without = plain.angle_deg if self.leaves_nothing else on_log_clock(rig, self.at(factor, 0.0))
            change = on_log_clock(rig, self.at(factor, 1.0)) - without
            sizes[factor] = float(np.sqrt(np.mean(change**2)))
            return sizes[factor]

        factor = factor_for(wanted_deg, size, first=self.first, most=self.most, within=_WITHIN)
        return factor, sizes.get(factor) or size(factor)


def effect_piece(name: str, drawn: Mapping[str, object]) -> Piece:
    """Return an effect whose first number is its strength."""
    strength = next(iter(drawn))
    null = 1.0 if strength == "gain" else 0.0
    own = float(str(drawn[strength])) - null

    def at(factor: float, acts: float) -> Hidden:
        return {name: {**drawn, strength: null + factor * acts * own}}, ()

    def crosstalk(factor: float, acts: float) -> Hidden:
        # Heat that passes between the wires is in the log: only what the other spring's transformation does is hidden.
        warm = acts * float(str(drawn.get("share", 1.0)))
        return {name: {**drawn, strength: factor * own, "share": warm}}, ()

    most = abs(_STRONGEST[strength] - null) / abs(own)
    if name == "heat_crosstalk":
        return Piece(name, crosstalk, first=1.0, most=most, leaves_nothing=False)
    return Piece(name, at, first=1.0, most=most)


def law_piece(place: Key, rng: np.random.Generator, rig: DrawnRig, plain: Run) -> Piece:
    """Return a random law; springs of unlike values stand as an effect of the rig."""
    rule, name = PLACES[place], "-over-".join(place)
    if place == ("values", "spring"):
        a, m, e = rng.uniform(-1.0, 1.0, 3).tolist()

        def unlike(by: float) -> dict[str, float]:
            return {"a_shift_c": 4 * by * a, "m_shift_c": 4 * by * m, "modulus_scale": 1 + 0.2 * by * e}

        return Piece(
            name,
            lambda factor, acts: ({"unlike_springs": unlike(factor * acts)}, ()),
            first=0.2,
            most=rule.most,
        )
    start, stop = _range(place, plain, rig)
    law = draw_law(*place, start=start, stop=stop, rng=rng, spring=str(rng.choice(rule.springs)))
    unit = rig.values.rig.k_stress_induced if place[1] in ("angle", "winding") else 1.0
    slope = float(np.max(np.abs(np.gradient(law.values)))) * (len(law.values) - 1) / (stop - start)
    most = min(rule.most, _STEEPEST.get(place, np.inf) * unit / slope)
    return Piece(name, lambda factor, acts: ({}, (law.scaled(factor * acts),)), first=0.1 * most, most=most)


def together(pieces: Sequence[Piece], factors: Sequence[float], acting: Sequence[float]) -> Hidden:
    """Return all pieces at their strengths, each with the share of it that acts."""
    details: dict[str, Mapping[str, object]] = {}
    laws: tuple[RigLaw, ...] = ()
    for piece, factor, acts in zip(pieces, factors, acting, strict=True):
        own, more = piece.at(factor, acts)
        details, laws = details | dict(own), laws + more
    return details, laws


def shown_deg(rig: DrawnRig, pieces: Sequence[Piece], factors: Sequence[float]) -> dict[str, float]:
    """Return by how much each hidden piece shows beyond what values and the other pieces can imitate."""
    spread = declared_from(rig.declared, where="blind suite").uncertainty

    def angle_deg(off: Mapping[str, float], times: Sequence[float]) -> Array:
        values = {name: value + off.get(name, 0.0) for name, value in rig.values.public.items()}
        return on_log_clock(replace(rig, values=rig_values(values)), together(pieces, factors, times))

    return dict(zip((piece.name for piece in pieces), shown(angle_deg, spread, len(pieces)), strict=True))


def _range(place: Key, plain: Run, rig: DrawnRig) -> tuple[float, float]:
    """Return the range of a law's driver: what the rig without it goes through, record and later one."""
    signals = plain.signals
    angle_rad, half_rad = signals.angle_rad, 0.5 * rig.values.rig.theta_p_rad
    reach_rad = float(np.max(np.abs(angle_rad))) + 10.0 * DEG
    hottest_c = float(max(signals.wire_a_c.max(), signals.wire_b_c.max()))
    halves = float(signals.half_cycle.max() + 1)
    if place == PHASE:
        return rig.values.rig.m_finish_c - _BESIDE_C, rig.values.rig.a_finish_c + _BESIDE_C
    return {
        "angle": (-reach_rad, reach_rad),
        "temperature": (ROOM_C, hottest_c),
        "rate": (0.0, float(np.quantile(np.abs(signals.rate_rad_s), 0.999))),
        "dwell": (0.0, 300.0),
        "time": (0.0, float(signals.time_s[-1])),
        "temp_rate": (-1.4, 0.4),
        "winding": (half_rad - reach_rad, half_rad + reach_rad),
        "half_cycle": (0.0, halves - 1.0),
        "cycle": (0.0, 0.5 * halves - 1.0),
    }[place[1]]
