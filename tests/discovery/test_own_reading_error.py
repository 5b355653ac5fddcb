"""Drivers that hold an output's reading error are told from causes: an independent system makes both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage, signal

from torsight.core.errors import InputError
from torsight.discovery import candidate, find_missing, law, model_problem, parameter
from torsight.discovery.own.reading_error import follows_readings, holds_reading_error

Array = np.ndarray
ROWS, NOISE = 600, 0.1


def course(rng: np.random.Generator, kind: str) -> Array:
    if kind == "steps":
        return np.repeat(rng.uniform(-1.5, 1.5, ROWS // 25), 25)
    made = ndimage.gaussian_filter1d(rng.normal(size=ROWS), {"slow": 15.0, "quick": 6.0}[kind], mode="wrap")
    return (made - made.mean()) / made.std()


def curve(rng: np.random.Generator, values: Array) -> Array:
    """Return a random smooth function of values: four half waves over their range."""
    along = np.pi * (values - values.min()) / np.ptp(values)
    made = sum(rng.normal() / k * np.sin(k * along + rng.uniform(0.0, 6.28)) for k in range(1, 5))
    return np.asarray(made / np.std(made))


def lagged(values: Array, rows: float) -> Array:
    keep = np.exp(-1.0 / rows)
    return np.asarray(signal.lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


def system(kind: str, hidden: str, *, lag_rows: float, seed: int) -> tuple[Array, Array, dict[str, Array]]:
    """Return the reading, the prediction of a model without the hidden effect, and causes that all are innocent."""
    rng = np.random.default_rng(seed)
    u, free = course(rng, kind), course(rng, kind)
    alike = 0.8 * u + 0.6 * course(rng, kind)
    warmth = lagged(u + 0.5 * free, 60.0)
    causes = {"u": u, "alike": alike, "free": free, "warmth": warmth}
    state = lagged(u, lag_rows) if lag_rows else u
    missing = curve(rng, causes[hidden])
    true = 1.0 + 2.0 * state + 0.6 * (lagged(missing, lag_rows) if lag_rows else missing)
    read = true + NOISE * rng.normal(size=ROWS)
    columns = np.column_stack([np.ones(ROWS), state])
    predicted = columns @ np.linalg.lstsq(columns, read)[0]
    innocent = causes | {
        "state": state,
        "rate": np.gradient(state),
        "direction": np.sign(np.gradient(u)),
        "square": u**2,
        "bend": np.abs(u),
        "time": np.arange(float(ROWS)),
        "another sensor's u": u + 0.02 * rng.normal(size=ROWS),
        "another sensor's warmth": warmth + 0.02 * rng.normal(size=ROWS),
        "noise of its own": rng.normal(size=ROWS),
        "a tank behind it": lagged(true, 40.0),
    }
    return read, predicted, innocent


MADE_OF = {
    "a copy": lambda y, _: 3.0 - 0.5 * y,
    "a cube": lambda y, _: y**3,
    "an exponential": lambda y, _: np.exp(y / 3.0),
    "a square about the mean": lambda y, _: (y - y.mean()) ** 2,
    "a wave": lambda y, _: np.sin(1.2 * y),
    "any function": lambda y, rng: curve(rng, y),
    "rounded": lambda y, _: np.round(y / NOISE) * NOISE,
    "a noisy copy": lambda y, rng: y + NOISE * rng.normal(size=len(y)),
    "a noisier copy": lambda y, rng: y + 2.0 * NOISE * rng.normal(size=len(y)),
    "a mean over 9 rows": lambda y, _: ndimage.uniform_filter1d(y, 9),
    "a mean over 41 rows": lambda y, _: ndimage.uniform_filter1d(y, 41),
    "a bell curve": lambda y, _: ndimage.gaussian_filter1d(y, 5.0),
    "a wide bell curve": lambda y, _: ndimage.gaussian_filter1d(y, 20.0),
    "the cube of a mean": lambda y, _: ndimage.uniform_filter1d(y, 5) ** 3,
}
SYSTEMS = [
    ("slow", "u", 0.0),
    ("slow", "alike", 15.0),
    ("quick", "free", 0.0),
    ("quick", "warmth", 15.0),
    ("steps", "alike", 0.0),
    ("steps", "free", 15.0),
]


@pytest.mark.parametrize("name", MADE_OF)
def test_what_is_made_of_a_reading_is_seen(name: str) -> None:
    """One miss in six is allowed: a random function may be flat where a record is."""
    seen = []
    for seed, (kind, hidden, lag_rows) in enumerate(SYSTEMS):
        read, predicted, _ = system(kind, hidden, lag_rows=lag_rows, seed=seed)
        column = MADE_OF[name](read, np.random.default_rng(100 + seed))
        seen.append(holds_reading_error([column], [predicted], [read - predicted]))
    assert sum(seen) >= len(SYSTEMS) - 1


@pytest.mark.parametrize("number", range(len(SYSTEMS)))
def test_causes_states_and_inputs_are_none(number: int) -> None:
    kind, hidden, lag_rows = SYSTEMS[number]
    for seed in range(2):
        read, predicted, innocent = system(kind, hidden, lag_rows=lag_rows, seed=20 + seed)
        for seen in (holds_reading_error, follows_readings):
            taken = [name for name, one in innocent.items() if seen([one], [predicted], [read - predicted])]
            assert taken == []


FILTERS = {
    "a row before": lambda y: np.concatenate([y[:1], y[:-1]]),
    "a lag of 2 rows": lambda y: lagged(y, 2.0),
    "a lag of 5 rows": lambda y: lagged(y, 5.0),
    "a lag of 5 rows, rounded": lambda y: np.round(lagged(y, 5.0) / 0.1 / NOISE) * 0.1 * NOISE,
    "a mean over 5 rows before": lambda y: signal.lfilter(np.full(5, 0.2), 1.0, y - y[0]) + y[0],
    "Butterworth's filter": lambda y: signal.lfilter(*signal.butter(2, 0.2), y - y[0]) + y[0],
}


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_of_a_reading_is_seen(name: str) -> None:
    """One miss in six is allowed: one that takes up nothing of what a model leaves explains nothing and may stay."""
    seen = []
    for seed, (kind, hidden, lag_rows) in enumerate(SYSTEMS):
        read, predicted, _ = system(kind, hidden, lag_rows=lag_rows, seed=seed)
        seen.append(follows_readings([FILTERS[name](read)], [predicted], [read - predicted]))
    assert sum(seen) >= len(SYSTEMS) - 1


def test_rows_without_a_reading_and_several_records_change_nothing() -> None:
    read, predicted, innocent = system("slow", "u", lag_rows=0.0, seed=3)
    left = read - predicted
    left[100:110] = np.nan
    parts = [slice(0, 250), slice(250, ROWS)]
    filled = np.where(np.isfinite(left), read, predicted)
    for column, expected in ((filled**3, True), (innocent["free"], False), (innocent["u"], False)):
        asked = ([one[part] for part in parts] for one in (column, predicted, left))
        assert holds_reading_error(*asked) is expected
        asked = ([one[part] for part in parts] for one in (column, predicted, left))
        assert expected or not follows_readings(*asked)
    parts = [slice(0, 500), slice(480, ROWS)]
    asked = ([one[part] for part in parts] for one in (lagged(filled, 2.0), predicted, left))
    assert follows_readings(*asked)


def table() -> dict[str, Array]:
    rng = np.random.default_rng(2)
    u = course(rng, "quick")
    y = 2.0 * u + 0.3 * u**2 + 1.0 + rng.normal(0.0, 0.05, ROWS)
    return {"time_s": 0.1 * np.arange(ROWS), "u": u, "y": y, "y3": y**3, "ys": ndimage.uniform_filter1d(y, 31)}


PARAMETERS = [parameter("gain", 1.0), parameter("offset", 0.0)]


def test_what_is_missing_is_named_though_the_reading_is_among_the_drivers() -> None:
    def predict(p: Any, record: Any) -> Array:
        return p.offset + p.gain * record.u + p.bend * record.u**2

    bend = candidate("bend", parameter("bend", 0.1, null=0.0))
    found = find_missing(model_problem(predict, table(), PARAMETERS, [bend], output="y"))
    assert (found.verdict, found.effects) == ("identified", ("bend",))
    told = [one for one in found.warnings if "as it was read" in one]
    assert [one.split()[0] for one in told] == ["'y3'", "'ys'"]
    assert set(found.drivers_offered) == {"u", "time_s"}


def test_an_input_that_changes_from_row_to_row_stays_a_driver() -> None:
    """All of its course is as quick as noise is: the scatter of neighbours says nothing of the reading's error."""
    rng = np.random.default_rng(5)
    u = rng.normal(size=ROWS)
    quick = {"time_s": 0.1 * np.arange(ROWS), "u": u, "y": 2.0 * u + 0.3 * u**2 + rng.normal(0.0, 0.05, ROWS)}

    def predict(p: Any, record: Any) -> Array:
        return np.asarray(p.offset + p.gain * record.u)

    found = find_missing(model_problem(predict, quick, PARAMETERS, output="y"))
    assert [name for name, _ in found.drivers] == ["u"]


