"""The model during the measurement: computed in a separate process, from the thinned record so far."""

from __future__ import annotations

import math
import signal
import threading
import time
from array import array
from collections.abc import Mapping
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from torsight.actuator.drive import ROW_RATE_HZ
from torsight.core.errors import TorsightError
from torsight.core.parallel.processes import end_with_parent
from torsight.core.progress import ATTENTION_S
from torsight.core.records import SyncedTable
from torsight.core.units import DEG, Floats
from torsight.viewer.program import step_back
from torsight.viewer.run_words import HalfCycleBegin

if TYPE_CHECKING:
    from torsight.actuator.drive import Drive
    from torsight.actuator.spec import ActuatorSpec


STEP_S: Final = 1.0 / ROW_RATE_HZ
"""Rows of the thinned record: as many as a fit keeps."""
LEAST_ROWS: Final = round(ATTENTION_S / STEP_S)
"""Rows before the model is first computed, when a person begins to wonder. In a shorter record it finds no heating and
reports that."""


class Thinned:
    """Means over fixed time steps of values that arrive one by one."""

    def __init__(self, width: int) -> None:
        self._step: int | None = None
        self._sum = np.zeros(width)
        self._count = np.zeros(width)
        self._time_s = array("d")
        self._values = [array("d") for _ in range(width)]

    def add(self, time_s: float, values: tuple[float, ...]) -> None:
        """Add one sample; NaN does not count."""
        step = math.floor(time_s / STEP_S)
        if self._step is not None and step != self._step:
            self._close()
        if self._step is None or step > self._step:
            self._step = step
        for place, value in enumerate(values):
            if value == value:  # noqa: PLR0124 - a NaN is not itself
                self._sum[place] += value
                self._count[place] += 1.0

    def _close(self) -> None:
        if self._step is None or not self._count.any():
            return
        self._time_s.append((self._step + 0.5) * STEP_S)
        for column, total, count in zip(self._values, self._sum, self._count, strict=True):
            column.append(total / count if count else math.nan)
        self._sum[:] = self._count[:] = 0.0

    def __len__(self) -> int:
        return len(self._time_s)

    def columns(self) -> tuple[Floats, ...]:
        """Return time and values of every closed step."""
        return tuple(np.array(one, dtype=np.float64) for one in (self._time_s, *self._values))


@dataclass(frozen=True, slots=True, eq=False)
class ModelNews:
    """The model's results for the record so far, or why there are none (``trouble``).

    They are the modelled angle, and measured minus modelled (n,; NaN where not measured); every half-cycle that has
    begun; after a fit, the friction torque in the form of the JSON outputs, and all values of this fit, which are used
    from then on.
    """

    time_s: Floats = field(default_factory=lambda: np.empty(0))
    angle_rad: Floats = field(default_factory=lambda: np.empty(0))
    residual_rad: Floats = field(default_factory=lambda: np.empty(0))
    half_cycles: tuple[HalfCycleBegin, ...] = ()
    friction: dict[str, Any] | None = None
    values: Mapping[str, float] | None = None
    trouble: str = ""


def model_of(
    spec: ActuatorSpec, columns: tuple[Floats, ...], values: Mapping[str, float] | None, *, friction: bool
) -> ModelNews:
    """Simulate the plain model on a record, after fitting it if ``friction`` is true; runs in a separate process."""
    from torsight.actuator.effects import always_fitted
    from torsight.actuator.model import ActuatorModel

    time_s, angle, sigma, temp_a, temp_b, heat_a, heat_b = columns
    switched = bool(np.isfinite(heat_a).all() and np.isfinite(heat_b).all())
    heated = (heat_a > 0.5, heat_b > 0.5) if switched else ()
    table = SyncedTable(time_s, angle, sigma, temp_a, temp_b, *heated)
    try:
        # The effects that every fit has in addition to the characterised values; without a fit they change nothing.
        model = ActuatorModel(spec, [effect.id for effect in always_fitted()])
        drive = model.prepare(table, where="live record")
        estimate = None
        if friction:
            from torsight.discovery.model_fit import fit_model

            fit = fit_model(model, drive)
            values, estimate = fit.values, fit.estimates["tau_c_mnm"].to_json()
        simulation = model.simulate(drive, values)
    except TorsightError as error:
        return ModelNews(trouble=str(error))
    return ModelNews(
        drive.time_s,
        simulation.angle_rad,
        drive.angle_rad - simulation.angle_rad,
        half_cycles=_begins(drive),
        friction=estimate,
        values=values,
    )


def _begins(drive: Drive) -> tuple[HalfCycleBegin, ...]:
    return tuple(
        HalfCycleBegin(float(drive.time_s[row]), float(drive.angle_rad[row] / DEG), "AB"[spring])
        for row, spring in zip(drive.cycles.begins.tolist(), drive.cycles.springs, strict=True)
    )


