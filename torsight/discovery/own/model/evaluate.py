"""Calls of one's own model: once per point, in processes where that saves time; failures are kept with their location.

A model in plain Python holds the interpreter's lock, so that threads do not make it faster; processes do, where the
model can be pickled. The result of every point is cached: sets of effects share most points, because an effect that is
off has its parameters at their null values. The model is called again for a record only where values have changed that
concern this record, such as its initial state.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from types import CodeType, FunctionType
from typing import Any, Final

import numpy as np

from torsight.core.errors import InputError
from torsight.core.parallel.threads import WORKERS
from torsight.core.units import Floats
from torsight.discovery.own.model.values import Curve, Values, by_name
from torsight.discovery.own.own_records import Record

Predict = Callable[[Any, Any], Any]
Curves = Mapping[str, Curve]
"""Laws that are on, by their names."""

WORTH_S: Final = 4e-3
"""Duration of one call in seconds from which a model is compiled or called in processes: compiling takes 2 to 5 s, two
processes take 1.3 s each to start, and a search makes 1,500 to 8,500 calls (benchmarks/discovery/own_model.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The function, from values and a record to the outputs, and the records with which it is called.

    ``outputs`` are the names of the outputs in the order in which the function returns them, empty where that is not
    known yet; ``laws`` are the names of the laws that the function calls.
    """

    predict: Predict
    records: tuple[Record, ...]
    outputs: tuple[str, ...]
    laws: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CompiledPredict:
    """A compiled ``predict``; if it raises an error or gives no numbers, the plain one is called, to name the line."""

    plain: Callable[..., Any]
    fast: Callable[..., Any]

    @property
    def __wrapped__(self) -> Callable[..., Any]:
        return self.plain

    def __call__(self, p: Any, record: Any) -> Any:
        """Return the outputs for a record."""
        try:
            found = self.alone(p, record)
        except Exception:  # noqa: BLE001 - the plain one raises it, too, and with its own traceback
            return self.plain(p, record)
        outputs = found.values() if isinstance(found, Mapping) else found if isinstance(found, tuple) else (found,)
        return found if all(np.isfinite(one).all() for one in outputs) else self.plain(p, record)

    def alone(self, p: Any, record: Any) -> Any:
        """Return the result of the compiled function alone, or raise its error."""
        return self.fast(by_name(p), by_name(record))


class ModelError(InputError):
    """A model that cannot be used; the model's own traceback is a note of the error."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A call that returned no numbers: kind and message of the exception, parameters and record of the call.

    ``place`` is file, line and function in which the exception was raised, ``trace`` the traceback from the model's own
    function on, empty without an exception.
    """

    kind: str
    message: str
    place: str
    trace: str
    values: Mapping[str, float]
    record: str

    def sentence(self) -> str:
        """Return one sentence: what failed, where, and for which values."""
        return self._sentence(self.place)

    def _sentence(self, *places: str) -> str:
        """Return the sentence with these places, and with the record unless the message names it."""
        record = [f"record '{self.record}'"]
        given = ", ".join(f"{name}={value:.6g}" for name, value in self.values.items())
        kind = f"{self.kind}: " if self.kind else ""
        parts = [*places, *(record if record[0] not in self.message else []), given]
        return f"{kind}{self.message} ({'; '.join(parts)})"

    def error(self, where: str) -> ModelError:
        """Return the failure as a ModelError, for a model that cannot be used at all."""
        changes = "read-only" in self.message or "cannot be changed" in self.message
        copy = "; what predict is given stays as it is: work on a copy" if changes else ""
        # An InputError (without a kind) needs no introduction.
        fails = "the model fails: " if self.kind else ""
        what_failed = self.sentence()
        if self.place.partition(", line ")[0] in where:
            # The line of an exception says more than that of the function; the file is named once.
            what_failed, where = self._sentence(), self.place
        error = ModelError(f"{fails}{what_failed}{copy}", where=where, do="correct the model, or the record")
        if self.trace:
            error.add_note(f"The model's own traceback:\n{self.trace}")
        return error


@dataclass(frozen=True, slots=True, eq=False)
class Called:
    """One call: its outputs (rows, outputs) or its failure, the text that it printed, and its duration.

    ``asked`` is the range of the values with which each law was called, by the law's name.
    """

    outputs: Floats | None
    failure: Failure | None
    printed: str
    seconds: float
    asked: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def call(model: Model, record: int, values: Mapping[str, float], curves: Curves) -> Called:
    """Call the model with the laws that are on; an exception becomes a failure, unless it is a keyboard interrupt."""
    of = model.records[record]
    laws = {name: curves[name].afresh() if name in curves else Curve() for name in model.laws}
    begun = time.thread_time()
    try:
        with np.errstate(all="ignore"):  # values that are no numbers are reported as a failure
            given = model.predict(Values({**values, **laws}), of)
        outputs = outputs_of(given, of, model.outputs)
        failure = None if np.isfinite(outputs).all() else _not_finite(outputs, of, model, values)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the model is somebody else's
        outputs, failure = None, _failure(error, model, of, values)
    asked = {name: (float(one.asked[0]), float(one.asked[1])) for name, one in laws.items()}
    return Called(outputs if failure is None else None, failure, "", time.thread_time() - begun, asked)


def outputs_of(given: Any, record: Record, names: Sequence[str]) -> Floats:
    """Return the result of ``predict`` as an array (rows, outputs); a missing output or a wrong shape is refused."""
    if isinstance(given, Mapping):
        missing = [name for name in names if name not in given]
        if missing:
            do = "give outputs (states of an ode, too) the names of the columns that were measured"
            raise InputError(
                f"predict gives no '{missing[0]}'", where=record.label_, value=", ".join(map(str, given)), do=do
            )
        columns = [np.asarray(given[name]) for name in names]
    elif isinstance(given, tuple) or (isinstance(given, list) and len(names) > 1):
        columns = [np.asarray(one) for one in given]
    else:
        whole = np.asarray(given)
        columns = [whole] if whole.ndim == 1 or len(names) == 1 else list(whole.T)
    if any(column.dtype.kind not in "fiub" for column in columns):
        raise InputError("predict gives no numbers", where=record.label_, value=repr(given), do="return real numbers")
    shapes = [column.shape for column in columns]
    if len(columns) != len(names) or any(shape != (record.rows_,) for shape in shapes):
        raise InputError(
            "predict gives a wrong shape",
            where=record.label_,
            value=", ".join(str(shape) for shape in shapes),
            limit=f"({record.rows_},) for each of {', '.join(names)}",
            do="give one value per row of the record",
        )
    return np.column_stack(columns).astype(np.float64)


def _not_finite(outputs: Floats, record: Record, model: Model, values: Mapping[str, float]) -> Failure:
    row, output = (int(place[0]) for place in np.nonzero(~np.isfinite(outputs)))
    unknown = [name for name in record if name not in model.outputs and not np.isfinite(record[name][row])]
    because = f"; there {', '.join(unknown)} is not known" if unknown else ""
    code = code_of(model.predict)
    name = "predict" if code is None else code.co_name
    message = f"'{model.outputs[output]}' is {outputs[row, output]} in row {row + 1}{because}"
    return Failure("not a number", message, f"what {name} gives", "", dict(values), record.label_)


def _failure(error: BaseException, model: Model, record: Record, values: Mapping[str, float]) -> Failure:
    frames = traceback.extract_tb(error.__traceback__)[1:]
    # For the model's author: the last line of the model's own file, whatever that line called.
    file = _file_of(model)
    own = [frame for frame in frames if frame.filename == file]
    place = f"{own[-1].filename}, line {own[-1].lineno}, in {own[-1].name}" if own else place_of(model.predict)
    ours = isinstance(error, InputError)
    trace = "".join(traceback.format_list(frames) + traceback.format_exception_only(error))
    # An error about the returned values has no line in the model.
    trace, kind = ("" if ours and not own else trace), ("" if ours else type(error).__name__)
    return Failure(kind, str(error), place, trace, dict(values), record.label_)


def _file_of(model: Model) -> str:
    """Return the file that defines a model's function, empty where it is unknown."""
    code = code_of(model.predict)
    return "" if code is None else code.co_filename


def place_of(predict: Predict) -> str:
    """Return where a model is defined: file, line and name."""
    code = code_of(predict)
    return "predict" if code is None else f"{code.co_filename}, line {code.co_firstlineno}, {code.co_name}"


def code_of(predict: Predict) -> CodeType | None:
    """Return the code of the function that the author wrote: the right-hand side, or the source of a compiled one."""
    written = inspect.unwrap(predict)
    return written.__code__ if isinstance(written, FunctionType) else None


_sent: tuple[Model, str] | None = None
"""In a worker process: the model that it calls, and the file that defines the model."""


def _receive(pickled: bytes, file: str) -> None:
    global _sent  # noqa: PLW0603 - a process works for one model
    import cloudpickle

    _sent = cloudpickle.loads(pickled), file


def _has_begun() -> None:
    """Do nothing: a worker process that returns from this has received its model."""


def _call_sent(record: int, values: Mapping[str, float], curves: Curves) -> Called:
    if _sent is None:
        raise RuntimeError("this process has no model")
    out = io.StringIO()
    model, file = _sent
    with contextlib.redirect_stdout(out):
        done = call(model, record, values, curves)
    # A function may lose the name of its file when it is pickled.
    lost, failure = _file_of(model), done.failure
    if failure is not None and lost and file:
        named = {name: getattr(failure, name).replace(lost, file) for name in ("place", "trace")}
        done = replace(done, failure=replace(failure, **named))
    return replace(done, printed=out.getvalue())


class Evaluator:
    """Evaluates a model at points, each once.

    It counts the ``calls`` and the ``seconds`` that they took, added up over processes, and keeps the beginning of the
    text that the model ``printed`` in worker processes.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.calls = 0
        self.seconds = 0.0
        self.printed = ""
        self.failures: list[Failure] = []
        self._pool: Any = None
        self._ready: Future[None] | None = None
        self._lock = threading.Lock()
        self._kept: OrderedDict[bytes, Future[Called]] = OrderedDict()
        self._size = max(1, max(record.rows_ for record in model.records) * 8 * max(1, len(model.outputs)))

    def __call__(self, values: Sequence[Mapping[str, float]], curves: Curves) -> list[Called]:
        """Return the calls for every record, each with values of its own."""
        return self.many([(values, curves)])[0]

    def many(self, asked: Sequence[tuple[Sequence[Mapping[str, float]], Curves]]) -> list[list[Called]]:
        """Return the calls for every record at several points, all submitted before the first result is awaited."""
        waiting = [[self._begin(record, own, curves) for record, own in enumerate(one)] for one, curves in asked]
        return [[future.result() for future in one] for one in waiting]

    def forget(self) -> None:
        """Clear the cache: every point is called anew."""
        with self._lock:
            self._kept.clear()

    def _begin(self, record: int, values: Mapping[str, float], curves: Curves) -> Future[Called]:
        numbers = [np.array(list(values.values())), *(one for c in curves.values() for one in (c.nodes, c.values))]
        key = f"{record} {' '.join(values)} {' '.join(curves)}".encode() + np.concatenate(numbers).tobytes()
        with self._lock:
            known = self._kept.get(key)
            if known is not None:
                self._kept.move_to_end(key)
                return known
            future: Future[Called] = Future()
            self._kept[key] = future
            # Beyond so many bytes of predictions the least recently used ones are dropped.
            while len(self._kept) * self._size > 256_000_000:
                self._kept.popitem(last=False)
        ready = self._ready
        if self._pool is None or ready is None or not ready.done() or ready.exception() is not None:
            self._finish(future, call(self.model, record, values, curves))
        else:
            sent = self._pool.submit(_call_sent, record, values, curves)
            sent.add_done_callback(lambda done: self._arrived(future, done))
        return future

    def _arrived(self, future: Future[Called], done: Any) -> None:
        error = done.exception()
        if error is not None:
            future.set_exception(error)
        else:
            self._finish(future, done.result())

    def _finish(self, future: Future[Called], done: Called) -> None:
        with self._lock:
            self.calls += 1
            self.seconds += done.seconds
            self.printed = (self.printed + done.printed)[:2000]
            if done.failure is not None:
                self.failures.append(done.failure)
        future.set_result(done)

    def change(self, model: Model) -> None:
        """Call another model from now on, in worker processes if the model before was called in such."""
        self.forget()
        self.model, called_there = model, self._pool is not None
        self._end()
        if called_there:
            self._begin_processes(self._pickled(wanted=None))

    @contextlib.contextmanager
    def processes(self, *, wanted: bool | None = None) -> Iterator[bool]:
        """Call the model in worker processes within the block if that saves time or is ``wanted``; yield whether.

        The model is called in this process until the first worker process is ready, and if none can start.
        """
        self._begin_processes(self._pickled(wanted=wanted))
        if wanted and self._ready is not None:
            self._ready.result()
        try:
            yield self._pool is not None
        finally:
            self._end()

    def _begin_processes(self, pickled: bytes | None) -> None:
        if pickled is None:
            return
        from joblib.externals.loky import ProcessPoolExecutor

        pool = ProcessPoolExecutor(max_workers=WORKERS, initializer=_receive, initargs=(pickled, _file_of(self.model)))
        self._pool, self._ready = pool, pool.submit(_has_begun)

    def _end(self) -> None:
        pool, self._pool, self._ready = self._pool, None, None
        if pool is not None:
            # No call is pending; a process that is still starting is not awaited.
            pool.shutdown(wait=True, kill_workers=True)

    def _pickled(self, *, wanted: bool | None) -> bytes | None:
        """Return the pickled model for worker processes; None where the model stays in this process."""
        import cloudpickle
        from joblib import cpu_count

        pays = self.calls > 0 and self.seconds / self.calls >= WORTH_S and cpu_count() > 1
        if wanted is False or (wanted is None and not pays):
            return None
        try:
            return bytes(cloudpickle.dumps(self.model))
        except Exception:  # objects in a model may refuse to be pickled in any way
            if wanted:
                raise
            return None
