"""Several records of one rig as one problem: what is shared, what is each record's own, and one answer for all."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from torsight.actuator.drive import Drive
from torsight.actuator.effects import load_effects
from torsight.actuator.fitted import read_model
from torsight.actuator.laws import laws_of
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.cli.main import main
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.storage import read_table, write_json
from torsight.core.files.tables import write_merged
from torsight.core.law import Law
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator.several import SeveralRecords
from torsight.discovery.discover import discover
from torsight.discovery.inference.fitting import Fitter
from torsight.discovery.together import discover_together
from torsight.discovery.weight import Weight
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from

VISCOUS = "viscous_mnm_s_per_rad"
TRUE = 3.0
ZEROS_DEG = (4.0, -7.0)
RAMPS_S = (150.0, 300.0)


def record(number: int, effects: Mapping[str, Any] | None = None, *, tau_c_mnm: float = 0.9) -> SyncedTable:
    """Return a record of the one rig: fast or slow, with the sticks put on anew."""
    ramp_s = RAMPS_S[number]
    half_cycles = [
        {"spring": s, "peak_c": 75.0, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": 250.0} for s in "ab"
    ]
    scene = {
        "motion": {"kind": "rig"},
        "rig": {"as_declared": True, "true": {"tau_c_mnm": tau_c_mnm}},
        "protocol": {"half_cycle": half_cycles},
        "sticks": {"offset_deg": ZEROS_DEG[number]},
        "effects": {"viscous_friction": {VISCOUS: TRUE}} if effects is None else effects,
    }
    return make_record(scene, seed=5 + number, rate_hz=1.0).table


@pytest.fixture(scope="module")
def tables() -> list[SyncedTable]:
    return [record(0), record(1)]


@pytest.fixture(scope="module")
def spec() -> ActuatorSpec:
    return actuator_from(declared_from({}, where="test").to_toml(), where="test")


@pytest.fixture(scope="module")
def problem(tables: list[SyncedTable], spec: ActuatorSpec) -> SeveralRecords:
    model = ActuatorModel(spec)
    known = [replace(table, clock_sigma_s=sigma_s) for table, sigma_s in zip(tables, (None, 0.1), strict=True)]
    return SeveralRecords.of([model.prepare(table) for table in known], spec)


@contextmanager
def few_effects(*names: str) -> Iterator[None]:
    """Let discovery try these effects, not all, beside those that are always fitted."""
    effects = {name: load_effects()[name] for name in (*names, "home_torque", "start_winding", "phase_shape")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("torsight.discovery.actuator_problem.load_effects", lambda: effects)
        patch.setattr("torsight.discovery.actuator_problem.laws_of", lambda _drive, _tau_c_mnm: ())
        yield


@pytest.fixture(scope="module")
def out(tables: list[SyncedTable], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return what the command writes for both records."""
    folder = tmp_path_factory.mktemp("several")
    files = write_records(folder, tables)
    (folder / "out").mkdir()
    (folder / "out" / "curves_3.csv").touch()
    with few_effects("viscous_friction", "marker_slip"):
        assert leave("discover", *files, "--actuator", str(folder / "actuator.toml"), "--out", str(folder / "out")) == 0
    return folder / "out"


def write_records(folder: Path, tables: list[SyncedTable]) -> list[str]:
    """Write an actuator file and the records, each in a folder of its own; return the records' names."""
    (folder / "actuator.toml").write_text(tomli_w.dumps(declared_from({}, where="test").to_toml()), encoding="utf-8")
    files = []
    for k, table in enumerate(tables):
        (folder / f"{k}").mkdir()
        files.append(str(folder / f"{k}" / "merged.csv"))
        write_merged(files[-1], table)
    return files


def leave(*words: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(words))
    return int(end.value.code or 0)


@pytest.fixture(scope="module")
def answer(out: Path) -> dict[str, Any]:
    return dict(json.loads((out / "discovery.json").read_text(encoding="utf-8")))


def test_both_records_name_the_effect_and_know_it_better_than_either_alone(
    answer: dict[str, Any], tables: list[SyncedTable], spec: ActuatorSpec
) -> None:
    assert [effect["id"] for effect in answer["effects"]] == ["viscous_friction"]
    low, high = answer["effects"][0]["parameters"][VISCOUS]["ci95"]
    assert low < TRUE < high
    for table in tables:
        with few_effects("viscous_friction", "marker_slip"):
            alone = discover(table, spec).effects[0].parameters[VISCOUS].ci95
        assert high - low < alone[1] - alone[0]


def test_what_each_record_takes_for_other_values_is_named_by_both(spec: ActuatorSpec) -> None:
    # At one heating rate a late sensor is a shift of all transformation temperatures, or a late clock.
    tables = [record(k, {"sensor_lag": {"lag_s": 1.0}}) for k in (0, 1)]
    with few_effects("sensor_lag", "clock_offset"):
        assert [effect.id for effect in discover_together(tables, spec).effects] == ["sensor_lag"]
        for table in tables:
            alone = discover(table, spec)
            assert alone.verdict in ("none", "ambiguous")


