# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""What the stepping rule is made of, compiled: the phase law, cold martensite's torque, friction.

``p`` holds the rig's scalars at the places named here, those of one spring among them. ``tables`` (9, m): torques over
θ^A (friction down and up, stray torque), over either spring's own angle (side torque, what its loading curve has beside
its two slopes; the rows stand in the spring's scalars, 0 where there is none), friction torque over the speed, and the
factor on friction over log10(1 + rest in s).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.stepping.compiled import compiled, inlined

Array = NDArray[np.float64]

# Places in p, the scalars of the rig (SI units, °C).
K_A: Final = 0
K_M: Final = 1
K_S: Final = 2
A_START: Final = 3
A_WIDTH: Final = 4
M_FINISH: Final = 5
M_WIDTH: Final = 6
TEMP_PER_TORQUE_A: Final = 7
TEMP_PER_TORQUE_M: Final = 8
THETA_CR: Final = 9
THETA_P: Final = 10
TAU_C: Final = 11
VISCOUS: Final = 12
SPEED_STEP: Final = 13
DWELL_STEP: Final = 14
PASSIVE_SHARE: Final = 15
TANAKA: Final = 16
ROOM_C: Final = 17
GRID_START: Final = 18
GRID_STEP: Final = 19
FIXED_THETA_L: Final = 20
HAS_FRICTION: Final = 21
HAS_STRAY: Final = 22
STEADY: Final = 23
HOME_HOLD: Final = 24
FIRST_SHARE: Final = 25
SIDE_ROW: Final = 26
HEATING_BEND: Final = 27
COOLING_BEND: Final = 28
VISCOUS_POWER: Final = 29
UNWOUND_A: Final = 30
UNWOUND_B: Final = 31
LATENT: Final = 32
LOADING_ROW: Final = 33
FOLLOWS: Final = 34
N_SCALARS: Final = 35

# Rows of the tables.
FRICTION_DOWN: Final = 0
FRICTION_UP: Final = 1
STRAY: Final = 2
SIDE_A: Final = 3
SIDE_B: Final = 4
LOADING_A: Final = 5
LOADING_B: Final = 6
SPEED: Final = 7
DWELL: Final = 8

_LN100: Final = 4.605170185988092


@inlined
def window_place(heating: bool, temperature: float, torque: float, p: Array) -> float:
    """Return where in the law's window the wire is: 0 at its start, 1 at its end, in the direction of change."""
    if heating:
        return (temperature - p[A_START] - p[TEMP_PER_TORQUE_A] * torque) / p[A_WIDTH]
    return 1.0 - (temperature - p[M_FINISH] - p[TEMP_PER_TORQUE_M] * torque) / p[M_WIDTH]


@inlined
def bend(heating: bool, p: Array) -> float:
    """Return by how much the transformation runs ahead of the law in the middle of its window."""
    return p[HEATING_BEND] if heating else p[COOLING_BEND]


@inlined
def bent(place: float, ahead: float) -> float:
    """Return a place within the window as the bent law takes it."""
    return place + ahead * place * (1.0 - place)


@inlined
def share_done(heating: bool, place: float, p: Array) -> float:
    """Return the share of the transformation that is done at a place in the window."""
    if place <= 0.0:
        return 0.0
    if p[TANAKA] > 0.5:
        return 1.0 - np.exp(-_LN100 * place)
    if place >= 1.0:
        return 1.0
    return 0.5 - 0.5 * np.cos(np.pi * bent(place, bend(heating, p)))


@inlined
def done_slope(heating: bool, place: float, p: Array) -> float:
    """Return the derivative of :func:`share_done` by Liang and Rogers."""
    if place <= 0.0 or place >= 1.0:
        return 0.0
    ahead = bend(heating, p)
    return 0.5 * np.pi * (1.0 + ahead * (1.0 - 2.0 * place)) * np.sin(np.pi * bent(place, ahead))


@inlined
def latent_delay(heating: bool, xi_0: float, per_s: float, p: Array) -> float:
    """Return λ = ℓ Δξ/(Δt w) of a section that began at ``xi_0``: Δξ what its whole window changes, w its width."""
    part = xi_0 if heating else 1.0 - xi_0
    return p[LATENT] * part * per_s / (p[A_WIDTH] if heating else p[M_WIDTH])


