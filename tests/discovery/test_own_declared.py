"""A model of one's own is checked before any fit: what would be accepted silently is an error that names it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.discovery.linear_cases import machine, signals
from tests.discovery.own_models import (
    line,
    read_sensor,
    sensor_candidates,
    sensor_parameters,
    sensor_record,
)
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import actuator_from
from torsight.core.errors import InputError
from torsight.discovery import OptionalMembers, Reading, candidate, find_missing, model_problem, parameter
from torsight.discovery.actuator.several import SeveralRecords
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.own.model.check import check_problem
from torsight.discovery.own.model.layout import still
from torsight.discovery.own.model.model_file import READING
from torsight.discovery.own.own_records import read_records, time_of
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from


def problem(**changes: Any) -> Any:
    given = {"predict": line, "observed": sensor_record(), "parameters": sensor_parameters(), "output": "y"}
    given |= changes
    read = {name: given.pop(name) for name in READING if name in given}
    return model_problem(
        given.pop("predict"),
        given.pop("observed"),
        given.pop("parameters"),
        given.pop("candidates", ()),
        reading=Reading(**read),
        **given,
    )


def refused(message: str, **changes: Any) -> None:
    with pytest.raises(InputError, match=message):
        check_problem(problem(**changes))


def nan_from_a_gap(p: Any, record: Any) -> np.ndarray:
    return p.gain * record.gappy + p.offset


def test_a_model_that_gives_no_numbers_or_a_wrong_shape_is_refused_before_the_search() -> None:
    gappy = sensor_record()
    gappy["gappy"] = np.where(np.arange(600) == 40, np.nan, gappy["u"])
    refused(r"'y' is nan in row 41; there gappy is not known", predict=nan_from_a_gap, observed=gappy)
    refused("has no column 'speed'; it has time_s, u, y", predict=lambda p, r: p.gain * r.speed)
    refused("no parameter or law 'slope'; it has gain, offset", predict=lambda p, r: p.slope * r.u)


def test_a_candidate_whose_start_fails_is_named_and_what_is_given_back_has_no_traceback() -> None:
    def fails(p: Any, record: Any) -> np.ndarray:
        if p.bow > 0.0:
            raise ValueError("no such bow")
        return np.asarray(p.gain * record.u + p.offset)

    bow = candidate("bow", parameter("bow", 0.1, null=0.0))
    with pytest.raises(
        InputError, match="candidate 'bow' at its start: the model fails: ValueError: no such bow"
    ) as told:
        check_problem(model_problem(fails, sensor_record(), sensor_parameters(), [bow], output="y"))
    assert "no such bow" in told.value.__notes__[0]
    for given in (lambda p, _record: p.gain, lambda p, record: np.full(len(record.u), np.nan * p.gain)):
        with pytest.raises(InputError) as told:
            check_problem(model_problem(given, sensor_record(), sensor_parameters(), output="y"))
        assert not hasattr(told.value, "__notes__")


def test_a_model_that_raises_says_where_and_for_which_values() -> None:
    def fails(p: Any, record: Any) -> np.ndarray:
        return record.u / (p.gain - 1.0 if p.gain != 1.0 else int("none"))

    with pytest.raises(
        InputError, match=r"test_own_declared.py, line \d+, in fails: .*ValueError.*gain=1, offset=0"
    ) as e:
        check_problem(problem(predict=fails))
    assert 'int("none")' in "".join(e.value.__notes__)


def test_a_model_that_changes_what_it_is_given_is_refused() -> None:
    def in_place(p: Any, record: Any) -> np.ndarray:
        record["u"][:] = 0.0
        return p.gain * record.u

    def by_force(p: Any, record: Any) -> np.ndarray:
        record.u.setflags(write=True)
        record["u"][0] += 1.0
        return p.gain * record.u + p.offset

    def values(p: Any, record: Any) -> np.ndarray:
        p.gain = 2.0
        return p.gain * record.u

    refused("read-only.*work on a copy", predict=in_place)
    refused("changes its record: column 'u'.*copy", predict=by_force)
    refused("cannot be changed.*work on a copy", predict=values)


def test_a_model_that_is_not_deterministic_is_refused() -> None:
    rng = np.random.default_rng(1)
    refused("different outputs for the same values", predict=lambda p, r: p.gain * r.u + p.offset + rng.normal())


@pytest.mark.parametrize("words", ["KeyError: 'used up'", "different outputs for the same values"])
def test_a_model_that_changes_after_many_calls_is_refused(words: str) -> None:
    calls = []

    def tired(p: Any, record: Any) -> np.ndarray:
        calls.append(1)
        if len(calls) > 40 and "used up" in words:
            raise KeyError("used up")
        return p.gain * record.u + p.offset + 1e-3 * (len(calls) > 40)

    with pytest.raises(InputError, match=words):
        find_missing(problem(predict=tired))


def test_null_values_that_are_none_are_refused() -> None:
    bent = candidate("bent", parameter("size", 0.1, null=0.0), parameter("place", 1.0))
    refused(
        "does not vanish at its null values: with size=0 the model still depends on 'place'",
        predict=lambda p, r: p.gain * r.u + p.offset + (p.size + 0.1) * p.place,
        candidates=[bent],
    )


def test_what_changes_nothing_is_told() -> None:
    useless = [*sensor_parameters(), parameter("mass", 1.0)]
    told = check_problem(problem(parameters=useless, candidates=[candidate("bow", parameter("bow", 0.1, null=0.0))]))
    assert any("'mass' changes nothing" in one for one in told)
    assert any("'bow' changes nothing at its start" in one for one in told)


@pytest.mark.parametrize("name", ["drivers", "valid", "predict", "input_noise"])
def test_a_class_of_ones_own_without_a_member_is_refused(name: str) -> None:
    whole = machine(0.0)
    members = {key: getattr(whole, key) for key in dir(whole) if not key.startswith("_") and key != name}
    with pytest.raises(InputError, match=f"lacks {name}"):
        find_missing(SimpleNamespace(**members))  # type: ignore[arg-type]


def test_the_actuator_is_checked_as_any_other_problem() -> None:
    spec = actuator_from(declared_from({}, where="test").to_toml(), where="test")
    halves = [{"spring": one, "peak_c": 75.0, "ramp_s": 60.0, "heat_s": 80.0, "cool_s": 60.0} for one in "ab"]
    table = make_record({"motion": {"kind": "rig"}, "protocol": {"half_cycle": halves}}, seed=5, sigma_deg=0.15).table
    one = ActuatorProblem(ActuatorModel(spec).prepare(table), spec)
    assert not check_problem(one)
    assert not check_problem(SeveralRecords((one, one)))


def test_a_class_of_ones_own_that_says_no_more_than_it_has_to_is_searched() -> None:
    whole = machine(0.5 * np.sign(signals()["speed"]))

    class Bare(OptionalMembers):
        parameters, candidates, time_s, observed = whole.parameters, whole.candidates, whole.time_s, whole.observed
        sigma, valid, block, predict = whole.sigma, whole.valid, whole.block, whole.predict

    bare = Bare()
    assert find_missing(bare).effects == ("coulomb",)
    assert (bare.laws, bare.forms, bare.drivers, bare.rest.any()) == ((), (), {}, False)


def test_a_class_of_ones_own_with_a_wrong_shape_is_refused() -> None:
    whole = machine(0.0)
    with pytest.raises(InputError, match=r"LinearProblem.sigma: has a wrong shape.*\(3,\).*\(1200,\)"):
        find_missing(replace(whole, sigma=np.ones(3)))
    with pytest.raises(InputError, match="not known where it counts"):
        find_missing(replace(whole, observed=np.where(np.arange(1200) == 3, np.nan, whole.observed)))


def test_tables_of_every_kind_are_taken(tmp_path: Path) -> None:
    made = sensor_record()
    pd.DataFrame(made).to_csv(tmp_path / "a.csv", index=False)
    pd.DataFrame(made).to_parquet(tmp_path / "b.parquet")
    several = [made, pd.DataFrame(made), tmp_path / "a.csv", str(tmp_path / "b.parquet")]
    found = problem(observed=several)
    assert [record.label_ for record in found.model.records] == ["record 1", "record 2", "a", "b"]
    for record in found.model.records[:2]:
        np.testing.assert_array_equal(record.y, made["y"])
    for record in found.model.records[2:]:
        np.testing.assert_allclose(record["y"], made["y"], rtol=1e-9)
    # Held out by record, with a sample that does not count between any two.
    assert sorted(set(found.block.tolist())) == [0, 1, 2, 3]
    assert len(found.observed) == 4 * 600 + 3
    assert int(found.valid.sum()) == 4 * 600
    assert np.all(np.diff(found.time_s) > 0.0)


def test_blocks_and_units_have_defaults() -> None:
    alone = problem()
    assert len(set(alone.block.tolist())) == 6
    # A tenth of the noise, which is 0.05 here; estimated from third differences of 600 samples.
    assert alone.resolution == pytest.approx(0.005, rel=0.15)
    assert problem(sigma=0.2).resolution == pytest.approx(0.02)
    assert problem(resolution=0.3).resolution == 0.3
    assert set(alone.drivers) == {"u", "time_s"}


def test_outputs_of_several_units_share_one_scale() -> None:
    made = sensor_record()
    made["y_mv"] = 1000.0 * made["y"]
    two = problem(
        observed=made, output=["y", "y_mv"], sigma={"y": 0.05, "y_mv": 50.0}, predict=lambda _, r: (r.y, r.y_mv)
    )
    one, other = (two.observed[place] for _, _, place in two.layout.places)
    np.testing.assert_allclose(np.diff(one), np.diff(other), atol=1e-9)
    assert np.nanmax(one) < np.nanmin(other)
    np.testing.assert_allclose(two.sigma[two.valid], 10.0)
    (native,) = two.layout.native(two.observed)
    np.testing.assert_allclose(native, np.column_stack([made["y"], made["y_mv"]]))


def test_the_measured_signal_is_no_driver_but_one_that_moves_alike_is() -> None:
    made = sensor_record()
    made["y_copy"] = 3.0 - 0.5 * made["y"]
    found = problem(observed=made)
    assert set(found.drivers) == {"u", "time_s"}
    assert any("'y_copy' is what is measured (y)" in one for one in found.warnings)
    assert any("'y' is what is measured" in one for one in problem(drivers=["u", "y"]).warnings)


def test_a_record_that_stands_still_is_found_still_or_told() -> None:
    rng = np.random.default_rng(2)
    ramp = np.concatenate([np.zeros(400), np.linspace(0.0, 5.0, 100), np.full(300, 5.0)])
    flag = still(ramp + rng.normal(0.0, 0.02, 800), 0.02)
    # At the corners a window of 16 rows sees both.
    assert flag[:392].mean() > 0.95
    assert not flag[408:492].any()
    assert flag[508:].mean() > 0.95
    made = {"u": ramp, "y": 2.0 * ramp + rng.normal(0.0, 0.02, 800)}
    assert any("rest='still'" in one for one in problem(observed=made).warnings)
    resting = problem(observed=made, rest="still")
    assert not resting.warnings
    assert resting.rest.mean() > 0.8


def test_read_sensor_is_the_plain_line_at_null() -> None:
    full = model_problem(read_sensor, sensor_record(), sensor_parameters(), sensor_candidates(), output="y")
    values = {"gain": 2.0, "offset": 1.0}
    np.testing.assert_allclose(full.predict(values, ()), problem().predict(values, ()), rtol=1e-12)


@pytest.mark.parametrize(("mark", "point"), [(",", "."), (";", "."), (";", ","), ("\t", ".")])
def test_a_record_is_read_as_an_instrument_writes_it(mark: str, point: str, tmp_path: Path) -> None:
    rows = [f"{0.5 * k}{mark}{k % 3 + 0.25}{mark}run" for k in range(9)]
    text = "\n".join([mark.join(("Time (s)", "Force (N)", "remark")), *rows])
    path = tmp_path / "logger.csv"
    path.write_text(text if point == "." else text.replace(".", ","), encoding="utf-8-sig")
    (record,) = read_records(path)
    assert list(record) == ["Time (s)", "Force (N)"]
    np.testing.assert_allclose(time_of(record, None), 0.5 * np.arange(9))
    np.testing.assert_allclose(record["Force (N)"], np.arange(9) % 3 + 0.25)
