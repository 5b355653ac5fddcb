"""Models of one's own that are declared clumsily: refused in one sentence that says what to do, or taken as meant."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.discovery.own_models import line, sensor_parameters, sensor_record
from torsight.core.errors import TorsightError
from torsight.discovery import (
    Event,
    Reading,
    Settings,
    Solver,
    candidate,
    find_missing,
    law,
    linear_problem,
    model_problem,
    ode,
    parameter,
)
from torsight.discovery.own.model.check import check_problem

RECORD = sensor_record()
ROWS = len(RECORD["u"])
BOW = candidate("bow", parameter("bow", 0.1, null=0.0))
NAN, INF = math.nan, math.inf


def columns(**changes: Any) -> dict[str, Any]:
    return {name: values for name, values in {**RECORD, **changes}.items() if values is not None}


def asked(predict: Any = line, observed: Any = RECORD, **changes: Any) -> Any:
    """Return a problem, checked as a search checks it."""
    given = {"parameters": sensor_parameters(), "candidates": (), "output": "y", **changes}
    made = model_problem(predict, observed, given.pop("parameters"), given.pop("candidates"), **given)
    check_problem(made)
    return made


def read(**options: Any) -> Any:
    return asked(reading=Reading(**options))


def bowed(p: Any, record: Any) -> Any:
    return line(p, record) + p.bow * record.u**2


def offered(*names: Any, **options: Any) -> Any:
    return asked(bowed, candidates=[candidate(*names, **options)])


def moved(**changes: Any) -> Any:
    given = {"states": ["x"], "output": "x", "inputs": ["u"], "initial": {"x": 0.0}, **changes}
    rhs = given.pop("rhs", lambda _t, x, u, p: (p.gain * u.u - x[0] + p.offset,))
    return asked(ode(rhs, **given), columns(x=RECORD["y"]), output="x")


def straight(**changes: Any) -> Any:
    given: dict[str, Any] = {
        "observed": RECORD["y"],
        "base": {"gain": RECORD["u"]},
        "candidates": {"bow": {"bow": RECORD["u"] ** 2}},
        "time_s": RECORD["time_s"],
        "block": np.arange(ROWS) // 100,
        "drivers": {"u": RECORD["u"]},
        "sigma": 0.05,
        **changes,
    }
    first = [given.pop(name) for name in ("observed", "base", "candidates")]
    return find_missing(linear_problem(*first, **given))


REFUSED: dict[str, tuple[str, Callable[[], Any]]] = {
    # names and numbers of parameters
    "name: empty": ("parameter, name: is no name that a model can use", lambda: parameter("", 1.0)),
    "name: a number": ("parameter, name: is no text", lambda: parameter(3, 1.0)),
    "name: two words": ("parameter, name: is no name that a model can use", lambda: parameter("spring rate", 1.0)),
    "name: begins with a digit": ("parameter, name: is no name that a model can use", lambda: parameter("2nd", 1.0)),
    "name: a word of Python": ("parameter, name: is no name that a model can use", lambda: parameter("lambda", 1.0)),
    "name: of a mapping": ("parameter, name: is no name that a model can use", lambda: parameter("items", 1.0)),
    "name: private": ("parameter, name: is no name that a model can use", lambda: parameter("_gain", 1.0)),
    "start: a word": ("parameter 'gain', start: is no number", lambda: parameter("gain", "one")),
    "start: nothing": ("parameter 'gain', start: is no number", lambda: parameter("gain", None)),
    "start: NaN": ("parameter 'gain', start: is no number", lambda: parameter("gain", NAN)),
    "start: infinite": ("parameter 'gain', start: is no number", lambda: parameter("gain", INF)),
    "start: several": ("parameter 'gain', start: is no number", lambda: parameter("gain", [1.0, 2.0])),
    "start: complex": ("parameter 'gain', start: is no number", lambda: parameter("gain", 1j)),
    "start: True": ("parameter 'gain', start: is no number", lambda: parameter("gain", True)),
    "lower: NaN": ("parameter 'gain', lower: is no number", lambda: parameter("gain", 1.0, lower=NAN)),
    "lower: a word": ("parameter 'gain', lower: is no number", lambda: parameter("gain", 1.0, lower="0")),
    "bounds: the wrong way round": (
        "the model, gain: bounds leave no room",
        lambda: asked(parameters=[parameter("gain", 1.0, lower=2.0, upper=0.0)]),
    ),
    "sigma of a parameter: negative": (
        "parameter 'gain', sigma: is no positive number",
        lambda: parameter("gain", 1.0, sigma=-1.0),
    ),
    "sigma of a parameter: a word": (
        "parameter 'gain', sigma: is no positive number",
        lambda: parameter("gain", 1.0, sigma="small"),
    ),
    "sigma of a parameter: NaN": (
        "parameter 'gain', sigma: is no positive number",
        lambda: parameter("gain", 1.0, sigma=NAN),
    ),
    "null: NaN": ("parameter 'bow', null: is no number", lambda: parameter("bow", 1.0, null=NAN)),
    "null: a word": ("parameter 'bow', null: is no number", lambda: parameter("bow", 1.0, null="off")),
    "unit: a number": ("parameter 'gain', unit: is no text", lambda: parameter("gain", 1.0, unit=3)),
    "fixed: a word": ("parameter 'gain', fixed: cannot be used", lambda: parameter("gain", 1.0, fixed="yes")),
    "name: twice": (
        "^the model: two parameters are called 'gain'",
        lambda: asked(parameters=[*sensor_parameters(), parameter("gain", 2.0)]),
    ),
    "name: of a candidate's parameter, too": (
        "two parameters are called 'gain'",
        lambda: offered("more", parameter("gain", 1.0, null=0.0)),
    ),
    "start: out of its bounds": (
        "start lies outside its bounds",
        lambda: asked(parameters=[parameter("gain", 3.0, upper=2.0)]),
    ),
    "bounds: both alike": ("bounds leave no room", lambda: asked(parameters=[parameter("gain", 1, lower=1, upper=1)])),
    # candidates and laws
    "candidate: null out of its bounds": (
        "null value lies outside",
        lambda: offered("bow", parameter("bow", 2.0, lower=1.0, null=0.0)),
    ),
    "candidate: no null": ("no parameter has a null value", lambda: offered("bow", parameter("bow", 0.1))),
    "candidate: begins at its null": (
        "starts at its null value",
        lambda: offered("bow", parameter("bow", 0.0, null=0.0)),
    ),
    "candidate: no parameter": ("has no parameter", lambda: offered("bow")),
    "candidate: another of its name": (
        "'bow' cannot be the name",
        lambda: asked(candidates=[BOW, candidate("bow", parameter("arc", 0.1, null=0.0))]),
    ),
    "candidate: fixed": ("'bow' is fixed", lambda: offered("bow", parameter("bow", 0.1, null=0.0, fixed=True))),
    "law: named as a parameter": ("'gain' cannot be the name", lambda: asked(candidates=law("gain", driver="u"))),
    "candidate: no name": ("candidate, name: is no text", lambda: candidate(parameter("bow", 0.1, null=0.0))),
    "candidate: a name for a parameter": ("candidate 'bow': cannot be used", lambda: candidate("bow", "bow")),
    "candidate: a number for a parameter": ("candidate 'bow': cannot be used", lambda: candidate("bow", 0.1)),
    "candidate: starts are numbers": (
        "candidate 'bow', starts: cannot be used",
        lambda: offered("bow", *BOW.parameters, starts=[0.2]),
    ),
    "candidate: a start is a word": (
        "candidate 'bow', starts, bow: is no number",
        lambda: offered("bow", *BOW.parameters, starts=[{"bow": "big"}]),
    ),
    "candidate: a start of another": (
        "candidate 'bow': a start cannot be used",
        lambda: offered("bow", *BOW.parameters, starts=[{"arc": 0.2}]),
    ),
    "candidate: a start is NaN": (
        "candidate 'bow', starts, bow: is no number",
        lambda: offered("bow", *BOW.parameters, starts=[{"bow": NAN}]),
    ),
    "candidate: a law that is none": (
        "candidate 'bow', laws: is no law",
        lambda: offered("bow", *BOW.parameters, laws=["y(v)"]),
    ),
    "candidate: family is a number": (
        "candidate 'bow', family: is no text",
        lambda: candidate("bow", *BOW.parameters, family=3),
    ),
    "law: a name of two words": ("law, name: is no name that a model can use", lambda: law("side force", driver="u")),
    "law: driver is a list": ("law 'force', driver: is no text", lambda: law("force", driver=["u"])),
    "law: one node": ("law 'force': has no such number of nodes", lambda: law("force", driver="u", nodes=1)),
    "law: half a node": ("law 'force': has no such number of nodes", lambda: law("force", driver="u", nodes=2.5)),
    "law: a million nodes": (
        "law 'force': has no such number of nodes",
        lambda: law("force", driver="u", nodes=1_000_000),
    ),
    "law: a range the wrong way round": (
        "law 'force': its range is empty",
        lambda: law("force", driver="u", low=1.0, high=-1.0),
    ),
    "law: a range without an end": (
        "law 'force', low and high: is no number",
        lambda: law("force", driver="u", high=INF),
    ),
    "law: a range of words": ("law 'force', low and high: is no number", lambda: law("force", driver="u", low="0")),
    "law: never asked for": (
        "predict: the model never calls the law 'force', or always with the same value",
        lambda: find_missing(asked(candidates=[law("force", driver="u")])),
    ),
    # the problem
    "predict: a word": ("predict: is no function", lambda: asked("line")),
    "predict: one argument": (
        "TypeError: .*takes 1 positional argument but 2 were given",
        lambda: asked(lambda p: p.gain),
    ),
    "predict: three arguments": (
        "TypeError: .*missing 1 required positional argument",
        lambda: asked(lambda p, _r, _q: p.gain),
    ),
    "predict: nothing": ("record 1: predict gives no numbers", lambda: asked(lambda _p, _r: None)),
    "predict: a word given back": ("record 1: predict gives no numbers", lambda: asked(lambda _p, _r: "y")),
    "predict: one number": ("record 1: predict gives a wrong shape", lambda: asked(lambda p, _r: p.gain)),
    "predict: complex": ("record 1: predict gives no numbers", lambda: asked(lambda p, r: p.gain * r.u + 1j)),
    "predict: a row too many": (
        "record 1: predict gives a wrong shape",
        lambda: asked(lambda p, r: [*line(p, r), 0.0]),
    ),
    "predict: two columns for one output": (
        "record 1: predict gives a wrong shape",
        lambda: asked(lambda _p, r: np.column_stack([r.u, r.y])),
    ),
    "predict: the square of the rows": (
        "record 1: predict gives a wrong shape",
        lambda: asked(lambda _p, r: np.outer(r.u, r.u)),
    ),
    "predict: another output": ("record 1: predict gives no 'y'", lambda: asked(lambda _p, r: {"z": r.u})),
    "predict: two for one": ("record 1: predict gives a wrong shape", lambda: asked(lambda _p, r: (r.u, r.y))),
    "predict: infinite": ("not a number: 'y' is inf in row 1", lambda: asked(lambda p, r: line(p, r) / 0.0)),
    "predict: raises": (
        r"ValueError: invalid literal for int\(\) with base 10: 'one'",
        lambda: asked(lambda p, r: line(p, r) + int("one")),
    ),
    "observed: nothing": ("record 1: is no table", lambda: asked(observed=None)),
    "observed: no records": ("observed: no record is given", lambda: asked(observed=[])),
    "observed: a missing file": (r"nowhere\.csv: no such file", lambda: asked(observed="nowhere.csv")),
    "observed: a number": ("record 1: is no table", lambda: asked(observed=3.0)),
    "observed: rows and columns without names": ("record 1: is no table", lambda: asked(observed=np.ones((9, 3)))),
    "observed: lists of numbers": ("record 1: is no table", lambda: asked(observed=[[1.0, 2.0], [3.0, 4.0]])),
    "observed: single numbers": (
        "record 1: columns are not of one length",
        lambda: asked(observed={"u": 1.0, "y": 2.0}),
    ),
    "observed: three rows": ("holds too little", lambda: asked(observed={"u": np.ones(3), "y": np.ones(3)})),
    "observed: columns of two lengths": (
        "columns are not of one length",
        lambda: asked(observed={"u": np.ones(9), "y": np.ones(8)}),
    ),
    "observed: no output": ("is measured nowhere", lambda: asked(observed=columns(y=np.full(ROWS, NAN)))),
    "observed: words alone": (
        "record 1: has no column of numbers",
        lambda: asked(observed={"u": ["a"] * 9, "y": ["b"] * 9}),
    ),
    "observed: the output in words": (
        "record 1: has no column 'y'",
        lambda: asked(observed=columns(y=["1.0 V"] * ROWS)),
    ),
    "observed: complex": ("record 1: has no column 'y'", lambda: asked(observed=columns(y=RECORD["y"] + 0j))),
    "observed: infinite": (
        "column 'y': is infinite somewhere",
        lambda: asked(observed=columns(y=np.where(np.arange(ROWS) == 4, INF, RECORD["y"]))),
    ),
    "observed: never changes": (
        "column 'y': never changes: there is nothing to explain",
        lambda: asked(observed=columns(y=np.ones(ROWS))),
    ),
    "observed: two tables in a mapping": (
        "record 1: columns are not of one length",
        lambda: asked(observed={"a": RECORD, "b": RECORD}),
    ),
    "observed: records of other columns": (
        "record 2: has no column 'y'",
        lambda: asked(observed=[RECORD, columns(y=None, z=RECORD["y"])]),
    ),
    "parameters: nothing": ("parameters: cannot be used", lambda: asked(parameters=None)),
    "parameters: a word": ("parameters: cannot be used", lambda: asked(parameters="gain")),
    "parameters: words": ("parameters: cannot be used", lambda: asked(parameters=["gain", "offset"])),
    "parameters: numbers": ("parameters: cannot be used", lambda: asked(parameters=[1.0, 2.0])),
    "parameters: a mapping to words": (
        "parameter 'gain', start: is no number",
        lambda: asked(parameters={"gain": "one"}),
    ),
    "parameters: a candidate": ("parameters: cannot be used", lambda: asked(parameters=[*sensor_parameters(), BOW])),
    "parameters: all fixed": (
        "the model: has no free parameter",
        lambda: asked(parameters=[parameter("gain", 2.0, fixed=True)]),
    ),
    "candidates: a word": ("candidates: cannot be used", lambda: asked(candidates="bow")),
    "candidates: a parameter": (
        "candidates: cannot be used",
        lambda: asked(candidates=[parameter("bow", 0.1, null=0.0)]),
    ),
    "candidates: the same twice": (
        "the model: 'bow' cannot be the name of a candidate or law",
        lambda: asked(candidates=[BOW, BOW]),
    ),
    "output: nothing": ("output: cannot be used", lambda: asked(output=None)),
    "output: empty": ("record 1: has no column ''", lambda: asked(output="")),
    "output: none": ("output: no output is named", lambda: asked(output=[])),
    "output: a number": ("output: cannot be used", lambda: asked(output=1)),
    "output: twice": ("output: holds a name twice", lambda: asked(output=["y", "y"])),
    "output: the time": ("output: is the time", lambda: asked(output="time_s")),
    "output: not there": ("record 1: has no column 'z'", lambda: asked(output="z")),
    "initial: not declared": ("initial: 'x0' is no parameter of the model that is free", lambda: asked(initial=["x0"])),
    "initial: a mapping of values": ("initial: cannot be used", lambda: asked(initial={"x0": 1.0})),
    "initial: a number": ("initial: cannot be used", lambda: asked(initial=3)),
    "initial: fixed": (
        "initial: 'x0' is no parameter of the model that is free",
        lambda: asked(parameters=[*sensor_parameters(), parameter("x0", 1.0, fixed=True)], initial="x0"),
    ),
    "drivers: not there": ("record 1: has no column 'speed'", lambda: asked(drivers=["speed"])),
    "drivers: a number": ("drivers: cannot be used", lambda: asked(drivers=3)),
    "drivers: arrays": ("drivers: cannot be used", lambda: asked(drivers={"u": RECORD["u"]})),
    "drivers: with gaps": (
        "driver 'v': is not known in every row",
        lambda: asked(observed=columns(v=np.where(np.arange(ROWS) == 4, NAN, RECORD["u"])), drivers=["v"]),
    ),
    "reading: a mapping": ("reading: cannot be used", lambda: asked(reading={"sigma": 0.05})),
    "reading: a number": ("reading: cannot be used", lambda: asked(reading=0.05)),
    "sigma: zero": ("Reading, sigma: is no positive number", lambda: read(sigma=0.0)),
    "sigma: zero, whole": ("Reading, sigma: is no positive number", lambda: read(sigma=0)),
    "sigma: negative": ("Reading, sigma: is no positive number", lambda: read(sigma=-1.0)),
    "sigma: NaN": ("Reading, sigma: is no positive number", lambda: read(sigma=NAN)),
    "sigma: infinite": ("Reading, sigma: is no positive number", lambda: read(sigma=INF)),
    "sigma: no column": ("record 1: has no column 'noise'", lambda: read(sigma="noise")),
    "sigma: True": ("Reading, sigma: is no positive number", lambda: read(sigma=True)),
    "sigma: a list": ("Reading, sigma: is no positive number", lambda: read(sigma=[0.05, 0.05])),
    "sigma: of another output": ("z: is no output that sigma could belong to", lambda: read(sigma={"z": 0.05})),
    "sigma: a list for an output": ("Reading, sigma of y: is no positive number", lambda: read(sigma={"y": [0.05]})),
    "resolution: negative": ("Reading, resolution: is no positive number", lambda: read(resolution=-1.0)),
    "resolution: NaN": ("Reading, resolution: is no positive number", lambda: read(resolution=NAN)),
    "resolution: a list": ("Reading, resolution: is no positive number", lambda: read(resolution=[0.1])),
    "blocks: none": ("Reading, blocks: are no blocks", lambda: read(blocks=0)),
    "blocks: half a one": ("Reading, blocks: are no blocks", lambda: read(blocks=2.5)),
    "blocks: True": ("Reading, blocks: are no blocks", lambda: read(blocks=True)),
    "blocks: more than rows": ("blocks: block 0 holds hardly any sample", lambda: read(blocks=10_000)),
    "blocks: no column": ("record 1: has no column 'stroke'", lambda: read(blocks="stroke")),
    "blocks: numbers of another length": (
        "record 1, blocks: blocks are not known in every row",
        lambda: read(blocks=[np.zeros(9)]),
    ),
    "blocks: for two records": (
        "blocks: not every record has its blocks",
        lambda: read(blocks=[np.zeros(ROWS), np.zeros(ROWS)]),
    ),
    "rest: no column": ("record 1: has no column 'stop'", lambda: read(rest="stop")),
    "rest: True": ("Reading, rest: is no text", lambda: read(rest=True)),
    "time: no column": ("record 1: has no column 'clock'", lambda: read(time="clock")),
    "time: a number": ("Reading, time: is no text", lambda: read(time=0.5)),
    "time: falls": (
        "record 1, row 2, column time_s: time runs backwards",
        lambda: asked(observed=columns(time_s=RECORD["time_s"][::-1])),
    ),
    "time: stands still": (
        "record 1, row 1, column time_s: time stands still",
        lambda: asked(observed=columns(time_s=np.zeros(ROWS))),
    ),
    "time: a gap": (
        "record 1, row 5, column time_s: time is not known",
        lambda: asked(observed=columns(time_s=np.where(np.arange(ROWS) == 4, NAN, RECORD["time_s"]))),
    ),
    # differential equations
    "ode: no function": ("ode, rhs: is no function", lambda: moved(rhs="x")),
    "ode: no states": ("ode: has no state", lambda: moved(states=[])),
    "ode: a state twice": ("ode, states: holds a name twice", lambda: moved(states=["x", "x"])),
    "ode: a state that is no name": ("ode, states: is no name that a model can use", lambda: moved(states=["x pos"])),
    "ode: states are numbers": ("ode, states: cannot be used", lambda: moved(states=2)),
    "ode: an output that is no state": ("ode: 'z' is no state", lambda: moved(output="z")),
    "ode: an input that is not there": ("record 1: has no column 'force'", lambda: moved(inputs=["force"])),
    "ode: a beginning of no state": ("ode: 'z' is no state", lambda: moved(initial={"z": 0.0})),
    "ode: a beginning that is NaN": ("ode, initial, x: is no number", lambda: moved(initial={"x": NAN})),
    "ode: a beginning that is nothing": ("ode, initial, x: is no number", lambda: moved(initial={"x": None})),
    "ode: a beginning without a state": ("ode, initial: cannot be used", lambda: moved(initial=0.0)),
    "ode: a beginning that is not there": (
        "record 1: how state 'x' begins is not known",
        lambda: moved(initial={"x": "x0"}),
    ),
    "ode: an event that is a function": (
        "ode, events: cannot be used",
        lambda: moved(events=[lambda _t, x, _u, _p: x[0]]),
    ),
    "ode: an event without a function": ("Event, when: is no function", lambda: moved(events=[Event("x")])),
    "ode: an event with no such direction": (
        "Event: is no direction",
        lambda: moved(events=[Event(lambda _t, x, _u, _p: x[0], direction=2)]),
    ),
    "ode: two derivatives of one state": (
        "record 1: the right-hand side gives no derivative for every state",
        lambda: moved(rhs=lambda _t, _x, u, _p: (u.u, 0.0)),
    ),
    "ode: no derivatives": (
        "record 1: the right-hand side gives no derivative for every state",
        lambda: moved(rhs=lambda _t, _x, _u, _p: None),
    ),
    "ode: a right-hand side of three": (
        "TypeError: .*takes 3 positional arguments but 4 were given",
        lambda: moved(rhs=lambda _t, _x, u: (u.u,)),
    ),
    "ode: a method's name": ("ode, solver: cannot be used", lambda: moved(solver="RK45")),
    "ode: no such method": ("Solver, method: is no method", lambda: moved(solver=Solver(method="Euler"))),
    "ode: no tolerance": ("Solver, rtol: is no positive number", lambda: moved(solver=Solver(rtol=0.0))),
    "ode: no step": ("Solver, max_step: is no positive number", lambda: moved(solver=Solver(max_step=0.0))),
    # the search
    "search: nothing": ("find_missing: is no problem", lambda: find_missing(None)),
    "search: a record": ("find_missing: is no problem", lambda: find_missing(RECORD)),
    "search: settings as a mapping": (
        "find_missing, settings: cannot be used",
        lambda: find_missing(asked(), settings={"missing": 0.5}),
    ),
    "search: a probability above one": (
        "missing is no probability",
        lambda: find_missing(asked(), settings=Settings(missing=2.0)),
    ),
    "search: no sets": ("most is too small", lambda: find_missing(asked(), settings=Settings(most=0))),
    "search: processes is a number": (
        "find_missing, processes: cannot be used",
        lambda: find_missing(asked(), processes=2),
    ),
    "search: progress is no function": (
        "find_missing, progress: is no function",
        lambda: find_missing(asked(), progress="loud"),
    ),
    # a model that is linear in its parameters
    "linear: a column of another length": (
        "linear_problem, 'gain': has another length than the measured values",
        lambda: straight(base={"gain": RECORD["u"][1:]}),
    ),
    "linear: a column with a gap": (
        r"LinearProblem\.predict, row 5: is not a number",
        lambda: straight(base={"gain": np.where(np.arange(ROWS) == 4, NAN, RECORD["u"])}),
    ),
    "linear: no base": ("the model: has no free parameter", lambda: straight(base={})),
    "linear: nothing measured": (
        r"LinearProblem\.valid: no sample counts",
        lambda: straight(observed=np.full(ROWS, NAN)),
    ),
    "linear: a name twice": (
        "the model and candidate 'bow': two parameters are called 'gain'",
        lambda: straight(candidates={"bow": {"gain": RECORD["u"] ** 2}}),
    ),
    "linear: a driver of another length": (
        "linear_problem, 'u': has another length than the measured values",
        lambda: straight(drivers={"u": RECORD["u"][1:]}),
    ),
    "linear: negative noise": (r"LinearProblem\.sigma: is no noise", lambda: straight(sigma=-1.0)),
    "linear: blocks of another length": (
        "linear_problem, 'block': has another length than the measured values",
        lambda: straight(block=np.zeros(9, int)),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_meant_is_refused_in_one_sentence(name: str) -> None:
    words, declare = REFUSED[name]
    with pytest.raises(TorsightError, match=words) as told:
        declare()
    assert told.value.do or told.value.limit
    assert "\n" not in str(told.value)


STOP = Event(lambda _t, x, _u, _p: x[0] - 10.0)

TAKEN: dict[str, Callable[[], Any]] = {
    "one candidate": lambda: asked(bowed, candidates=BOW),
    "a parameter in a list": lambda: asked(bowed, candidates=[candidate("bow", list(BOW.parameters))]),
    "one start": lambda: offered("bow", *BOW.parameters, starts={"bow": 0.2}),
    "one law": lambda: offered("bow", *BOW.parameters, laws="y(u)"),
    "one parameter": lambda: asked(lambda p, r: p.gain * r.u, parameters=parameter("gain", 2)),
    "parameters by their starts": lambda: asked(parameters={"gain": np.float32(1.5), "offset": np.array(0)}),
    "parameters one by one": lambda: asked(parameters=(one for one in sensor_parameters())),
    "one output in a tuple": lambda: asked(output=("y",)),
    "one initial state": lambda: asked(initial="offset"),
    "one driver": lambda: asked(drivers="u"),
    "no drivers": lambda: asked(drivers=()),
    "a noise that is a whole number": lambda: read(sigma=1),
    "noise of the one output": lambda: read(sigma={"y": np.float64(0.05)}),
    "noise in a column": lambda: asked(observed=columns(noise=np.full(ROWS, 0.05)), reading=Reading(sigma="noise")),
    "blocks of one record": lambda: read(blocks=np.arange(ROWS) // 100),
    "a number of blocks of numpy": lambda: read(blocks=np.int64(4)),
    "lists for columns": lambda: asked(observed={name: values.tolist() for name, values in RECORD.items()}),
    "a column of words beside": lambda: asked(observed=columns(remark=["fine"] * ROWS)),
    "a gap in the output": lambda: asked(observed=columns(y=np.where(np.arange(ROWS) == 4, NAN, RECORD["y"]))),
    "predictions in a list": lambda: asked(lambda p, r: line(p, r).tolist()),
    "predictions in a column": lambda: asked(lambda p, r: {"y": line(p, r), "more": 0.0}),
    "one state, input and event": lambda: moved(states="x", inputs="u", events=STOP),
    "a right-hand side that gives an array": lambda: moved(rhs=lambda _t, x, u, p: p.gain * u.u - x + p.offset),
}


@pytest.mark.parametrize("name", TAKEN)
def test_what_is_plainly_meant_is_taken(name: str) -> None:
    made = TAKEN[name]()
    assert made.evaluator.calls > 0
    assert not made.evaluator.failures
