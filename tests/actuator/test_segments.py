"""Half-cycles from switches and from temperatures alone."""

from __future__ import annotations

import numpy as np
import pytest
from actuator_programmes import programme

from torsight.actuator.drive import prepare_log, prepare_table, start_angle
from torsight.actuator.model import ActuatorModel
from torsight.actuator.record.segments import begun_with_a_jump, half_cycles
from torsight.actuator.spec import reference_spec
from torsight.core.errors import InputError, NoResultError
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.units import DEG

HALVES = [(0, [(75.0, 0.2)]), (1, [(60.0, 0.3)]), (0, [(58.0, 0.1)]), (1, [(80.0, 0.5)])]


@pytest.mark.parametrize("switches", [True, False])
@pytest.mark.parametrize("noise_c", [0.0, 0.2])
def test_alternating_halves(switches, noise_c):
    log, temps = programme(HALVES)
    rng = np.random.default_rng(0)
    a, b = (temp + noise_c * rng.standard_normal(len(log)) for temp in (log.temp_a_c, log.temp_b_c))
    heat = {"heat_a": log.heat_a, "heat_b": log.heat_b} if switches else {}
    found = half_cycles(a, b, noise_c=noise_c, **heat)
    assert found.springs == (0, 1, 0, 1)
    assert found.counts().tolist() == [0, 0, 1, 1]
    starts = np.flatnonzero(np.diff(found.half)) + 1
    expected = np.cumsum([len(own) for own in temps])[:-1]
    assert len(starts) == len(expected)
    # In the rest before a heating the place of its start does not matter: the other spring has cooled by then.
    place = 0
    for start, end, own in zip(starts, expected, temps[:-1], strict=True):
        assert own[start - place] < 25.0 if start < end else start - end < 60
        place = end


@pytest.mark.parametrize("noise_c", [0.0, 0.05])
def test_a_room_that_warms_is_no_heating(noise_c):
    log, temps = programme(HALVES)
    room_c = 5.0 * (1.0 - np.exp(-np.arange(len(log)) / len(log)))
    rng = np.random.default_rng(0)
    a, b = (temp + room_c + noise_c * rng.standard_normal(len(log)) for temp in (log.temp_a_c, log.temp_b_c))
    found = half_cycles(a, b, noise_c=noise_c)
    assert found.springs == (0, 1, 0, 1)
    starts, expected = np.flatnonzero(np.diff(found.half)) + 1, np.cumsum([len(own) for own in temps])[:-1]
    # The spring that was driven before has cooled by then: to a tenth of its rise above the room.
    for start, end, own in zip(starts, expected, temps[:-1], strict=True):
        assert -0.5 * len(own) < start - end < 60
        assert own[min(start - end, 0) - 1] < 28.0


def test_a_rest_that_rises_hardly_and_without_noise_is_no_part_of_the_heating():
    log, temps = programme(HALVES)
    drift_c = 0.05 * np.arange(len(log)) / len(log)
    found = half_cycles(log.temp_a_c + drift_c, log.temp_b_c + drift_c)
    starts, expected = np.flatnonzero(np.diff(found.half)) + 1, np.cumsum([len(own) for own in temps])[:-1]
    assert np.abs(starts - expected).max() <= 1


def test_warming_by_the_neighbour_is_no_drive():
    log, _ = programme(HALVES)
    warm = 0.45
    a = log.temp_a_c + warm * (log.temp_b_c - 23.0)
    b = log.temp_b_c + warm * (log.temp_a_c - 23.0)
    assert half_cycles(a, b).springs == (0, 1, 0, 1)


def test_holds_dips_and_pauses_stay_in_one_half_cycle():
    log, _ = programme([(0, [(50.0, 0.2), (46.0, 0.2), (60.0, 0.2), (60.1, 0.002), (75.0, 0.2)]), (1, [(70.0, 0.2)])])
    assert half_cycles(log.temp_a_c, log.temp_b_c).springs == (0, 1)


def test_the_same_spring_twice():
    log, _ = programme([(0, [(75.0, 0.2)]), (0, [(65.0, 0.2)]), (1, [(70.0, 0.2)])])
    assert half_cycles(log.temp_a_c, log.temp_b_c).springs == (0, 0, 1)
    assert half_cycles(log.temp_a_c, log.temp_b_c, heat_a=log.heat_a, heat_b=log.heat_b).springs == (0, 0, 1)


