# mypy: disable-error-code="no-any-return"
# Elements of numpy arrays carry no type that mypy could check against float.
# ruff: noqa: FBT001
# Compiled functions call each other by position, flags too.
"""Where heating and cooling begin: the springs' windings at a record's start, and the reference states at its turns.

Arguments as in :mod:`torsight.actuator.stepping.kernel`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.stepping.kernel_balance import bare_load
from torsight.actuator.stepping.kernel_laws import (
    SEATS,
    STRAY,
    Scalars,
    State,
    cold_torque,
    friction_torque,
    from_table,
    left_by_winding,
    loading_torque,
    side_torque,
)
from torsight.actuator.stepping.kernel_roots import TORQUE_TOLERANCE
from torsight.core.compiled import inlined, shared
from torsight.core.units import Floats


@shared
def wound_for(x: float, limit: float, p: Scalars, tables: Floats) -> float:
    """Return θ_max of cold martensite at ``x``, if necessary unwound until its torque is ``limit``."""
    if loading_torque(x, p, tables) <= limit:
        return x
    # Beyond the critical angle the torque at x falls as θ_max grows: linearly for a curve with two slopes.
    start = max(x, p["theta_cr"])
    over = max(0.0, cold_torque(x, start, p, tables) - limit)
    wound = start + over / (p["k_m"] - p["k_s"])
    if p["loading_row"] > 0.0:
        # The curve is less steep than K_M everywhere, so that these steps converge.
        for _ in range(40):
            off = cold_torque(x, wound, p, tables) - limit
            wound = min(max(start, wound + off / (p["k_m"] - p["k_s"])), 2.0 * p["theta_p"])
            if abs(off) < TORQUE_TOLERANCE:
                break
    return wound


@shared
def wind_home(
    wound: Floats, theta_start: float, first: int, scale: float, keeps: float, springs: NDArray[np.void], tables: Floats
) -> None:
    """Set θ_max of both springs at the start: wound to their angles, or unwound to the torque that is held.

    The other spring and friction hold a spring.
    The spring that is driven first may have carried only a share of its torque (``first_share``). Where the unwinding
    of the springs is known, it is used instead. ``keeps`` is the factor on the torque of cold martensite.
    """
    p = springs[0]
    if p["unwound_a"] >= 0.0:
        wound[0], wound[1] = theta_start + p["unwound_a"], p["theta_p"] - theta_start + p["unwound_b"]
        return
    for i in range(2):
        own = theta_start if i == 0 else p["theta_p"] - theta_start
        disk = theta_start + p["slipped_a"]
        hold = scale * friction_torque(disk, i == 1, p, tables)
        if p["has_stray"] > 0.0:
            hold += (1.0 if i == 0 else -1.0) * from_table(disk, STRAY, p, tables)
        other = loading_torque(p["theta_p"] - own, springs[1 - i], tables) * keeps
        other += side_torque(p["theta_p"] - own, springs[1 - i], tables)
        limit = (other + hold) / p["first_share"] if i == first else other * p["first_share"] + hold
        wound[i] = wound_for(own, (limit - side_torque(own, springs[i], tables)) / keeps, springs[i], tables)


@inlined
def _recoverable(wound: float, left: Floats, p: Scalars, tables: Floats) -> float:
    """Return the recoverable angle after winding to an angle; ``left`` holds the factor on it, and the loss of it."""
    whole = p["fixed_theta_l"]
    if not whole > 0.0:
        whole = left_by_winding(wound, p, tables)
    return max(0.0, whole * left[0] - left[1])


@shared
def start_half_cycle(
    who: int, theta_a: float, scale: float, left: Floats, own: float, state: State, springs: NDArray[np.void],
    tables: Floats
) -> None:  # fmt: skip
    """Begin a half-cycle with both springs as full martensite, at their present angles and torques.

    ``own`` is the torque of the spring that was driven before, in addition to its phase's torque. A record starts at
    rest: the torque of the spring that is driven first is that of the other spring plus a share of the friction,
    between −1 and 1 (``home_hold``). Where the spring that was driven before lay above its loading curve, on which it
    is set now, the disk gives way; but for a share of this (``change_held``) the other spring's torque changes instead.
    """
    s, q, w, wound, keeps = state.s[0], state.q[0], state.w, state.wound, state.s[0]["keeps"]
    before, p, o, lost = int(s["who"]), springs[who], springs[1 - who], 0.0
    if before >= 0:
        wound[before] = wound_for(s["x"], (s["tau"] - own) / keeps, springs[before], tables)
        lost = max(0.0, s["tau"] - own - cold_torque(s["x"], wound[before], springs[before], tables) * keeps)
    x = theta_a if who == 0 else p["theta_p"] - theta_a
    s["who"], s["x"], s["xi"] = who, x, 1.0
    s["tau"] = cold_torque(x, wound[who], p, tables) * keeps
    if before < 0 or lost > 0.0:
        disk, passive = theta_a + p["slipped_a"], p["theta_p"] - x
        other = cold_torque(passive, wound[1 - who], o, tables) * keeps + side_torque(passive, o, tables)
        if p["has_stray"] > 0.0:
            other += (1.0 if who == 0 else -1.0) * from_table(disk, STRAY, p, tables)
        share = p["first_share"] if before < 0 else 1.0
        most = (other + scale * friction_torque(disk, who == 1, p, tables)) / share - side_torque(x, p, tables)
        least = (other - scale * friction_torque(disk, who == 0, p, tables)) / share - side_torque(x, p, tables)
        if before < 0:
            most = min(s["tau"], most)
            least = min(most, least)
            s["tau"] = least + 0.5 * (1.0 + p["home_hold"]) * (most - least)
        else:
            held = min(max(s["tau"], least), most) - s["tau"]
            s["tau"] += p["change_held"] * min(max(held, -lost), lost)
    s["xi_p"], s["xi_0_p"], s["turn_p"], s["changed"] = 1.0, 1.0, 1.0, 1.0
    q["x"], q["tau"], q["xi"], q["sliding"] = x, s["tau"], 1.0, 0.0
    q["at_rest"], q["stood_s"] = 0.0, 0.0
    q["theta_l"] = _recoverable(wound[who], left, p, tables)
    for j in range(w.shape[1]):
        w[0, j], w[1, j], w[2, j] = 1.0, 1.0, 0.0


@shared
def turn(heating: bool, left: Floats, own: float, state: State, p: Scalars, tables: Floats) -> None:
    """Set a new reference state when heating turns into cooling or cooling into heating.

    If nothing has changed since the turn before, both turns are ignored: the earlier transformation continues.
    """
    s, q, w, saved_w = state.s[0], state.q[0], state.w, state.saved_w
    if s["changed"] > 0.0:
        state.q[1] = q
        for j in range(w.shape[1]):
            for i in (1, 2):
                saved_w[i, j] = w[i, j]
        q["x"], q["tau"], q["xi"], q["sliding"] = s["x"], s["tau"] - own, s["xi"], 0.0
        q["at_rest"], q["stood_s"] = 0.0, 0.0
        q["floor"] = wound_for(s["x"], (s["tau"] - own) / s["keeps"], p, tables)
        for j in range(w.shape[1]):
            w[1, j], w[2, j] = w[0, j], 0.0
        if heating:
            # The recoverable angle is at most that of the winding to this angle. A spring that was cooled to less than
            # full martensite, and not wound that far since, recovers the angle that it recovered before.
            most = _recoverable(q["floor"], left, p, tables)
            if s["xi"] > 1.0 - 1e-9:
                state.wound[int(s["who"])] = q["floor"]
                q["theta_l"] = most
            else:
                q["theta_l"] = min(q["theta_l"], most / max(s["xi"], 1e-9))
    else:
        state.q[2] = q
        state.q[0], state.q[1] = state.q[1], state.q[2]
        for j in range(w.shape[1]):
            for i in (1, 2):
                w[i, j], saved_w[i, j] = saved_w[i, j], w[i, j]
    s["changed"] = 0.0


@inlined
def mirror_hold(first: bool, state: State, p: Scalars, o: Scalars, tables: Floats) -> None:
    """Convert the torques of the elastic elements to the other spring's coordinates; at the start, set them."""
    s = state.s[0]
    left = bare_load(s["x"], s, p, o, tables) - s["tau"] if first else 0.0
    for i in range(SEATS):
        state.held[i] = left / SEATS if first else -state.held[i]
