# mypy: disable-error-code="no-any-return"
# Records carry no types of their fields.
"""Heat, sensors and current control of the moving rig, compiled.

Two wires and the body (Heun's rule)::

    C dT/dt = R i² − G (T − T_room) − G_b (T − T_body) − G_w (T − T_other)

Control, on the reading of the heated spring's sensor, every sample: i = Kp e + Ki ∫ e, held between 0 and the supply's
limit; the integral waits while the current stands at a limit.
"""

from __future__ import annotations

import math

from torsight.core.compiled import lending
from torsight.core.units import Floats
from torsight.synthetic.rig.constants import Constants


@lending
def heat_rates(c: Constants, temps_c: Floats, current: Floats, rates: Floats) -> None:
    """Fill ``rates`` with dT/dt of wire A, wire B and the body, K/s."""
    a, b, body = temps_c
    between = (c.between + c.between_more) * (a - b)
    to_a, to_b = c.to_body * (a - body), c.to_body * (b - body)
    rates[0] = (c.resistance * current[0] ** 2 - c.to_room * (a - c.room_c) - to_a - between) / c.capacity
    rates[1] = (c.resistance * current[1] ** 2 - c.to_room * (b - c.room_c) - to_b + between) / c.capacity
    rates[2] = (to_a + to_b - c.body_to_room * (body - c.room_c)) / c.body_capacity


@lending
def heat_step(c: Constants, temps_c: Floats, current: Floats, work: Floats, step_s: float) -> None:
    """Move the three temperatures one step on; ``work`` (3, 3) is scratch."""
    heat_rates(c, temps_c, current, work[0])
    for i in range(3):
        work[1, i] = temps_c[i] + step_s * work[0, i]
    heat_rates(c, work[1], current, work[2])
    for i in range(3):
        temps_c[i] += 0.5 * step_s * (work[0, i] + work[2, i])


@lending
def lag_step(c: Constants, temps_c: Floats, lagged_c: Floats, step_s: float) -> None:
    """Advance the lagged temperatures of the sensors (spring, stage) by one step."""
    for i in range(2):
        lag_s = c.lag_b_s if i == 1 else c.lag_s
        keep = math.exp(-step_s * c.lag_stages / lag_s) if lag_s > 0.0 else 0.0
        lagged_c[i, 0] = temps_c[i] + (lagged_c[i, 0] - temps_c[i]) * keep
        lagged_c[i, 1] = lagged_c[i, 0] + (lagged_c[i, 1] - lagged_c[i, 0]) * keep


@lending
def sense(c: Constants, lagged_c: float, noise_c: float) -> float:
    """Return the reading, °C, of a sensor whose own temperature is ``lagged_c``."""
    excess = lagged_c - c.room_c
    gain = c.sensor_gain
    if c.sensor_form == 1:
        gain = 1.0 - (1.0 - c.sensor_gain) * excess / 60.0
    reading = c.room_c + gain * excess
    if c.bulge_c != 0.0:
        reading += c.bulge_c * math.sin(math.pi * min(max((reading - 20.0) / 80.0, 0.0), 1.0))
    reading += noise_c
    if c.quantum_c > 0.0:
        reading = c.quantum_c * round(reading / c.quantum_c)
    return reading


@lending
def control(c: Constants, error_c: float, integral: float, sample_s: float) -> tuple[float, float]:
    """Return current, A, and the integral of the error, K·s, after one sample of the PI law."""
    grown = integral + error_c * sample_s
    wanted = c.gain_p * error_c + c.gain_i * grown
    current = min(max(wanted, 0.0), c.current_max)
    held = current != wanted and (wanted > 0.0) == (error_c > 0.0)
    return current, integral if held else grown