@pytest.mark.parametrize("warm", [0.0, 0.3])
@pytest.mark.parametrize(("name", "own", "other"), [("heat_a", "A", "B"), ("heat_b", "B", "A")])
def test_a_switch_that_is_on_while_the_other_spring_warms_is_refused(name, own, other, warm):
    log, _ = programme(HALVES)
    a_c = log.temp_a_c + warm * (log.temp_b_c - 23.0)
    b_c = log.temp_b_c + warm * (log.temp_a_c - 23.0)
    never = np.zeros(len(log), np.bool_)
    wrong = {"heat_a": never, "heat_b": never, name: log.heat_b if own == "A" else log.heat_a}
    words = (
        rf"m\.csv, column {name}: spring {other} warms while spring {own} is said to be heated; found rises of 1?\d\d\."
    )
    with pytest.raises(InputError, match=words):
        half_cycles(a_c, b_c, **wrong, where="m.csv")


@pytest.mark.parametrize("noise_deg", [0.0, 0.06])
def test_a_half_cycle_begins_where_the_angle_jumps_before_heat_is_seen(noise_deg):
    log, _ = programme(HALVES)
    found = half_cycles(log.temp_a_c, log.temp_b_c)
    starts = np.flatnonzero(np.diff(found.half)) + 1
    # The spring that was switched off gives way with the logarithm of time, 8, 20 and 3 s before that.
    switch_s = log.time_s[starts] - np.array([8.0, 20.0, 3.0])
    since_s = np.maximum(0.0, log.time_s[:, None] - switch_s)
    angle_deg = (6.0 * np.log10(1.0 + since_s / 1.0)).sum(axis=1)
    angle_deg += noise_deg * np.random.default_rng(2).standard_normal(len(log))
    begun = begun_with_a_jump(found, log.time_s, angle_deg * DEG, (log.temp_a_c, log.temp_b_c))
    rows = np.flatnonzero(np.diff(begun.half)) + 1
    assert log.time_s[rows] == pytest.approx(switch_s, abs=0.6)
    assert begun.active[rows].tolist() == [1, 0, 1]
    assert begun.springs == found.springs


def test_a_start_stays_where_the_angle_drifts_or_the_log_tells_the_switch():
    log, _ = programme(HALVES)
    temps_c = (log.temp_a_c, log.temp_b_c)
    drift = 0.1 * log.time_s * DEG + 1e-3 * np.random.default_rng(3).standard_normal(len(log))
    found = half_cycles(log.temp_a_c, log.temp_b_c)
    assert (begun_with_a_jump(found, log.time_s, drift, temps_c).half == found.half).all()
    told = half_cycles(log.temp_a_c, log.temp_b_c, heat_a=log.heat_a, heat_b=log.heat_b)
    start = int(np.flatnonzero(np.diff(told.half))[0])
    jumps = np.where(np.arange(len(log)) < start - 20, 0.0, 0.1)
    assert (begun_with_a_jump(told, log.time_s, jumps, temps_c).half == told.half).all()


def test_no_heating_is_refused_with_what_is_missing():
    flat = 23.0 + 0.3 * np.sin(np.arange(500) / 40)
    with pytest.raises(NoResultError, match="neither spring is heated"):
        half_cycles(flat, flat)


def test_both_heated_at_once_is_told_as_that():
    log, _ = programme([(0, [(75.0, 0.2)])])
    with pytest.raises(InputError, match="both springs are heated simultaneously"):
        half_cycles(log.temp_a_c, log.temp_a_c, heat_a=log.heat_a, heat_b=log.heat_a)
    cold = np.full(len(log), 23.0)
    with pytest.raises(NoResultError, match="neither spring is heated"):
        half_cycles(cold, cold, heat_a=log.heat_a, heat_b=log.heat_b)


def test_the_start_is_the_mean_of_the_rest():
    rng = np.random.default_rng(5)
    angle = np.concatenate([np.full(300, 3.0), np.linspace(3.0, -3.0, 400)]) + 1e-3 * rng.standard_normal(700)
    angle[10] = np.nan
    # 300 rows of rest give a mean with a standard deviation of 6e-5.
    assert start_angle(angle, np.full(700, 1e-3)) == pytest.approx(3.0, abs=3e-4)


def test_the_start_is_the_mean_of_the_whole_rest():
    """Medians of a few rows scatter: that is no motion, and the mean goes on over the rest."""
    off = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        angle = np.concatenate([np.full(300, 3.0), np.linspace(3.0, -3.0, 400)]) + 2e-3 * rng.standard_normal(700)
        off.append(start_angle(angle, np.full(700, 2e-3)) - 3.0)
    # 300 rows of rest: 1.2e-4; a few tenths more where it ends early.
    assert np.std(off) < 2.5e-4
    assert np.max(np.abs(off)) < 1e-3


