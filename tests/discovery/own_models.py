"""Small models of one's own for tests, and records of them that another integrator made."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import signal
from scipy.integrate import solve_ivp

from torsight.discovery import candidate, parameter

Table = dict[str, np.ndarray]
LAG_S, NOISE = 12.0, 0.05


def sensor_record(*, lag_s: float = 0.0, curve: float = 0.0, seed: int = 1, rows: int = 600) -> Table:
    """Return a reading y = 2 x + 1 + curve·u·|u| of a signal u behind a sensor of first order (SciPy's lsim)."""
    rng = np.random.default_rng(seed)
    t = 0.5 * np.arange(rows)
    walk = np.cumsum(rng.normal(0.0, 0.1, rows))
    u = 3.0 * signal.lfilter(np.ones(20) / 20, 1, walk - walk.mean())
    x = u if lag_s == 0.0 else signal.lsim(([1.0], [lag_s, 1.0]), u, t, X0=[u[0] * lag_s])[1]
    return {"time_s": t, "u": u, "y": 2.0 * x + 1.0 + curve * u * np.abs(u) + rng.normal(0.0, NOISE, rows)}


def read_sensor(p: Any, record: Any) -> np.ndarray:
    """Return the reading of the model: lines between samples pass a first-order lag exactly."""
    u, step = record.u, record.time_s[1] - record.time_s[0]
    x = u
    if p.lag_s > 1e-9:
        a = np.exp(-step / p.lag_s)
        k = p.lag_s / step * (1.0 - a)
        x, _ = signal.lfilter([1.0 - k, k - a], [1.0, -a], u, zi=[u[0] * k])
    return p.gain * x + p.offset + p.cubic * u**3 + p.drift * record.time_s / record.time_s[-1]


def sensor_parameters() -> list[Any]:
    return [parameter("gain", 1.0), parameter("offset", 0.0)]


def sensor_candidates() -> list[Any]:
    return [
        candidate("sensor_lag", parameter("lag_s", 0.5, unit="s", lower=0.0, upper=60.0, null=0.0), family="reading"),
        candidate("cubic", parameter("cubic", 0.01, null=0.0)),
        candidate("drift", parameter("drift", 0.1, null=0.0)),
    ]


def line(p: Any, record: Any) -> np.ndarray:
    """Return the reading of a model without candidates."""
    return p.gain * record.u + p.offset


def spring_record(seed: int, start: float, *, cubic: float = 0.02, rows: int = 200) -> Table:
    """Return x of tau x' = gain u − x − tau·cubic x³ (SciPy's solve_ivp), and the same in volts by another sensor."""
    rng = np.random.default_rng(seed)
    t = 0.5 * np.arange(rows)
    u = np.repeat(rng.uniform(-1.0, 1.0, rows // 20 + 1), 20)[:rows]

    def rhs(s: float, x: np.ndarray) -> np.ndarray:
        return (2.0 * u[min(int(s / 0.5), rows - 1)] - x) / 8.0 - cubic * x**3

    x = solve_ivp(rhs, (0.0, t[-1]), [start], t_eval=t, max_step=0.25, rtol=1e-8).y[0]
    return {
        "time_s": t,
        "u": u,
        "x_mm": x + rng.normal(0.0, 0.02, rows),
        "reading_v": -50.0 * x + rng.normal(0.0, 1.0, rows),
    }


def move_spring(p: Any, record: Any) -> np.ndarray:
    """Return the way of the model: Heun's rule, two steps per sample."""
    x, out, h = p.x0_mm, [], 0.25
    gain, tau, cubic, bias = p.gain, p.tau_s, p.cubic, p.bias
    for u in record.u.tolist():
        out.append(x)
        for _ in range(2):
            first = (gain * u - x) / tau - cubic * x**3 - bias
            ahead = x + h * first
            x += 0.5 * h * (first + (gain * u - ahead) / tau - cubic * ahead**3 - bias)
    return np.array(out)


def spring_parameters() -> list[Any]:
    return [
        parameter("gain", 1.0, lower=-10.0, upper=10.0),
        parameter("tau_s", 4.0, unit="s", lower=0.6, upper=60.0),
        parameter("x0_mm", 0.0, unit="mm", lower=-10.0, upper=10.0),
    ]


def spring_candidates() -> list[Any]:
    return [
        candidate("hardening", parameter("cubic", 0.01, lower=-0.05, upper=0.2, null=0.0)),
        candidate("bias", parameter("bias", 0.01, null=0.0)),
    ]