def test_a_law_over_a_column_that_is_made_of_the_reading_is_told() -> None:
    def predict(p: Any, record: Any) -> Array:
        return p.offset + p.gain * record.u + p.hidden(record.ys)

    found = find_missing(model_problem(predict, table(), PARAMETERS, [law("hidden", driver="ys")], output="y"))
    assert any("the law 'hidden' over it explains noise" in one for one in found.warnings)


@pytest.mark.parametrize(("rows_before", "refused"), [(0, True), (1, False)])
def test_a_law_at_the_reading_of_its_own_row_is_refused(rows_before: int, refused: bool) -> None:  # noqa: FBT001
    def predict(p: Any, record: Any) -> Array:
        asked = np.concatenate([np.full(rows_before, record.y[0]), record.y[: len(record.y) - rows_before]])
        return p.offset + p.gain * record.u + p.hidden(asked)

    problem = model_problem(predict, table(), PARAMETERS, [law("hidden", driver="y")], output="y")
    if not refused:
        find_missing(problem)
        return
    with pytest.raises(InputError, match="calls the law 'hidden' with 'y' as it was read in the same row"):
        find_missing(problem)


def test_a_law_of_a_state_that_is_measured_is_called_with_the_state() -> None:
    """Its driver has the output's name; what it is called with is what the model computes: nothing is to be told."""

    def predict(p: Any, record: Any) -> Array:
        level = p.offset + p.gain * record.u
        return np.asarray(level + p.hidden(level))

    made = table()
    for driver in ("y", "ys"):
        found = find_missing(model_problem(predict, made, PARAMETERS, [law("hidden", driver=driver)], output="y"))
        assert not any("the law 'hidden'" in one for one in found.warnings)
        assert not any(one.startswith("'y' ") for one in found.warnings)