def test_gaps_are_bridged_and_long_ones_do_not_count():
    """As in the merged table: at two rows a second up to four may be lost, from 2.5 s to the next."""
    log, _ = programme(HALVES[:2])
    a = log.temp_a_c.copy()
    a[100:104], a[200:205], a[300:360] = np.nan, np.nan, np.nan
    drive = prepare_log(type(log)(log.time_s, a, log.temp_b_c, log.heat_a, log.heat_b), start_angle_rad=3.0)
    assert drive.known[100:104].all()
    assert not drive.known[200:205].any()
    assert not drive.known[300:360].any()
    assert np.isfinite(drive.temp_a_c).all()


@pytest.mark.parametrize("every", [6, 20])
def test_a_table_that_has_a_temperature_in_some_of_its_rows_is_no_row_of_gaps(every):
    """Readings 3 s and 10 s apart, as they come where a film's and a logger's rows are put together."""
    log, _ = programme(HALVES[:2])
    a, b = np.full(len(log), np.nan), np.full(len(log), np.nan)
    a[::every], b[::every] = log.temp_a_c[::every], log.temp_b_c[::every]
    drive = prepare_log(type(log)(log.time_s, a, b, log.heat_a, log.heat_b), start_angle_rad=3.0)
    assert drive.known[: -every - 1].all()


def test_a_fast_record_is_thinned():
    log, _ = programme(HALVES[:2])
    count = len(log)
    fine = np.arange(8 * (count - 1)) * (log.time_s[1] / 8)
    table = SyncedTable(
        fine, np.sin(fine / 50), np.full(len(fine), 0.01), np.interp(fine, log.time_s, log.temp_a_c),
        np.interp(fine, log.time_s, log.temp_b_c),
    )  # fmt: skip
    drive = prepare_table(table)
    assert len(drive) == pytest.approx(len(fine) / 3, abs=2)
    assert drive.angle_rad == pytest.approx(np.sin(drive.time_s / 50), abs=1e-4)
    assert drive.angle_sigma_rad[5] == pytest.approx(0.01 / np.sqrt(3))


def test_rows_beside_lost_frames_stand_for_their_own_instant():
    """Frames that the film lost, by seconds or here and there, while the disk turns by 5 degrees per second."""
    log, _ = programme(HALVES[:2])
    fine = np.arange(0.0, log.time_s[-1], 1.0 / 15.0)
    rng = np.random.default_rng(4)
    away = (fine % 20.0 > 17.0) | (rng.random(len(fine)) < 0.2)
    angle = np.deg2rad(150.0 * np.sin(fine / 30.0))
    angle[rng.random(len(fine)) < 0.1] = np.nan
    temps = (np.interp(fine, log.time_s, temp_c)[~away] for temp_c in (log.temp_a_c, log.temp_b_c))
    drive = prepare_table(SyncedTable(fine[~away], angle[~away], np.full(np.sum(~away), 0.001), *temps))
    known = np.isfinite(drive.angle_rad)
    off_deg = np.rad2deg(drive.angle_rad) - 150.0 * np.sin(drive.time_s / 30.0)
    assert np.abs(off_deg[known]).max() < 5.0 * 0.25 / 15.0 + 0.01
    assert known.mean() > 0.9


@pytest.mark.parametrize("rows", [0, 5])
def test_too_few_rows(rows):
    nothing = np.zeros(rows)
    with pytest.raises(InputError, match=r"too short|has no rows"):
        prepare_table(SyncedTable(np.arange(rows, dtype=float), nothing, nothing, nothing, nothing))


# At ten times the paper's pace the wire cools by 12 °C/s, 0.18 °C from one frame to the next: all rows are needed.
@pytest.mark.parametrize(("pace", "share"), [(1.0, 0.7), (0.2, 0.7), (0.1, 1.0)])
def test_rows_of_a_fast_record_stand_for_its_angle(pace, share):
    """Means over rows against the model at the rows' instants, from the paper's pace to ten times as fast."""
    time_s = np.arange(0.0, 900.0 * pace, 1.0 / 66.0)
    u = time_s / pace
    own = np.where(u < 600.0, 23.0 + 53.0 * np.minimum(u / 500.0, 1.0), 23.0 + 53.0 * np.exp(-(u - 600.0) / 45.0))
    room = np.full(len(time_s), 23.0)
    model = ActuatorModel(reference_spec())
    dense = model.simulate(model.prepare_log(TemperatureLog(time_s, own, room), start_angle_rad=3.0)).angle_rad
    drive = model.prepare(SyncedTable(time_s, dense, np.full(len(time_s), 1e-3), own, room))
    assert len(drive) <= share * len(time_s)
    away = np.abs(model.simulate(drive).angle_rad - drive.angle_rad)
    assert np.sqrt(np.mean(away**2)) < 0.05 * DEG
    # Two corners of the motion lie within a row each.
    assert np.sort(away)[-5] < 0.1 * DEG
