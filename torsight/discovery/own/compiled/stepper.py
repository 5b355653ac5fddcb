"""Differential equations in compiled code: Dormand and Prince's pair of order 5(4), adaptive steps, and events.

Events are checked at the end of every step. Where an event has happened within the step, its time is found by
bisection, and the integration continues from there with the states that the event sets.

The stepping is compiled once and cached on disk. A model's functions are passed to it as pointers to functions that
take arrays; these give names to the values before they call the functions that the model's author wrote.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 2nd edition, table II.5.2 and
section II.4 (step size control).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numba.core import types
from numba.np.unsafe.ndarray import to_fixed_tuple
from scipy.integrate import RK45

from torsight.core.compiled import compiled as kept
from torsight.core.compiled import copy_to, njit, shared
from torsight.core.units import Floats
from torsight.discovery.own.compiled.functions import compiled, curve_at, fill, inside
from torsight.discovery.own.compiled.integration import ATOL_SHARE, MOMENT, TOO_MANY, TooManyStepsError
from torsight.discovery.own.model.values import Curve, kind_of

_HALVINGS: Final = int(np.finfo(np.float64).nmant)
"""Number of bisections after which the time of an event in a step is known to the digits of a float."""

_NUMBERS: Final = types.Array(types.float64, 1, "C")
_ROWS: Final = types.Array(types.float64, 2, "C")
_GIVEN: Final = types.Tuple((_NUMBERS, types.Array(types.float64, 3, "C"), types.Array(types.int64, 1, "C")))
"""Parameters; laws (law; nodes, values or range of its arguments; node); number of nodes of each law."""
_AT_POINT: Final = types.void(types.float64, _NUMBERS, _NUMBERS, _GIVEN, _NUMBERS)
"""Signature: time, states, inputs, parameters and laws, and the array that is filled."""
_JUMP: Final = types.void(types.int64, types.float64, _NUMBERS, _NUMBERS, _GIVEN, _NUMBERS)
_LIMITS: Final = types.Tuple((types.float64, types.float64, types.int64))


# Without types: mypy does not know how compiled code calls these.
_tuple_of: Any = to_fixed_tuple
_curve_at: Any = curve_at
_compiled_for: Any = njit


@dataclass(frozen=True, eq=False)
class Stepper:
    """A right-hand side and events, compiled; made by :func:`stepper_of`."""

    rhs: Any
    when: Any
    then: Any
    directions: Floats
    _known: dict[Any, tuple[Any, Any, Any]] = field(default_factory=dict)

    def integrate(
        self,
        time: Floats,
        anew: Floats,
        inputs: Mapping[str, Floats],
        p: Any,
        *,
        limits: tuple[float, float, int],
        held: Collection[str] = (),
    ) -> Floats:
        """Return the states (n, k) at the times; inputs (n,) are linear between these, except for those ``held``.

        ``anew`` (n, k): values with which states begin in the first row, and anew in others; NaN where they continue.
        ``limits``: relative tolerance, longest step, most steps from row to row.
        """
        columns = np.column_stack(list(inputs.values()) or [np.zeros(len(time))])
        # Value of an input just before the next row: the next row's, or the row's own where the input is held.
        comes_to = np.vstack([columns[1:], columns[-1:]])
        kept_on = [k for k, name in enumerate(inputs) if name in held]
        comes_to[:, kept_on] = columns[:, kept_on]
        names = [name for name in p if name.isidentifier() and not name.startswith("_")]
        laws = [name for name in names if isinstance(p[name], Curve)]
        numbers = [name for name in names if name not in laws]
        curves = [p[name] for name in laws]
        packed = np.zeros((len(laws), 3, max([2, *(len(one.nodes) for one in curves)])))
        for law, one in zip(packed, curves, strict=True):
            law[0, : len(one.nodes)], law[1, : len(one.nodes)], law[2, :2] = one.nodes, one.values, one.asked
        counts = np.array([len(one.nodes) for one in curves], np.int64)
        given = (np.array([float(p[name]) for name in numbers]), packed, counts)
        functions = self._by_place(tuple(inputs) or ("none",), tuple(numbers), tuple(laws))
        rows = (np.array(time), columns, comes_to, anew)  # a copy: a record's read-only array is another type
        try:
            made, failed = _integrate(*functions, self.directions, rows, given, limits)
        finally:
            for law, one in zip(packed, curves, strict=True):
                one.asked[:] = law[2, :2]
        if failed >= 0 and not np.isfinite(made[failed + 1]).all():
            raise ArithmeticError("the right-hand side gives no numbers")
        if failed >= 0:
            raise TooManyStepsError(TOO_MANY.format(time[failed]))
        return np.asarray(made)

    def _by_place(
        self, inputs: tuple[str, ...], numbers: tuple[str, ...], laws: tuple[str, ...]
    ) -> tuple[Any, Any, Any]:
        """Return right-hand side, events and jumps as functions of arrays, compiled for values of these names."""
        key = (inputs, numbers, laws)
        if key not in self._known:
            u_of, p_of = _named(inputs, numbers, laws)
            rhs, when, then = self.rhs, self.when, self.then

            @_compiled_for(_AT_POINT, nogil=True, no_cpython_wrapper=True)
            def slopes(t: float, x: Floats, u: Floats, given: Any, out: Floats) -> None:
                fill(out, rhs(t, x, u_of(u), p_of(given)))

            @_compiled_for(_AT_POINT, nogil=True, no_cpython_wrapper=True)
            def events(t: float, x: Floats, u: Floats, given: Any, out: Floats) -> None:
                when(t, x, u_of(u), p_of(given), out)

            @_compiled_for(_JUMP, nogil=True, no_cpython_wrapper=True)
            def jumps(which: int, t: float, x: Floats, u: Floats, given: Any, out: Floats) -> None:
                then(which, t, x, u_of(u), p_of(given), out)

            self._known[key] = slopes, events, jumps
        return self._known[key]


def _named(inputs: tuple[str, ...], numbers: tuple[str, ...], laws: tuple[str, ...]) -> tuple[Any, Any]:
    """Return two functions of arrays: one gives names to inputs, the other to parameters and laws."""
    u_kind, p_kind = kind_of(inputs), kind_of((*numbers, *laws))
    inputs_count, count = len(inputs), len(numbers)
    curves = _no_laws
    for k in range(len(laws)):
        curves = _with_law(curves, k)

    @inside
    def u_of(u: Floats) -> Any:
        return u_kind(*_tuple_of(u, inputs_count))

    @inside
    def p_of(given: Any) -> Any:
        return p_kind(*(_tuple_of(given[0], count) + curves(given)))

    return u_of, p_of


@inside
def _no_laws(given: Any) -> Any:  # noqa: ARG001 - called as those with laws are
    return ()


def _with_law(others: Any, k: int) -> Any:
    @inside
    def laws(given: Any) -> Any:
        _, packed, counts = given
        law: Any = _curve_at(packed[k, 0, : counts[k]], packed[k, 1, : counts[k]], packed[k, 2])
        return (*others(given), law)

    return laws


def stepper_of(rhs: Callable[..., Any], events: Sequence[tuple[Any, Any, int]]) -> Stepper:
    """Return the compiled stepper of a right-hand side and of events (when, then or None, direction)."""
    when, then = _nothing, _stays
    for k, (happens, does, _) in enumerate(events):
        when = _with_event(when, k, compiled(happens))
        then = then if does is None else _with_jump(then, k, compiled(does))
    return Stepper(compiled(rhs), when, then, np.array([float(one) for *_, one in events]))


@inside
def _nothing(t: float, x: Floats, u: Any, p: Any, out: Floats) -> None:
    pass


@inside
def _stays(which: int, t: float, x: Floats, u: Any, p: Any, new: Floats) -> None:
    pass


def _with_event(others: Any, k: int, happens: Any) -> Any:
    @inside
    def when(t: float, x: Floats, u: Any, p: Any, out: Floats) -> None:
        others(t, x, u, p, out)
        out[k] = happens(t, x, u, p)

    return when


def _with_jump(others: Any, k: int, does: Any) -> Any:
    @inside
    def then(which: int, t: float, x: Floats, u: Any, p: Any, new: Floats) -> None:
        if which == k:
            fill(new, does(t, x, u, p))
        else:
            others(which, t, x, u, p, new)

    return then


_A: Final = np.vstack([np.pad(RK45.A, ((0, 0), (0, 1))), RK45.B])
_C: Final = np.append(RK45.C, 1.0)
_ERROR: Final = RK45.E
"""The pair's coefficients: stages and the solution of order 5, their times, and the difference between both orders."""