def test_every_record_has_a_zero_of_its_own(answer: dict[str, Any]) -> None:
    assert [Path(one["file"]).parent.name for one in answer["records"]] == ["0", "1"]
    for one, true_deg in zip(answer["records"], ZEROS_DEG, strict=True):
        zero = one["parameters"]["zero_deg"]
        assert abs(zero["value"] - true_deg) < 3.0 * zero["sigma"] < 1.0
    assert answer["parameters"]["zero_deg_2"] == answer["records"][1]["parameters"]["zero_deg"]


def test_each_record_is_predicted_from_the_other(answer: dict[str, Any]) -> None:
    assert answer["held_out"] == [0, 1, 2, 3]
    for one in answer["records"]:
        floor = one["noise_floor_deg"]
        after = one["after"]["rmse_other_records_deg"]
        # Beyond the noise a prediction errs by what the other record leaves open of the rig's values.
        assert one["after"]["rmse_train_deg"] < 2.0 * floor
        assert floor < after < 0.2 * one["before"]["rmse_other_records_deg"]
        assert len(one["after"]["by_half_cycle_deg"]) == 2


def test_files_of_all_records_are_written_and_the_model_goes_on_from_the_last(
    out: Path, answer: dict[str, Any], tables: list[SyncedTable], spec: ActuatorSpec
) -> None:
    assert sorted(path.name for path in out.glob("curves*.csv")) == ["curves.csv", "curves_2.csv"]
    assert "<html" in (out / "report.html").read_text(encoding="utf-8")
    for name, one in zip(("curves.csv", "curves_2.csv"), answer["records"], strict=True):
        left = read_table(out / name)["residual_after_deg"]
        assert np.sqrt(np.nanmean(np.square(left))) == pytest.approx(one["after"]["rmse_train_deg"], rel=1e-6)
    model = read_model(out / "model.json")
    assert model.cycles == (2, 2)
    assert model.values["zero_deg"] == pytest.approx(answer["parameters"]["zero_deg_2"]["value"])
    drive = ActuatorModel(spec).prepare(tables[1])
    assert model.start_angle_rad == pytest.approx(drive.start_angle_rad)
    assert model.doubt is not None


def test_one_record_twice_and_records_of_two_rigs_are_refused(
    tables: list[SyncedTable], spec: ActuatorSpec, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ConfigError, match="same angles"):
        discover_together([tables[0], tables[0]], spec)
    with pytest.raises(ConfigError, match="two records"):
        discover_together(tables[:1], spec)
    first, second = write_records(tmp_path, tables)
    rest = ("--actuator", str(tmp_path / "actuator.toml"), "--out", str(tmp_path / "out"))
    assert leave("discover", first, first, *rest) == ConfigError.exit_code
    assert "same record" in capsys.readouterr().err
    for k, path in enumerate((first, second)):
        used = {"configuration": {"actuator": {"file": "actuator.toml"}}, "inputs": {"actuator.toml": f"{k}" * 64}}
        write_json(Path(path).parent / "provenance.json", used)
    assert leave("discover", first, second, *rest) == InputError.exit_code
    assert "another actuator" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_records_of_two_rigs_that_no_file_tells_apart_are_doubted(
    tables: list[SyncedTable], spec: ActuatorSpec, answer: dict[str, Any]
) -> None:
    assert not any("not of one rig" in note for note in answer["notes"])
    with few_effects():
        report = discover_together([tables[0], record(1, tau_c_mnm=3.0)], spec)
    assert any("not of one rig" in note for note in report.notes)


def test_rows_of_both_records_stand_after_each_other(problem: SeveralRecords) -> None:
    first, second = problem.parts
    assert np.all(np.diff(problem.time_s) > 0.0)
    assert np.array_equal(problem.observed, np.concatenate([first.observed, second.observed]), equal_nan=True)
    assert np.unique(problem.block).tolist() == [0, 1, 2, 3]
    assert set(problem.block[problem.rows_of(1)]) == {2, 3}
    # The springs have been driven once each when the second record begins.
    assert second.history.cycles == (1, 1)


def test_own_values_move_their_own_record_alone(problem: SeveralRecords) -> None:
    values = {p.name: p.value for p in problem.parameters}
    at = problem.predict(values, ())
    for name, own, other in (("zero_deg_2", 1, 0), ("home_hold", 0, 1)):
        moved = problem.predict({**values, name: values[name] + 0.5}, ()) - at
        assert np.any(moved[problem.rows_of(own)] != 0.0)
        assert not np.any(moved[problem.rows_of(other)])
    shared = problem.predict({**values, "tau_c_mnm": 0.9}, ()) - at
    assert all(np.any(shared[problem.rows_of(k)] != 0.0) for k in (0, 1))


