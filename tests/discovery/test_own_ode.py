"""Models that are differential equations: SciPy, the compiled stepper and closed forms agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import njit

from torsight.core.errors import InputError
from torsight.discovery import Event, ode
from torsight.discovery.own.model.values import Values
from torsight.discovery.own.records import Record

TIME = np.linspace(0.0, 10.0, 201)
VALUES = Values({"stiffness": 4.0, "damping": 0.4, "x0": 1.0})
WANTED = 1e-5
"""Relative tolerance 1e-7 of a step, over a few hundred steps."""


def plain(t: float, x: Any, u: Any, p: Any) -> Any:
    del t
    return x[1], u.force - p.stiffness * x[0] - p.damping * x[1]


@njit
def compiled(t: float, x: Any, u: Any, p: Any) -> Any:  # noqa: ARG001 - the signature is ode's
    return x[1], u[0] - p.stiffness * x[0] - p.damping * x[1]


def closed_form() -> np.ndarray:
    """Return the free decay from 1 at rest: ω² = k − c²/4."""
    half, omega = 0.2, np.sqrt(4.0 - 0.04)
    return np.exp(-half * TIME) * (np.cos(omega * TIME) + half / omega * np.sin(omega * TIME))


@pytest.mark.parametrize("rhs", [plain, compiled], ids=["scipy", "compiled"])
def test_a_free_decay_is_the_closed_form(rhs: Any) -> None:
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    model = ode(rhs, states=("x", "v"), output="x", inputs=("force",), initial={"x": "x0", "v": 0.0})
    np.testing.assert_allclose(model(VALUES, record)["x"], closed_form(), atol=WANTED)


def test_a_bounce_is_an_event() -> None:
    """Fallen from 1 m, back up with 0.8 of the speed."""
    ball = ode(
        lambda _t, x, _u, _p: (x[1], -9.81),
        states=("height", "speed"),
        output=lambda x, _record, _p: 1000.0 * x.height,
        initial={"height": "start_m", "speed": 0.0},
        events=[Event(lambda _t, x, _u, _p: x[0], lambda _t, x, _u, _p: (0.0, -0.8 * x[1]), direction=-1)],
    )
    time = np.linspace(0.0, 1.1, 90)
    made = ball(Values({}), Record({"time_s": time, "start_m": np.ones(90)}, "ball"))
    hit = np.sqrt(2.0 / 9.81)
    up = 0.8 * 9.81 * hit
    after = up * (time - hit) - 4.905 * (time - hit) ** 2
    np.testing.assert_allclose(made, 1000.0 * np.where(time < hit, 1.0 - 4.905 * time**2, after), atol=1e-3)


def test_what_is_not_declared_is_told() -> None:
    with pytest.raises(InputError, match="'y' is no state"):
        ode(plain, states=("x", "v"), output="y")
    with pytest.raises(InputError, match="events need a right-hand side in plain Python"):
        ode(compiled, states=("x", "v"), output="x", events=[Event(lambda t, _x, _u, _p: t)])
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    with pytest.raises(InputError, match="how state 'v' begins is not known"):
        ode(plain, states=("x", "v"), output="x", inputs=("force",), initial={"x": "x0"})(VALUES, record)


def test_an_input_by_name_is_told_where_numba_cannot_compile_it() -> None:
    record = Record({"time_s": TIME, "force": np.zeros(201)}, "one")
    by_name = njit(lambda _t, x, u, p: (x[1], u.force - p.stiffness * x[0]))
    model = ode(by_name, states=("x", "v"), output="x", inputs=("force",), initial={"x": "x0", "v": 0.0})
    with pytest.raises(InputError, match=r"numba cannot compile.*Unknown attribute 'force'") as told:
        model(VALUES, record)
    assert "u[0]" in str(told.value)
