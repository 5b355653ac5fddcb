"""Models that are ordinary differential equations: states, inputs, events, and how each record begins.

:func:`ode` makes ``predict`` from a right-hand side. SciPy's ``solve_ivp`` integrates; a right-hand side that numba has
compiled, or that the search can compile, is integrated by a compiled stepper, a hundred times faster. Inputs are linear
between the record's samples, or held: a row's value then holds until the next row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.discovery.own.compiled.integration import ATOL_SHARE, MOMENT, RTOL, TOO_MANY, TooManyStepsError
from torsight.discovery.own.model import given
from torsight.discovery.own.model.values import ByName
from torsight.discovery.own.own_records import Record, column_of, time_of

if TYPE_CHECKING:
    from torsight.discovery.own.compiled.stepper import Stepper

EQUAL: Final = 10.0 * RTOL
"""Share of a signal's spread by which two signals may differ that should be equal: two integrations differ by ten times
their tolerance, and a table's digits are no finer."""
LINES: Final = "lines"
HELD: Final = "held"
"""Course of an input between two rows."""
START_ERROR: Final = "{}_start_error"
"""Name of the parameter for the error of the reading at which a state begins."""
_MOST_STEPS: Final = 5_000
"""Steps that an integration may take from row to row (calls, for a right-hand side in plain Python): a regular one
takes 5 to 30 (tests/discovery/test_own_ode.py counts them), one that diverges or jumps to and fro would not end."""
METHODS: Final = ("LSODA", "RK23", "RK45", "DOP853", "Radau", "BDF")
"""Methods of SciPy's ``solve_ivp``."""


@dataclass(frozen=True)
class Event:
    """Something that happens when a function of the state passes through zero.

    Attributes
    ----------
    when : callable
        ``when(t, x, u, p)``: the event happens where this function passes through zero.
    then : callable or None
        ``then(t, x, u, p)`` gives the states after the event; with None the states continue, and the event is only a
        corner that the solver must not step over.
    direction : int
        +1 from below only, −1 from above only, 0 both.
    """

    when: Callable[..., float]
    then: Callable[..., Sequence[float]] | None = None
    direction: int = 0

    def __post_init__(self) -> None:
        given.function(self.when, "Event, when")
        if self.then is not None:
            given.function(self.then, "Event, then")
        if self.direction not in {-1, 0, 1}:
            raise InputError(
                "is no direction", where="Event", value=repr(self.direction), limit="-1, 0, 1", do="give one"
            )


@dataclass(frozen=True)
class Solver:
    """Options of SciPy's ``solve_ivp``, and restarts within a record.

    Attributes
    ----------
    method : str
        Name of the method. With another one than the default the search does not compile the model.
    rtol : float
        Relative tolerance.
    max_step : float
        Longest step.
    restart_s : float
        Time after which measured states begin anew from their measured values, while the others continue: the model
        predicts, and is compared, from one such moment to the next. For models in which small errors grow over a
        record; where no time is given, the search finds one for a model that cannot follow its record otherwise.
    """

    method: str = "LSODA"
    rtol: float = RTOL
    max_step: float = np.inf
    restart_s: float = np.inf

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            where = "Solver, method"
            raise InputError(
                "is no method", where=where, value=repr(self.method), limit=", ".join(METHODS), do="name one"
            )
        given.number(self.rtol, "Solver, rtol", positive=True)
        given.number(self.max_step, "Solver, max_step", positive=True, finite=False)
        given.number(self.restart_s, "Solver, restart_s", positive=True, finite=False)


