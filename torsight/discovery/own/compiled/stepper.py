"""Differential equations in compiled code: Dormand and Prince's pair of order 5(4), steps of its own, and events.

An event is looked for at the end of every step; where one has happened within it, the step is halved down to the
moment at which it does, and what it does to the states begins from there.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 2nd edition, table II.5.2 and
section II.4 (step size control).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.compiled import njit
from torsight.discovery.own.compiled.functions import compiled, fill
from torsight.discovery.own.model.ode import ATOL_SHARE, MOMENT, TOO_MANY, TooManyStepsError
from torsight.discovery.own.model.values import by_name

Array = NDArray[np.float64]

_LEAST_SHARE: Final = 0.02
"""Share of the time from row to row to which a step is shortened: beyond a jump of the right-hand side, such as of
friction where the speed passes zero, no shorter one would do better. What rests there trembles by so much less than it
moves from row to row."""
_HALVINGS: Final = 48
"""By which the moment of an event in a step is known to the digits of a float."""


@dataclass(frozen=True, eq=False)
class Stepper:
    """A right-hand side and events, compiled; made by :func:`stepper_of`."""

    rhs: Any
    when: Any
    then: Any
    directions: Array

    def integrate(
        self, time: Array, start: Array, inputs: Mapping[str, Array], p: Any, *, limits: tuple[float, float, int]
    ) -> Array:
        """Return the states (n, k) at the times; inputs (n,) are lines between them.

        ``limits``: relative tolerance, longest step, most steps from row to row.

        Raises
        ------
        ArithmeticError
            Where the right-hand side gives no numbers.
        TooManyStepsError
            Where the steps become too small or too many.
        """
        names = list(inputs) or ["none"]
        columns = np.column_stack(list(inputs.values()) or [np.zeros(len(time))])
        at = np.zeros(1, [(name, np.float64) for name in names])
        functions = (self.directions, self.rhs, self.when, self.then)
        made, failed = _integrate(functions, time, start, columns, (at, at.view(np.float64)), by_name(p), limits)
        if failed >= 0 and not np.isfinite(made[failed + 1]).all():
            raise ArithmeticError("the right-hand side gives no numbers")
        if failed >= 0:
            raise TooManyStepsError(TOO_MANY.format(time[failed]))
        return np.asarray(made)


def stepper_of(rhs: Callable[..., Any], events: Sequence[tuple[Any, Any, int]]) -> Stepper:
    """Return a right-hand side and events (when, then or None, direction) compiled.

    Raises
    ------
    CannotCompileError
        Where one of the functions cannot be compiled.
    """
    when, then = _nothing, _stays
    for k, (happens, does, _) in enumerate(events):
        when = _with_event(when, k, compiled(happens))
        then = then if does is None else _with_jump(then, k, compiled(does))
    return Stepper(compiled(rhs), when, then, np.array([float(one) for *_, one in events]))


@njit(nogil=True)
def _nothing(t: float, x: Array, u: Any, p: Any, out: Array) -> None:
    pass


@njit(nogil=True)
def _stays(which: int, t: float, x: Array, u: Any, p: Any, new: Array) -> None:
    pass


def _with_event(others: Any, k: int, happens: Any) -> Any:
    @njit(nogil=True)
    def when(t: float, x: Array, u: Any, p: Any, out: Array) -> None:
        others(t, x, u, p, out)
        out[k] = happens(t, x, u, p)

    return when


def _with_jump(others: Any, k: int, does: Any) -> Any:
    @njit(nogil=True)
    def then(which: int, t: float, x: Array, u: Any, p: Any, new: Array) -> None:
        if which == k:
            fill(new, does(t, x, u, p))
        else:
            others(which, t, x, u, p, new)

    return then


_A: Final = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_C: Final = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_ERROR: Final = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
"""Weights of the difference between the solutions of order 5 and 4."""


@njit(nogil=True, error_model="numpy")
def _inputs_at(t: float, given: Any) -> Any:
    """Return the inputs by name at a time.

    ``given``: time and inputs of the row before and of the one after, the inputs' place by name and as an array, and
    the parameters.
    """
    (begin, end, before, after), u, _ = given
    share = (t - begin) / (end - begin)
    for i in range(len(before)):
        u[1][i] = before[i] + share * (after[i] - before[i])
    return u[0][0]


@njit(nogil=True, error_model="numpy")
def _step(rhs: Any, t: float, h: float, x: Array, given: Any, slopes: Array, new: Array) -> None:
    """Fill the seven slopes of a step and the state after it."""
    for stage in range(7):
        for i in range(len(x)):
            change = 0.0
            for j in range(stage):
                change += _A[stage, j] * slopes[j, i]
            new[i] = x[i] + h * change
        at = t + _C[stage] * h
        fill(slopes[stage], rhs(at, new, _inputs_at(at, given), given[2]))


@njit(nogil=True, error_model="numpy")
def _size(h: float, x: Array, new: Array, slopes: Array, rtol: float) -> float:
    """Return the error of a step as a multiple of what is allowed."""
    total = 0.0
    for i in range(len(x)):
        error = 0.0
        for j in range(7):
            error += _ERROR[j] * slopes[j, i]
        allowed = rtol * (ATOL_SHARE + max(abs(x[i]), abs(new[i])))
        total += (h * error / allowed) ** 2
    return float(np.sqrt(total / len(x)))


@njit(nogil=True)
def _happened(before: Array, now: Array, directions: Array) -> int:
    """Return the first event whose function has passed zero the way that counts, −1 for none."""
    for k in range(len(before)):
        up = before[k] <= 0.0 <= now[k] and directions[k] >= 0.0
        down = before[k] >= 0.0 >= now[k] and directions[k] <= 0.0
        if (up or down) and before[k] != now[k]:
            return k
    return -1


@njit(nogil=True, error_model="numpy")
def _through_event(functions: Any, t: float, step: float, x: Array, given: Any, slopes: Array, before: Array) -> float:
    """Go on to a moment after the first event in a step; return the time, with the states and events there filled."""
    directions, rhs, when, then = functions
    _, u, p = given
    new, now = x.copy(), before.copy()
    low, high = 0.0, step
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        _step(rhs, t, middle, x, given, slopes, new)
        when(t + middle, new, _inputs_at(t + middle, given), p, now)
        if _happened(before, now, directions) >= 0:
            high = middle
        else:
            low = middle
    _step(rhs, t, high, x, given, slopes, new)
    t += high
    when(t, new, _inputs_at(t, given), p, now)
    which = _happened(before, now, directions)
    x[:] = new
    then(which, t, new, u[0][0], p, x)
    moment = MOMENT * max(1.0, abs(t))
    fill(slopes[0], rhs(t, x, u[0][0], p))
    for i in range(len(x)):
        new[i] = x[i] + moment * slopes[0, i]
    x[:] = new
    t += moment
    when(t, x, _inputs_at(t, given), p, before)
    return t


@njit(nogil=True, error_model="numpy")
def _integrate(
    functions: Any, time: Array, start: Array, inputs: Array, u: Any, p: Any, limits: Any
) -> tuple[Array, int]:
    """Return the states (n, k), and the row after which no step was small enough or one too many, else -1.

    In the place of the states after that row are the derivatives where it ended.
    """
    directions, rhs, when, _ = functions
    rtol, longest, most = limits
    states = np.empty((len(time), len(start)))
    x, new, slopes = start.copy(), np.empty(len(start)), np.empty((7, len(start)))
    before, now = np.zeros(len(directions)), np.zeros(len(directions))
    states[0] = x
    h = 0.1 * (time[-1] - time[0]) / max(1, len(time) - 1)
    when(time[0], x, _inputs_at(time[0], ((time[0], time[1], inputs[0], inputs[1]), u, p)), p, before)
    for i in range(len(time) - 1):
        t, end = time[i], time[i + 1]
        given, steps = ((time[i], time[i + 1], inputs[i], inputs[i + 1]), u, p), 0
        least = _LEAST_SHARE * (end - t)
        while end - t > 1e-12 * max(1.0, abs(end)):
            step = min(h, end - t, longest)
            _step(rhs, t, step, x, given, slopes, new)
            error = _size(step, x, new, slopes, rtol)
            steps += 1
            if steps > most or step < 1e-14 * max(1.0, abs(t)):
                states[i + 1] = slopes[0]
                return states, i
            if not np.isfinite(error):
                h = 0.2 * step
                continue
            if error <= 1.0 or step <= least:
                when(t + step, new, _inputs_at(t + step, given), p, now)
                if _happened(before, now, directions) >= 0:
                    t = _through_event(functions, t, step, x, given, slopes, before)
                    continue
                t += step
                x[:] = new
                before[:] = now
            # The usual safety factor and limits of a step's change (II.4).
            h = max(least, step * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2)))
        states[i + 1] = x
    return states, -1