@compiled
def held_back(heating: bool, place: float, furthest: float, delay: float, p: Array) -> float:
    """Return the place in the window that latent heat lets a section reach from the furthest one so far.

    s + λ (done(s) − done(s_0)) = s_T: s_T the place by the sensor, λ from :func:`latent_delay`.
    """
    low, high = furthest, place
    before = share_done(heating, furthest, p)
    reached = high
    for _ in range(60):
        over = reached + delay * (share_done(heating, reached, p) - before) - place
        if over > 0.0:
            high = reached
        else:
            low = reached
        following = reached - over / (1.0 + delay * done_slope(heating, reached, p))
        if abs(following - reached) < 1e-14:
            break
        reached = following if low < following < high else 0.5 * (low + high)
        if high - low < 1e-14:
            break
    return reached


@inlined
def from_table(x: float, row: int, p: Array, tables: Array) -> float:
    """Return a table's value at x, held beyond its ends."""
    place = (x - p[GRID_START]) / p[GRID_STEP]
    last = tables.shape[1] - 1
    if place <= 0.0:
        return tables[row, 0]
    if place >= last:
        return tables[row, last]
    i = int(place)
    return tables[row, i] + (place - i) * (tables[row, i + 1] - tables[row, i])


@inlined
def table_and_slope(x: float, row: int, p: Array, tables: Array) -> tuple[float, float]:
    """Return :func:`from_table` with its derivative."""
    place = (x - p[GRID_START]) / p[GRID_STEP]
    last = tables.shape[1] - 1
    if place <= 0.0:
        return tables[row, 0], 0.0
    if place >= last:
        return tables[row, last], 0.0
    i = int(place)
    rise = tables[row, i + 1] - tables[row, i]
    return tables[row, i] + (place - i) * rise, rise / p[GRID_STEP]


@inlined
def side_torque(x: float, p: Array, tables: Array) -> float:
    """Return what a spring makes beside its phase's torque, at its own angle."""
    if p[SIDE_ROW] > 0.0:
        return from_table(x, int(p[SIDE_ROW]), p, tables)
    return 0.0


@inlined
def held_table(x: float, row: int, step: float, tables: Array) -> tuple[float, float]:
    """Return value and slope of a table that begins at x = 0, held beyond its end."""
    place, last = x / step, tables.shape[1] - 1
    if place >= last:
        return tables[row, last], 0.0
    i = int(place)
    rise = tables[row, i + 1] - tables[row, i]
    return tables[row, i] + (place - i) * rise, rise / step


@inlined
def loading_torque(theta: float, p: Array, tables: Array) -> float:
    """Return the martensite's loading curve: two slopes, and what it has beside them."""
    torque = p[K_M] * theta
    if theta > p[THETA_CR]:
        torque = p[K_M] * p[THETA_CR] + p[K_S] * (theta - p[THETA_CR])
    if p[LOADING_ROW] > 0.0:
        torque += from_table(theta, int(p[LOADING_ROW]), p, tables)
    return torque


@inlined
def loading_slope(theta: float, p: Array, tables: Array) -> float:
    """Return the slope of the loading curve."""
    slope = p[K_M] if theta <= p[THETA_CR] else p[K_S]
    if p[LOADING_ROW] > 0.0:
        slope += table_and_slope(theta, int(p[LOADING_ROW]), p, tables)[1]
    return slope


@inlined
def left_by_winding(theta_max: float, p: Array, tables: Array) -> float:
    """Return the angle that is left of a winding once its torque is gone: what heating can recover.

    θ_max less its torque over K_M; what the loading curve has beside its two slopes counts as far as θ_L follows it.
    """
    left = 0.0
    if theta_max > p[THETA_CR]:
        left = (theta_max - p[THETA_CR]) * (1.0 - p[K_S] / p[K_M])
    if p[LOADING_ROW] > 0.0:
        left = max(0.0, left - p[FOLLOWS] * from_table(theta_max, int(p[LOADING_ROW]), p, tables) / p[K_M])
    return left


@inlined
def cold_torque(theta: float, theta_max: float, p: Array, tables: Array) -> float:
    """Return the torque of cold martensite: on its loading curve, or unwound elastically from ``theta_max``."""
    if theta >= theta_max:
        return loading_torque(theta, p, tables)
    return loading_torque(theta_max, p, tables) - p[K_M] * (theta_max - theta)


@inlined
def friction_torque(theta_a: float, up: bool, p: Array, tables: Array) -> float:
    """Return the friction magnitude at θ^A = φ + θ_P/2 for a motion up (φ grows) or down."""
    if p[HAS_FRICTION] > 0.0:
        return max(0.0, from_table(theta_a, FRICTION_UP if up else FRICTION_DOWN, p, tables))
    return p[TAU_C]