@dataclass(frozen=True)
class Ode:
    """``predict`` of a model that is a set of differential equations; made by :func:`ode`."""

    rhs: Callable[..., Any]
    states: tuple[str, ...]
    output: Callable[..., Any] | tuple[str, ...]
    inputs: tuple[str, ...]
    initial: Mapping[str, float | str]
    events: tuple[Event, ...] = ()
    time: str | None = None
    solver: Solver = Solver()
    stepper: Stepper | None = None
    held: tuple[str, ...] = ()

    @property
    def __wrapped__(self) -> Callable[..., Any]:
        return self.rhs

    def __call__(self, p: Any, record: Record) -> Any:
        """Return the outputs for a record."""
        time = time_of(record, self.time)
        start = self.start(p, record)
        states = self._states(p, record, time, start)
        if callable(self.output):
            named = {name: states[:, k] for k, name in enumerate(self.states)}
            return self.output(_Named(named), record, p)
        return {name: states[:, self.states.index(name)] for name in self.output}

    def start(self, p: Any, record: Record) -> Floats:
        """Return the initial states (states,) in a record."""
        made = []
        for name in self.states:
            one = self.initial.get(name, name)
            if not isinstance(one, str):
                made.append(float(one))
            elif one in p:
                made.append(float(p[one]))
            elif one in record:
                known = record[one][np.isfinite(record[one])]
                made.append(float(known[0]) + float(p.get(START_ERROR.format(name), 0.0)))
            else:
                raise InputError(
                    f"how state '{name}' begins is not known",
                    where=record.label_,
                    value=f"'{one}'",
                    limit="a number, a parameter, or a column of the record",
                    do=f"give initial={{'{name}': …}}",
                )
        return np.array(made)

    def start_errors(
        self, declared: Sequence[Parameter], outputs: Sequence[str], sigma: Mapping[str, float]
    ) -> tuple[Parameter, ...]:
        """Return the error of the reading at which a state begins, one parameter for each state that begins so.

        ``sigma`` is the standard deviation of a reading by output; without noise the reading is the state.
        """
        return tuple(
            Parameter(START_ERROR.format(name), 0.0, "", sigma=sigma[column])
            for name, column in self.begun_by_readings(declared).items()
            if column in outputs and sigma[column] > 0.0
        )

    def begun_by_readings(self, declared: Sequence[Parameter]) -> dict[str, str]:
        """Return the states that begin at the first value of a column, with that column."""
        names = {p.name for p in declared}
        begins = {name: self.initial.get(name, name) for name in self.states}
        return {name: one for name, one in begins.items() if isinstance(one, str) and one not in names}

    @cached_property
    def quick(self) -> Ode | None:
        """The model with right-hand side and events compiled; None where they cannot be."""
        from torsight.discovery.own.compiled.functions import CannotCompileError

        try:
            return self.compiled()
        except CannotCompileError:
            return None

    def compiled(self) -> Ode:
        """Return the model with right-hand side and events compiled."""
        from torsight.discovery.own.compiled.stepper import stepper_of

        events = [(one.when, one.then, one.direction) for one in self.events]
        return replace(self, stepper=stepper_of(self.rhs, events))

    def begun_anew(self, length_s: float) -> Ode:
        """Return the model with measured states that begin anew every ``length_s``."""
        return replace(self, solver=replace(self.solver, restart_s=length_s))

    def holding(self, name: str) -> Ode:
        """Return the model with one more input that holds its value from row to row."""
        return replace(self, held=(*self.held, name))

    @property
    def measured(self) -> tuple[str, ...]:
        """States that are outputs themselves."""
        return () if callable(self.output) else self.output

    def _states(self, p: Any, record: Record, time: Floats, start: Floats) -> Floats:
        """Return the states (rows, states); the measured ones begin anew every ``restart_s``."""
        inputs = {name: column_of(record, name) for name in self.inputs}
        first = _Named({name: float(column[0]) for name, column in inputs.items()})
        rates = np.shape(self.rhs(float(time[0]), start, first, p))
        if rates != np.shape(start):
            raise InputError(
                "the right-hand side gives no derivative for every state",
                where=record.label_,
                value=rates,
                limit=f"({len(start)},)",
                do="return one number for each state",
            )
        anew = np.full((len(time), len(start)), np.nan)
        anew[0] = start
        begins = np.flatnonzero(np.diff((time - time[0]) // self.solver.restart_s)) + 1
        for name in self.measured:
            if name in record:
                anew[begins, self.states.index(name)] = record[name][begins]
        if self.stepper is None:
            return self._in_pieces(p, inputs, time, anew)
        return self._stepped(self.stepper, p, inputs, time, anew)

    def _stepped(self, stepper: Stepper, p: Any, inputs: Mapping[str, Floats], time: Floats, anew: Floats) -> Floats:
        """Return the states (rows, states) by compiled code; after an error by plain Python, for its traceback."""
        from numba.core.errors import NumbaError

        limits = (self.solver.rtol, float(self.solver.max_step), _MOST_STEPS)
        try:
            return stepper.integrate(time, anew, inputs, p, limits=limits, held=self.held)
        except NumbaError as error:
            from torsight.discovery.own.compiled.functions import reason_in

            raise InputError(
                f"numba cannot compile the right-hand side: {reason_in(str(error))}",
                where=getattr(self.rhs, "__name__", "rhs"),
                do="change it, or leave off @njit",
            ) from error
        except TooManyStepsError:
            raise
        except Exception:  # noqa: BLE001 - with its own traceback
            return self._in_pieces(p, inputs, time, anew)

    def _in_pieces(self, p: Any, inputs: Mapping[str, Floats], time: Floats, anew: Floats) -> Floats:
        """Return the states (rows, states) by plain Python, one stretch between restarts after the other.

        A stretch also begins where a held input jumps: a solver with long steps might miss a short command.
        """
        states = anew.copy()
        begins = np.flatnonzero(np.isfinite(anew).any(axis=1))
        jumps = [0, *(int(row) + 1 for name in self.held for row in np.flatnonzero(np.diff(inputs[name])))]
        for begin, end in pairwise(sorted({*begins.tolist(), *jumps, len(time) - 1})):
            rows = slice(begin, end + 1)
            start = np.where(np.isfinite(anew[begin]), anew[begin], states[begin])
            if begin not in begins and begin in jumps:
                start = self._at_jump(p, inputs, time, begin, start)
            own = {name: column[rows] for name, column in inputs.items()}
            states[begin + 1 : end + 1] = self._stretch(p, own, time[rows], start)[1:]
        return states

    def _at_jump(self, p: Any, inputs: Mapping[str, Floats], time: Floats, row: int, x: Floats) -> Floats:
        """Return the states after an event that a jump of held inputs causes, or unchanged without such an event."""
        then = _Named({name: float(column[row]) for name, column in inputs.items()})
        before = _Named({**then, **{name: float(inputs[name][row - 1]) for name in self.held}})
        t = float(time[row])
        for one in self.events:
            was, now = (float(one.when(t, x, u, p)) for u in (before, then))
            up, down = was <= 0.0 <= now and one.direction >= 0, was >= 0.0 >= now and one.direction <= 0
            if was != now and (up or down):
                return x if one.then is None else np.asarray(one.then(t, x, then, p), np.float64)
        return x

    def _stretch(self, p: Any, inputs: Mapping[str, Floats], time: Floats, start: Floats) -> Floats:
        try:
            return self._integrated(p, inputs, time, start)
        except TooManyStepsError:
            # Where a right-hand side jumps, SciPy's methods may never get through; the stepper does.
            quick = self.quick
            if self.stepper is not None or quick is None or quick.stepper is None:
                raise
            anew = np.full((len(time), len(start)), np.nan)
            anew[0] = start
            return quick._stepped(quick.stepper, p, inputs, time, anew)  # noqa: SLF001 - the same class

    def _integrated(self, p: Any, columns: Mapping[str, Floats], time: Floats, start: Floats) -> Floats:
        """Integrate with SciPy, from event to event."""
        from scipy import integrate

        solve_ivp: Any = integrate.solve_ivp

        def inputs(t: float) -> Any:
            # A stretch ends where a held input jumps: its last row's value belongs to the next one.
            row = min(int(np.searchsorted(time, t, side="right")) - 1, len(time) - 2)
            return _Named(
                {
                    name: float(values[max(row, 0)] if name in self.held else np.interp(t, time, values))
                    for name, values in columns.items()
                }
            )

        row_s, reached, calls = float(np.mean(np.diff(time))), float(time[0]), 0

        def rhs(t: float, x: Floats) -> Any:
            nonlocal reached, calls
            calls += 1
            if t > reached:
                reached, calls = t + row_s, 0
            elif calls > _MOST_STEPS:
                raise TooManyStepsError(TOO_MANY.format(t))
            return self.rhs(t, x, inputs(t), p)

        functions = [self._event(one, inputs, p) for one in self.events]
        states = np.empty((len(time), len(start)))
        begin, at, done = float(time[0]), start, 0
        while True:
            wanted = time[done:]
            found = solve_ivp(
                rhs,
                (begin, float(time[-1])),
                at,
                method=self.solver.method,
                t_eval=wanted,
                events=functions or None,
                rtol=self.solver.rtol,
                atol=ATOL_SHARE * self.solver.rtol,
                max_step=self.solver.max_step,
            )
            if found.status < 0:
                reached = found.t[-1] if len(found.t) else begin
                raise ArithmeticError(f"the solver gave up at t = {reached:g}: {found.message}")
            # Two events may lie between two rows: the solver then gives no row at all.
            if len(found.t):
                states[done : done + len(found.t)] = found.y.T
            done += len(found.t)
            if found.status == 0 or done >= len(time):
                return states
            begin, at = self._after(found, inputs, p)
            # A row at the time of the event shows the states after the event.
            passed = int(np.searchsorted(time, begin))
            states[done:passed] = at
            done = max(done, passed)
            if done >= len(time):
                return states

    def _event(self, one: Event, inputs: Callable[[float], Any], p: Any) -> Any:
        def when(t: float, x: Floats) -> float:
            return float(one.when(t, x, inputs(t), p))

        when.terminal = True  # type: ignore[attr-defined]
        when.direction = one.direction  # type: ignore[attr-defined]
        return when

    def _after(self, found: Any, inputs: Callable[[float], Any], p: Any) -> tuple[float, Floats]:
        """Return the time a moment after the first event, and the states then."""
        k = min((k for k, times in enumerate(found.t_events) if len(times)), key=lambda k: float(found.t_events[k][0]))
        t, x = float(found.t_events[k][0]), np.asarray(found.y_events[k][0], np.float64)
        then = self.events[k].then
        after = x if then is None else np.asarray(then(t, x, inputs(t), p), np.float64)
        # A moment later the function is no longer zero, so that the event does not end the next step immediately.
        moment = MOMENT * max(1.0, abs(t))
        return t + moment, after + moment * np.asarray(self.rhs(t, after, inputs(t), p), np.float64)


class _Named(ByName[Any]):
    """Inputs or states by name: ``u.force_n``."""

    MISSING = "'{name}' is not declared; there is {known}"


def ode(
    rhs: Callable[..., Any],
    *,
    states: str | Sequence[str],
    output: Callable[..., Any] | str | Sequence[str],
    inputs: str | Sequence[str] | Mapping[str, str] = (),
    initial: Mapping[str, float | str] | Sequence[float | str] | None = None,
    events: Event | Sequence[Event] = (),
    time: str | None = None,
    solver: Solver = Solver(),
) -> Ode:
    """Make a model's ``predict`` from differential equations.

    Parameters
    ----------
    rhs : callable
        ``rhs(t, x, u, p)`` gives the derivatives of the states: ``x`` (states,), ``u`` the inputs by name
        (``u.force_n``), ``p`` parameters and laws by name (``p.mass_kg``). With ``numba.njit`` it is compiled right
        away, else by the search where that saves time and numba can do it.
    states : sequence of str
        Names of the states.
    output : callable, or names
        ``output(x, record, p)`` gives the measured outputs from the states by name, (rows,) each; or the names of
        states that are measured themselves.
    inputs : sequence of str, or mapping to ``"lines"`` or ``"held"``
        Columns of the record that drive the model, and their course between rows: linear (all of a sequence), or the
        row's value until the next row, as for a command or the power of a switch.
    initial : mapping by state, or sequence in their order, optional
        Initial value of a state: a number, the name of a parameter, or of a column whose first known value is taken; by
        default the parameter or column of the state's own name. The first value of a measured output has the error of a
        reading, which is estimated for each record (parameter ``STATE_start_error``).
    events : sequence of Event
        Corners (an overflow, a stop) and jumps.
    time : str, optional
        Column of the time; as in ``model_problem``.
    solver : Solver
        Method, tolerance, longest step, and the time after which measured states begin anew.
    """
    given.function(rhs, "ode, rhs")
    named = tuple(given.name(one, "ode, states") for one in given.names(states, "ode, states"))
    names = list(inputs) if isinstance(inputs, Mapping) else inputs
    driven = tuple(given.name(one, "ode, inputs") for one in given.names(names, "ode, inputs"))
    goes = inputs if isinstance(inputs, Mapping) else dict.fromkeys(driven, LINES)
    for name, course in goes.items():
        if course not in (LINES, HELD):
            raise InputError(
                "cannot be used", where=f"ode, inputs, {name}", value=repr(course), limit=f"'{LINES}' or '{HELD}'"
            )
    wanted = output if callable(output) else given.names(output, "ode, output")
    happens = given.several(events, Event, "ode, events", do="declare each with Event(when, then)")
    given.one_of(solver, Solver, "ode, solver", do="give solver=Solver(method=…, rtol=…)")
    if isinstance(initial, Sequence) and not isinstance(initial, str) and len(initial) == len(named):
        initial = dict(zip(named, initial, strict=True))
    do = "give one for each state: {" + ", ".join(f"'{name}': …" for name in named) + "}"
    begin: Any = given.one_of({} if initial is None else initial, Mapping, "ode, initial", do=do)  # type: ignore[type-abstract]
    for state, begins in begin.items():
        if not isinstance(begins, str):
            given.number(begins, f"ode, initial, {state}")
    unknown = [] if callable(wanted) else [name for name in wanted if name not in named]
    unknown += [name for name in begin if name not in named]
    if not named or unknown:
        note = f"'{', '.join(unknown)}' is no state" if named else "has no state"
        raise InputError(note, where="ode", limit=", ".join(named) or "one or more", do="name it among states=[…]")
    if callable(wanted) and np.isfinite(solver.restart_s):
        do = "name the states that are measured as output=[…]"
        raise InputError("has no state that is measured itself", where="ode, solver, restart_s", do=do)
    plain = getattr(rhs, "py_func", rhs)
    holds = tuple(name for name in driven if goes[name] == HELD)
    made = Ode(plain, named, wanted, driven, begin, happens, time, solver, held=holds)
    return made if plain is rhs else made.compiled()