@shared
def _set_inputs(t: float, driven: Any) -> None:
    """Fill in the inputs at a time; ``driven``: times of the rows before and after, their inputs, the array to fill."""
    begin, end, before, after, u = driven
    share = (t - begin) / (end - begin)
    for i in range(len(u)):
        u[i] = before[i] + share * (after[i] - before[i])


@shared
def _step(rhs: Any, t: float, h: float, x: Floats, along: Any, slopes: Floats, new: Floats) -> None:
    """Fill in the slopes of a step, except the first (that at its beginning), and the state after the step."""
    driven, given = along
    for stage in range(1, 7):
        for i in range(len(x)):
            change = 0.0
            for j in range(stage):
                change += _A[stage, j] * slopes[j, i]
            new[i] = x[i] + h * change
        at = t + _C[stage] * h
        _set_inputs(at, driven)
        rhs(at, new, driven[4], given, slopes[stage])


@shared
def _size(h: float, x: Floats, new: Floats, slopes: Floats, rtol: float) -> float:
    """Return the error of a step as a multiple of the tolerance."""
    total = 0.0
    for i in range(len(x)):
        error = 0.0
        for j in range(7):
            error += _ERROR[j] * slopes[j, i]
        allowed = rtol * (ATOL_SHARE + max(abs(x[i]), abs(new[i])))
        total += (h * error / allowed) ** 2
    return float(np.sqrt(total / len(x)))