def test_an_event_belongs_to_one_record_and_its_time_to_that_records_clock(
    tables: list[SyncedTable], spec: ActuatorSpec
) -> None:
    first, second = tables
    at_s = 0.4 * float(second.time_s[-1])
    slipped = replace(second, angle_rad=second.angle_rad + np.where(second.time_s > at_s, 5.0 * DEG, 0.0))
    problem = SeveralRecords.of([ActuatorModel(spec).prepare(table) for table in (first, slipped)], spec)
    slip = next(candidate for candidate in problem.candidates if candidate.id == "marker_slip_2")
    assert problem.effect_of(slip.id) == "marker_slip"
    fitter = Fitter(problem, Weight.of(np.where(problem.valid, 1.0, 0.0)))
    found = fitter.extend(fitter.extend(fitter.base(), "viscous_friction"), slip.id)
    assert found.values["slip_deg_2"] == pytest.approx(5.0, abs=0.1)
    rows_s = problem.parts[1].time_s
    assert found.values["slip_time_s_2"] == pytest.approx(at_s, abs=2.0 * float(np.max(np.diff(rows_s))))
    before = problem.predict({**found.values, **slip.null_point()}, found.effects)
    moved = found.solution.prediction - before
    assert not np.any(moved[problem.rows_of(0)])
    assert moved[problem.rows_of(1)][-1] == pytest.approx(found.values["slip_deg_2"])


def test_clocks_are_each_records_own_and_known_as_well_as_they_were_put_together(problem: SeveralRecords) -> None:
    sigma_s = {p.name: p.sigma for p in problem.parameters if p.name.startswith("clock_offset")}
    # Of the first nothing is known: anything within the bounds.
    assert sigma_s == {"clock_offset_s": 120.0, "clock_offset_s_2": 0.1}
    assert "clock_offset" not in [candidate.id for candidate in problem.candidates]
    assert {"clock_offset_s_2", "zero_deg_2", "home_hold_2", "slip_deg_2"} <= set(problem.once)


def test_a_law_of_time_is_a_function_of_its_own_in_every_record(problem: SeveralRecords) -> None:
    joint = {law.id: law for law in problem.laws}
    of_time = [law for law in joint.values() if law.driver == "time_s"]
    assert {law.id for law in of_time} >= {"reading_time_s", "winding_time_s", "temperature_time_s"}
    # The clock of one record is known, and with it the offset of the other is an effect that every fit has.
    assert "clock_time_s" not in joint
    law = joint["reading_time_s"]
    first, second = ({one.id: one for one in laws_of(part.drive, 0.79)}[law.id] for part in problem.parts)
    count = len(first.nodes)
    assert len(law.nodes) == count + len(second.nodes)
    assert all(not kernel.matrix[:count, count:].any() for kernel in law.kernels)
    drifting = problem.with_laws([law.free()])
    values = {p.name: p.value for p in problem.parameters}
    curve = np.concatenate([np.zeros(count), np.linspace(0.0, 2.0, len(second.nodes))])
    moved = drifting.predict(values | dict(zip(law.free().names, curve, strict=True)), [law.id])
    moved -= problem.predict(values, [])
    rows = problem.rows_of(1)
    assert not np.any(moved[problem.rows_of(0)])
    drive_s = problem.parts[1].drive.time_s
    assert moved[rows] == pytest.approx(2.0 * (problem.parts[1].time_s - drive_s[0]) / np.ptp(drive_s))


def test_a_drift_in_every_record_is_found_and_written_for_each(
    spec: ActuatorSpec,
) -> None:
    slopes_deg = (1.5, -2.5)
    drifted = []
    for k, slope_deg in enumerate(slopes_deg):
        table = record(k, {})
        share = (table.time_s - table.time_s[0]) / np.ptp(table.time_s)
        drifted.append(replace(table, angle_rad=table.angle_rad + slope_deg * share * DEG))
    with few_effects("marker_slip"), pytest.MonkeyPatch.context() as patch:
        patch.setattr("torsight.discovery.actuator_problem.laws_of", drift_alone)
        found = discover_together(drifted, spec, names=["monday", "tuesday"])
    assert [(law.id, law.record) for law in found.laws] == [("reading_time_s", "monday"), ("reading_time_s", "tuesday")]
    for law in found.laws:
        slope_deg = slopes_deg[("monday", "tuesday").index(law.record)]
        assert law.value[-1] - law.value[0] == pytest.approx(slope_deg, abs=0.4)
        assert law.sentence.startswith(f"in {law.record}, the reading's error")
    assert len({law.csv_name for law in found.laws}) == len(slopes_deg)


def drift_alone(drive: Drive, tau_c_mnm: float) -> tuple[Law, ...]:
    """Return the law of a drift."""
    return tuple(law for law in laws_of(drive, tau_c_mnm) if law.id == "reading_time_s")


def test_laws_span_what_the_records_cover_together(problem: SeveralRecords) -> None:
    joint = {law.id: law for law in problem.laws}
    alone = [{law.id: law for law in laws_of(part.drive, 0.79)} for part in problem.parts]
    for name in ("friction_angle_rate_deg_s", "temperature_temp_rate_c_s", "torque_angle_deg"):
        reach = max(laws[name].covered[1] for laws in alone)
        assert joint[name].covered[1] == pytest.approx(reach, rel=0.1)
    # A spring's own cycles go on from record to record: two of each, where one record has one alone.
    assert joint["phase_cycle"].covered == (0.0, 1.0)
    assert all("phase_cycle" not in laws for laws in alone)
