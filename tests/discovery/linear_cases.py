"""Small linear problems with known answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from torsight.discovery.linear_problem import LinearProblem, linear_problem

BLOCKS, LENGTH = 8, 150


def signals() -> dict[str, np.ndarray]:
    """Return the inputs of a made-up machine: each block another sweep."""
    rng = np.random.default_rng(11)
    n = BLOCKS * LENGTH
    block = np.repeat(np.arange(BLOCKS), LENGTH)
    phase = np.tile(np.linspace(0.0, 1.0, LENGTH), BLOCKS)
    speed = np.sin(2.0 * np.pi * phase * (1.0 + 0.25 * rng.random(BLOCKS)[block])) * (
        0.6 + 0.8 * rng.random(BLOCKS)[block]
    )
    warm = 20.0 + 10.0 * rng.random(BLOCKS)[block] * phase
    return {
        "time": np.arange(n, dtype=float),
        "block": block.astype(float),
        "speed": speed,
        "position": np.cumsum(speed) / LENGTH,
        "warm": warm,
        "one": np.ones(n),
    }


def noise(seed: int, *, size: float, tau: float) -> np.ndarray:
    """Return first-order noise of integrated correlation time ``tau`` samples."""
    rng = np.random.default_rng(seed)
    phi = (tau - 1.0) / (tau + 1.0)
    out = np.empty(BLOCKS * LENGTH)
    value = rng.standard_normal()
    for i in range(len(out)):
        out[i] = value
        value = phi * value + np.sqrt(1.0 - phi * phi) * rng.standard_normal()
    return size * out


def machine(
    extra: np.ndarray | float,
    *,
    seed: int = 0,
    candidates: Mapping[str, Mapping[str, np.ndarray]] | None = None,
    tau: float = 6.0,
    sigma: float = 0.0,
    resolution: float = 0.01,
) -> LinearProblem:
    """Return a machine with y = 2 speed + 1 + ``extra`` + noise of 0.05, and candidates that may be missing."""
    s = signals()
    observed = 2.0 * s["speed"] + 1.0 + extra + noise(seed, size=0.05, tau=tau)
    offered = candidates if candidates is not None else usual_candidates()
    made = linear_problem(
        observed,
        {"gain": s["speed"], "offset": s["one"]},
        offered,
        time_s=s["time"],
        block=s["block"].astype(np.int64),
        drivers={
            "position": s["position"],
            "warm": s["warm"],
            "time_s": s["time"],
            "direction": np.sign(s["speed"]),
        },
        sigma=sigma,
        resolution=resolution,
    )
    return replace(made, candidates=tuple(replace(c, laws=FORMS.get(c.id, ())) for c in made.candidates))


FORMS = {
    "coulomb": ("direction",),
    "spring": ("position",),
    "bump": ("position",),
    "warmth": ("warm",),
    "drift": ("time_s",),
}
"""The laws of which the effects are usual forms."""


def usual_candidates() -> dict[str, dict[str, np.ndarray]]:
    """Return effects that the machine may lack."""
    s = signals()
    return {
        "coulomb": {"coulomb_n": np.sign(s["speed"])},
        "drag": {"drag_n": s["speed"] * np.abs(s["speed"])},
        "spring": {"stiffness_n": s["position"]},
        "warmth": {"warmth_n": s["warm"] - 20.0},
        "bump": {"bump_n": np.exp(-0.5 * ((s["position"] - 0.1) / 0.03) ** 2)},
        "drift": {"drift_n": s["time"] / s["time"][-1]},
    }