@shared
def _happened(before: Floats, now: Floats, directions: Floats) -> int:
    """Return the index of the first event whose function has passed zero in its direction, −1 for none."""
    for k in range(len(before)):
        up = before[k] <= 0.0 <= now[k] and directions[k] >= 0.0
        down = before[k] >= 0.0 >= now[k] and directions[k] <= 0.0
        if (up or down) and before[k] != now[k]:
            return k
    return -1


@shared
def _begins(anew: Floats, x: Floats) -> bool:
    """Fill in the states that begin anew in a row; return whether there are any."""
    begins = False
    for i in range(len(x)):
        if not np.isnan(anew[i]):
            x[i], begins = anew[i], True
    return begins


@shared
def _jumps(before: Floats, now: Floats) -> bool:
    """Return whether an input has changed."""
    changed = False
    for i in range(len(now)):
        changed = changed or before[i] != now[i]
    return changed


@kept
def _through_event(
    functions: Any, t: float, step: float, x: Floats, along: Any, slopes: Floats, before: Floats
) -> float:
    """Integrate to a moment after the first event in a step: fill in states and events there, return the time."""
    directions, rhs, when, then = functions
    driven, given = along
    new, now = x.copy(), before.copy()
    low, high = 0.0, step
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        _step(rhs, t, middle, x, along, slopes, new)
        _set_inputs(t + middle, driven)
        when(t + middle, new, driven[4], given, now)
        if _happened(before, now, directions) >= 0:
            high = middle
        else:
            low = middle
    _step(rhs, t, high, x, along, slopes, new)
    t += high
    _set_inputs(t, driven)
    when(t, new, driven[4], given, now)
    which = _happened(before, now, directions)
    copy_to(x, new)
    then(which, t, new, driven[4], given, x)
    moment = MOMENT * max(1.0, abs(t))
    rhs(t, x, driven[4], given, slopes[0])
    for i in range(len(x)):
        new[i] = x[i] + moment * slopes[0, i]
    copy_to(x, new)
    t += moment
    _set_inputs(t, driven)
    when(t, x, driven[4], given, before)
    rhs(t, x, driven[4], given, slopes[0])
    return t


@_compiled_for(
    types.Tuple((_ROWS, types.int64))(
        types.FunctionType(_AT_POINT),
        types.FunctionType(_AT_POINT),
        types.FunctionType(_JUMP),
        _NUMBERS,
        types.Tuple((_NUMBERS, _ROWS, _ROWS, _ROWS)),
        _GIVEN,
        _LIMITS,
    ),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def _integrate(
    rhs: Any, when: Any, then: Any, directions: Floats, rows: Any, given: Any, limits: Any
) -> tuple[Floats, int]:
    """Return the states (n, k), and the row after which the steps became too small or too many, else -1.

    The row after that one holds the derivatives where the integration ended. ``rows``: times, inputs, their values just
    before the next row, and the values with which states begin anew.
    """
    (time, inputs, comes_to, anew), (rtol, longest, most) = rows, limits
    functions = (directions, rhs, when, then)
    states = np.empty(anew.shape)
    x, new, slopes = anew[0].copy(), np.empty(anew.shape[1]), np.empty((7, anew.shape[1]))
    before, now, u = np.zeros(len(directions)), np.zeros(len(directions)), np.empty(inputs.shape[1])
    copy_to(states[0], x)
    h = 0.0
    for i in range(len(time) - 1):
        t, end, steps = time[i], time[i + 1], 0
        if _begins(anew[i], x) or i == 0:
            h = 0.1 * (end - t)
            copy_to(u, inputs[i])
            when(t, x, u, given, before)
            rhs(t, x, u, given, slopes[0])
        elif _jumps(comes_to[i - 1], inputs[i]):
            # The event functions keep their values before the jump: an event that it causes is found in the next step.
            h = 0.1 * (end - t)
            copy_to(u, inputs[i])
            rhs(t, x, u, given, slopes[0])
        driven = (t, end, inputs[i], comes_to[i], u)
        along = (driven, given)
        # Across a jump of the right-hand side, as that of friction where the speed passes zero, a shorter step would do
        # no better. A state that rests there oscillates by this share of its motion from row to row.
        least = 0.02 * (end - t)
        while end - t > 1e-12 * max(1.0, abs(end)):
            step = min(h, end - t, longest)
            _step(rhs, t, step, x, along, slopes, new)
            error = _size(step, x, new, slopes, rtol)
            steps += 1
            if steps > most or step < 1e-14 * max(1.0, abs(t)):
                copy_to(states[i + 1], slopes[0])
                return states, i
            if not np.isfinite(error):
                h = 0.2 * step
                continue
            if error <= 1.0 or step <= least:
                _set_inputs(t + step, driven)
                when(t + step, new, driven[4], given, now)
                if _happened(before, now, directions) >= 0:
                    t = _through_event(functions, t, step, x, along, slopes, before)
                    continue
                t += step
                copy_to(x, new)
                copy_to(before, now)
                copy_to(slopes[0], slopes[6])
            # The usual safety factor and limits of a step's change (II.4).
            h = max(least, step * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2)))
        copy_to(states[i + 1], x)
    return states, -1