class ModelWatch:
    """Keeps the thinned record, and repeatedly starts computing the model from it, without waiting for the result.

    ``last_fit_s`` is the time for which the end of a record waits for the fit to the whole record.
    """

    def __init__(self, spec: ActuatorSpec, *, last_fit_s: float = 20.0) -> None:
        self._spec, self.last_fit_s = spec, last_fit_s
        self._angles = Thinned(2)
        self._temperatures = Thinned(4)
        self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_quiet)
        self._job: Future[ModelNews] | None = None
        self._half_cycles = 1
        self._fit_next = False
        self._known_s = -math.inf
        self._values: Mapping[str, float] | None = None
        self.broken = False

    def begin_again(self) -> None:
        """Discard all angles: they will be given again, for other markers."""
        self._angles = Thinned(2)
        self._known_s = -math.inf

    def angle(self, time_s: float, angle_rad: float, sigma_rad: float) -> None:
        """Take a measured angle."""
        self._angles.add(time_s, (angle_rad, sigma_rad))

    def temperature(self, film_time_s: float, values: tuple[float, ...]) -> None:
        """Take both temperatures and both switches, at a time on the film's clock."""
        self._temperatures.add(film_time_s, values)

    def poll(self) -> ModelNews | None:
        """Return results since the last poll, and start the next computation."""
        news: ModelNews | None = None
        if self._job is not None and self._job.done():
            news = self._result()
            self._job = None
        if self._job is None and not self.broken:
            self._ask()
        return news

    def last(self, limit_s: float) -> list[ModelNews]:
        """Return the last results of a record that has ended, including a last fit, within a time limit."""
        end = time.monotonic() + limit_s
        found: list[ModelNews] = []
        if self._job is not None:
            wait([self._job], timeout=limit_s)
            found += [news for news in (self.poll(),) if news is not None]
        for _ in range(2):
            # The first result may be of a computation started by poll; a fit that it contains is not repeated.
            self._fit_next = not any(news.friction for news in found)
            self._ask(whole=self._fit_next)
            if self._job is None:
                break
            wait([self._job], timeout=max(0.0, end - time.monotonic()))
            if not self._job.done():
                break
            news, self._job = self._result(), None
            found += [news] if news is not None else []
        return found

    def why_no_fit(self) -> str:
        """Return why the record's end has brought no fit, where the model itself gave no reason."""
        if self.broken:
            return "the model's process ended"
        if self._job is not None:
            return f"the fit was not done within {self.last_fit_s:g} s; 'torsight run' makes it"
        return f"less than {LEAST_ROWS * STEP_S:g} s of the record have both an angle and temperatures"

    def close(self) -> None:
        """End the process; a job that runs is given up."""
        for process in list((self._pool._processes or {}).values()):  # noqa: SLF001 - it has no other way not to wait
            process.terminate()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _ask(self, *, whole: bool = False) -> None:
        columns = self._columns(again=whole)
        if self._job is not None or columns is None:
            return
        try:
            self._job = self._pool.submit(model_of, self._spec, columns, self._values, friction=self._fit_next)
        except (BrokenProcessPool, RuntimeError):
            self.broken = True
        self._fit_next = False

    def _result(self) -> ModelNews | None:
        if self._job is None:
            return None
        try:
            news = self._job.result()
        except BrokenProcessPool:
            self.broken = True
            return None
        except Exception as error:  # noqa: BLE001 - whatever ails the model, the measurement goes on
            return ModelNews(trouble=f"{type(error).__name__}: {error}")
        if len(news.half_cycles) > self._half_cycles:
            self._half_cycles = len(news.half_cycles)
            self._fit_next = True
        if news.values is not None:
            self._values = news.values
        new = news.time_s > self._known_s
        if len(news.time_s):
            self._known_s = float(news.time_s[-1])
        return replace(
            news, time_s=news.time_s[new], angle_rad=news.angle_rad[new], residual_rad=news.residual_rad[new]
        )

    def _columns(self, *, again: bool) -> tuple[Floats, ...] | None:
        """Return the part of the record that has both angle and temperatures; None if it has not grown."""
        if min(len(self._angles), len(self._temperatures)) < LEAST_ROWS:
            return None
        time_s, angle, sigma = self._angles.columns()
        log_s, *temperatures = self._temperatures.columns()
        inside = (time_s >= log_s[0]) & (time_s <= log_s[-1])
        if inside.sum() < LEAST_ROWS or (not again and time_s[inside][-1] <= self._known_s):
            return None
        at_s = time_s[inside]
        return (at_s, angle[inside], sigma[inside], *(np.interp(at_s, log_s, one) for one in temperatures))


def _quiet() -> None:
    """Ignore Ctrl-C, lower this process's priority, and end when the measuring process is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    step_back()
    threading.Thread(target=end_with_parent, daemon=True).start()
