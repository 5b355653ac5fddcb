"""A model whose sum of squares has many local minima, a driven pendulum that goes over the top: fit and discovery.

    python benchmarks/discovery/valleys.py

Pairs of records of 60 s, by a Runge–Kutta method of order 4 with 20 steps a row; pull and drag are 6 and 0.3, and
begin at 2 and 1. Printed: by how many radians each record turns, the values that ``prepare`` ends at, calls of the
model. Then the same with a friction of which the model knows nothing, a random smooth function of the speed: printed
are the verdict, on what it depends, and the error on a later record.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from torsight.discovery import Findings, Reading, find_missing, law, model_problem, ode, parameter
from torsight.discovery.own.prepare import prepare

Array = NDArray[np.float64]
_TRUE: Final = (6.0, 0.3)
_NOISE_RAD: Final = 0.01
_NEAR: Final = 0.02
"""Share of its value within which a parameter counts as found."""


@njit
def pendulum(t: float, x: Array, u: Any, p: Any) -> Any:  # noqa: ARG001
    """Return the rates of angle and speed."""
    return x[1], u.force - p.pull * np.sin(x[0]) - p.drag * x[1]


@njit
def lacking(t: float, x: Array, u: Any, p: Any) -> Any:  # noqa: ARG001
    """Return the rates of angle and speed, with a law."""
    return x[1], u.force - p.pull * np.sin(x[0]) - p.drag * x[1] - p.friction(x[1])


def hidden(seed: int) -> Callable[[float], float]:
    """Return an odd function of the speed in rad/s, of the order of 1 up to 12 rad/s."""
    rng = np.random.default_rng(seed)
    places, sizes = np.linspace(-12.0, 12.0, 9), rng.normal(0.0, 1.0, 9)
    return lambda rate: float(sizes @ (np.exp(-((rate - places) ** 2) / 16.0) - np.exp(-((rate + places) ** 2) / 16.0)))


def record(seed: int, push: float, friction: Callable[[float], float] = lambda _: 0.0) -> dict[str, Array]:
    """Return time, force and angle of a pendulum that a sum of four waves drives."""
    rng, time = np.random.default_rng(seed), np.linspace(0.0, 60.0, 300)
    waves = zip(rng.normal(0.0, push, 4), rng.uniform(0.2, 2.0, 4), rng.uniform(0.0, 6.0, 4), strict=True)
    force = np.sum([size * np.sin(rate * time + phase) for size, rate, phase in waves], axis=0)
    h = (time[1] - time[0]) / 20

    def slope(x: Array, t: float) -> Array:
        return np.array([x[1], np.interp(t, time, force) - _TRUE[0] * np.sin(x[0]) - _TRUE[1] * x[1] - friction(x[1])])

    states = [np.array([0.5, 0.0])]
    for t in (time[:-1, None] + h * np.arange(20)).ravel():
        x = states[-1]
        one = slope(x, t)
        two = slope(x + h / 2 * one, t + h / 2)
        three = slope(x + h / 2 * two, t + h / 2)
        states.append(x + h / 6 * (one + 2 * two + 2 * three + slope(x + h * three, t + h)))
    angle = np.array(states[::20])[:, 0]
    return {"time_s": time, "force": force, "angle": angle + rng.normal(0.0, _NOISE_RAD, len(time))}


def main() -> None:
    """Print every pair, and how many were fitted."""
    model = ode(pendulum, states=("angle", "rate"), output="angle", inputs="force", initial=(0.5, 0.0))
    free, found = [parameter("pull", 2.0), parameter("drag", 1.0)], []
    for push in (2.0, 2.5, 3.0, 4.0):
        for seed in (1, 3, 5, 7):
            pair = [record(seed, push), record(seed + 1, push)]
            asked = model_problem(model, pair, free, output="angle", reading=Reading(sigma=_NOISE_RAD))
            ended = [p.value for p in prepare(asked)[0].parameters]
            found.append(all(abs(one / true - 1.0) < _NEAR for one, true in zip(ended, _TRUE, strict=True)))
            turns = " and ".join(f"{np.ptp(one['angle']):.0f}" for one in pair)
            print(
                f"push {push}, {turns} rad: {ended[0]:.3f}, {ended[1]:.4f}, {asked.evaluator.calls} calls", flush=True
            )
    print(f"{sum(found)} of {len(found)}")
    for seed in (1, 3, 5, 7):
        answer, off_rad = lacks(seed)
        print(f"friction {seed}: {answer.verdict}, {answer.drivers}, later {off_rad:.3f} rad", flush=True)


def lacks(seed: int) -> tuple[Findings, float]:
    """Return what is found of a hidden friction, and the error on a later record."""
    model = ode(lacking, states=("angle", "rate"), output="angle", inputs="force", initial=(0.5, 0.0))
    free = [parameter("pull", 4.0, lower=0.0), parameter("drag", 1.0, lower=0.0)]
    pair = [record(seed + k, 2.5, hidden(seed)) for k in range(2)]
    laws = [law("friction", driver="rate", nodes=20)]
    found = find_missing(model_problem(model, pair[0], free, laws, output="angle", drivers=[]))
    return found, float(np.std(found.predict(pair[1])["angle"] - pair[1]["angle"]))


if __name__ == "__main__":
    main()
