"""Offset and drift of made-up pairs whose clock is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from sync import LightEvents, LogReading, estimate_clock, find_clock, read_temperature_log
from sync.clock.gaussian_mixture import MOST_HYPOTHESES, Gaussian, clock_of
from sync.clock.restarts import weigh_restarts, with_gap
from sync.clock.threshold_likelihood import maxima
from sync.log.repairs import Restart
from tests.sync.made_up_pairs import Rig, make_pair, programme, records
from tests.sync.two_instruments import read_pair
from torsight.core.errors import InputError, NoResultError
from torsight.core.files.tables import read_angles
from torsight.core.records import TemperatureLog

SINCE_1970_S = 1_715_678_493.0
FAST = Rig(cooling_s=8.0, temp_noise_c=0.05, angle_noise_deg=0.1)


def fast_programme(seed, **changes):
    return programme(seed, **{"rates": (1.2, 3.0), "hold": (1.0, 5.0), "rest_s": 40.0, "half_cycles": 6} | changes)


def covers(interval, value, widen=1.0):
    """Whether an interval, widened to a level that a test may rely on, holds the value (2.3: about 5 in 10⁶)."""
    low, high = interval
    half, middle = 0.5 * widen * (high - low), 0.5 * (low + high)
    return middle - half <= value <= middle + half


@pytest.mark.parametrize(("offset_s", "lag_s"), [(0.0, 0.0), (-600.0, 0.0), (312.7, 1.5)])
def test_short_fast_record(offset_s, lag_s):
    pair = make_pair(
        5,
        rig=replace(FAST, lag_s=lag_s),
        cycles=fast_programme(5),
        offset_s=offset_s,
        drift_ppm=120.0,
        film_fps=30.0,
        log_step_s=0.015,
        lost_share=0.2,
    )
    clock = estimate_clock(*records(pair))
    assert covers(clock.offset_ci95_s, offset_s, widen=2.3)
    assert covers(clock.drift_ci95_ppm, 120.0, widen=2.3)
    # Stops and corners pin the offset: within the time in which a frame of the film passes, give or take the lag.
    assert abs(clock.offset_s - offset_s) < 0.15 + 0.2 * lag_s


def test_long_slow_record_with_drift():
    pair = make_pair(3, offset_s=-188.2, drift_ppm=-160.0, lost_share=0.2)
    clock = estimate_clock(*records(pair))
    assert covers(clock.offset_ci95_s, -188.2, widen=2.3)
    assert covers(clock.drift_ci95_ppm, -160.0, widen=2.3)
    assert clock.offset_ci95_s[1] - clock.offset_ci95_s[0] < 1.0


def test_a_lag_of_the_sensor_is_not_taken_for_an_offset():
    pair = make_pair(4, rig=Rig(lag_s=6.0), offset_s=40.0)
    clock = estimate_clock(*records(pair))
    assert covers(clock.offset_ci95_s, 40.0, widen=2.3)
    assert abs(clock.offset_s - 40.0) < 1.0


@pytest.mark.parametrize("seed", [3, 5])
def test_a_motion_late_behind_its_temperature_widens_the_interval(seed):
    """Friction that grows with the speed delays a motion as a late log would."""
    plain, late = (
        estimate_clock(*records(make_pair(seed, rig=Rig(late_s=late_s), offset_s=40.0))) for late_s in (0.0, 6.0)
    )
    assert covers(late.offset_ci95_s, 40.0)
    assert np.ptp(late.offset_ci95_s) > 3.0 * np.ptp(plain.offset_ci95_s)
    assert any("late behind the temperature" in note for note in late.notes)
    assert not any("late behind the temperature" in note for note in plain.notes)


@pytest.mark.parametrize("seed", [3, 5])
def test_a_spring_that_the_other_one_warms_is_not_heated(seed):
    pair = make_pair(seed, rig=Rig(passive_share=0.6), offset_s=40.0)
    clock = estimate_clock(*records(pair))
    assert covers(clock.offset_ci95_s, 40.0, widen=2.3)
    assert np.ptp(clock.offset_ci95_s) < 2.0


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("moving", [0, 1, 2])
def test_of_heatings_that_are_alike_those_are_likelier_at_which_the_log_covers_the_film(seed, moving):
    angles, log = records(make_pair(seed, cycles=3 * programme(seed, half_cycles=2, incomplete=False), offset_s=40.0))
    ends = np.linspace(0, len(angles), 4).astype(int)
    first, last = ends[moving], ends[moving + 1]
    angle = angles.angle_rad + 0.0
    noise = np.diff(angles.angle_rad, prepend=angles.angle_rad[0]) / np.sqrt(2.0)
    angle[:first], angle[last:] = angle[first] + noise[:first], angle[last - 1] + noise[last:]
    clock = estimate_clock(replace(angles, angle_rad=angle), log)
    assert clock.offset_s == pytest.approx(40.0, abs=5.0)
    # The pairs of heatings are alike: the others are possible, too.
    assert np.ptp(clock.offset_ci95_s) > 0.3 * (log.time_s[-1] - log.time_s[0])


@pytest.mark.parametrize("seed", [3, 4])
def test_a_hold_that_is_read_too_cold_by_rounding_moves_no_clock(seed):
    """The sensor's steps of 0.5 °C let 60 °C read as 59.85 °C, which a ramp of 0.1 °C/s reaches 1.5 s earlier."""
    angles, log = records(make_pair(seed, rig=Rig(temp_noise_c=0.01), offset_s=40.0))
    coarse = {name: 0.5 * np.round((getattr(log, name) - 0.35) / 0.5) + 0.35 for name in ("temp_a_c", "temp_b_c")}
    clock = estimate_clock(angles, replace(log, **coarse))
    low, high = clock.offset_ci95_s
    assert low <= 40.0 <= high
    # Twice the hold's error of 0.5 °C / √12 at the slowest of its two ramps is 3.6 s.
    assert high - low < 7.2


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_programme_of_stairs_is_not_shifted_by_a_step(seed):
    """Every stair but the last looks like the next one: nothing moves while a temperature is held."""
    cycles = [
        replace(one, rate_c_s=0.5, peak_c=76.0, hold_s=60.0, steps_c=(44.0, 50.0, 56.0, 62.0, 68.0))
        for one in programme(seed, half_cycles=4, incomplete=False)
    ]
    angles, log = records(make_pair(seed, cycles=cycles, offset_s=40.0))
    clock = estimate_clock(angles, log)
    # A step takes 72 s.
    assert clock.offset_s == pytest.approx(40.0, abs=3.0)
    assert np.ptp(clock.offset_ci95_s) < 72.0


def test_a_film_with_much_noise_has_the_strokes_of_a_good_one():
    """With 1° of noise the speed over a second is known to 1°/s, and slow motions would be cut into pieces."""
    pair = make_pair(5, rig=Rig(angle_noise_deg=1.0), offset_s=40.0, film_fps=15.0)
    clock = estimate_clock(*records(pair))
    assert covers(clock.offset_ci95_s, 40.0, widen=1.5)
    assert np.ptp(clock.offset_ci95_s) < 5.0


def test_a_log_of_another_day_is_doubted():
    (angles, log), (_, other) = (records(make_pair(seed)) for seed in (3, 6))
    assert not any("one experiment" in note for note in estimate_clock(angles, log).notes)
    assert any("film and log are of one experiment" in note for note in estimate_clock(angles, other).notes)


def test_one_rate_and_no_stop_gives_a_wide_interval():
    cycles = programme(7, rates=(0.12, 0.12001), incomplete=False)
    pair = make_pair(7, cycles=cycles, offset_s=25.0)
    clock = estimate_clock(*records(pair))
    low, high = clock.offset_ci95_s
    assert low <= 25.0 <= high
    assert high - low > 10.0
    assert any("wide" in note for note in clock.notes)


def test_shifting_the_log_shifts_the_offset_alone():
    pair = make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=30.0, log_step_s=0.05)
    angles, log = records(pair)
    here = estimate_clock(angles, log)
    there = estimate_clock(angles, replace(log, time_s=log.time_s + 1000.0))
    # The grid that the log is smoothed on moves with it: only rounding differs.
    assert there.offset_s - here.offset_s == pytest.approx(1000.0, abs=1e-3)
    assert there.drift_ppm == pytest.approx(here.drift_ppm, abs=1.0)


@cache
def since_the_start():
    """Return a pair whose seconds count from its start, and its clock."""
    angles, log = records(make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.25))
    return angles, log, estimate_clock(angles, log)


@pytest.mark.parametrize("film_began_s", [0.0, SINCE_1970_S])
def test_seconds_of_the_calendar_are_as_good_as_seconds_since_the_start(film_began_s):
    angles, log, clock = since_the_start()
    later = estimate_clock(
        replace(angles, time_s=angles.time_s + film_began_s), replace(log, time_s=log.time_s + SINCE_1970_S)
    )
    moved_s = SINCE_1970_S - film_began_s
    # The calendar's seconds are floats in steps of 0.2 µs.
    assert later.drift_ppm == pytest.approx(clock.drift_ppm, abs=1.0)
    assert later.within_s == pytest.approx([end + moved_s for end in clock.offset_ci95_s], abs=1e-3)
    # Film time 0 may be fifty years before the film: there the drift leaves days open.
    assert (np.ptp(later.offset_ci95_s) > 1e5) == (film_began_s > 0.0)
    begin_s, end_s = later.to_temperature_time(film_began_s + np.array([0.0, 300.0]))
    ends = clock.to_temperature_time(np.array([0.0, 300.0])) + SINCE_1970_S
    assert [begin_s, end_s] == pytest.approx(ends.tolist(), abs=1e-2)
    given = estimate_clock(
        replace(angles, time_s=angles.time_s + film_began_s),
        replace(log, time_s=log.time_s + SINCE_1970_S),
        given_offset_s=moved_s,
    )
    # The made-up clocks agree as the film begins.
    assert given.to_temperature_time(np.array([film_began_s])) == pytest.approx(SINCE_1970_S, abs=1e-3)
    assert covers(given.drift_ci95_ppm, 0.0, widen=2.3)


def test_given_values_are_taken():
    angles, log = records(make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05))
    clock = estimate_clock(angles, log, given_offset_s=1.25, given_drift_ppm=-30.0)
    assert (clock.offset_s, clock.drift_ppm) == (1.25, -30.0)
    assert clock.offset_ci95_s == (1.25, 1.25)


RESONATOR_PPM = 2000.0
"""A ceramic resonator, as many boards that log have, may be off by 5000 ppm."""


@pytest.mark.parametrize("light", [False, True])
def test_the_offset_is_found_at_a_drift_that_is_given(light):
    pair = make_pair(
        5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05, offset_s=37.3, drift_ppm=RESONATOR_PPM
    )
    angles, log = records(pair)
    events = light_of(pair) if light else None
    clock = estimate_clock(angles, log, given_drift_ppm=RESONATOR_PPM, light=events)
    assert (clock.drift_ppm, clock.drift_ci95_ppm) == (RESONATOR_PPM, (RESONATOR_PPM, RESONATOR_PPM))
    assert covers(clock.offset_ci95_s, 37.3, widen=2.3)
    # Stops and corners, or the light, pin it: within some frames.
    assert abs(clock.offset_s - 37.3) < 0.15


def test_a_given_offset_stays_and_a_lag_of_the_sensor_is_not_taken_for_drift():
    rig = replace(FAST, lag_s=2.4)
    pair = make_pair(1, rig=rig, cycles=fast_programme(1), film_fps=15.0, log_step_s=0.05, offset_s=-217.0)
    clock = estimate_clock(*records(pair), given_offset_s=-217.0)
    assert clock.offset_s == pytest.approx(-217.0, abs=1e-4)
    assert clock.offset_ci95_s == pytest.approx((-217.0, -217.0), abs=1e-4)
    assert covers(clock.drift_ci95_ppm, 0.0, widen=2.3)


def without(log, begin_s, end_s):
    keep = (log.time_s < begin_s) | (log.time_s >= end_s)
    return TemperatureLog(log.time_s[keep], log.temp_a_c[keep], log.temp_b_c[keep])


def messy_pair():
    rig = replace(FAST, threshold_scatter_c=0.02)
    return records(
        make_pair(5, rig=rig, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05, offset_s=37.3, drift_ppm=60.0)
    )


def test_a_gap_that_swallows_a_heating():
    angles, log = messy_pair()
    clock = estimate_clock(angles, without(log, 97.3, 187.3))
    assert covers(clock.offset_ci95_s, 37.3, widen=2.3)


def test_half_of_the_log_at_a_wrong_time():
    angles, log = messy_pair()
    later = np.arange(len(log)) > len(log) // 2
    clock = estimate_clock(angles, TemperatureLog(log.time_s + 5400.0 * later, log.temp_a_c, log.temp_b_c))
    assert covers(clock.offset_ci95_s, 37.3, widen=2.3)
    assert any("wrong time" in note for note in clock.notes)


@pytest.mark.parametrize("coarse", [np.floor, np.round])
def test_whole_seconds_are_cut_off_or_rounded(coarse, tmp_path):
    angles, log = messy_pair()
    table = {"time_s": coarse(log.time_s), "temp_a_c": log.temp_a_c, "temp_b_c": log.temp_b_c}
    pd.DataFrame(table).to_csv(tmp_path / "t.csv", index=False)
    clock = find_clock(angles, read_temperature_log(tmp_path / "t.csv")).clock
    assert covers(clock.offset_ci95_s, 37.3, widen=1.3)
    assert any("steps of 1 s" in note for note in clock.notes)


def test_a_log_too_slow_for_a_corner_leaves_room_for_no_lag_and_for_a_long_one():
    angles, log = messy_pair()
    clock = estimate_clock(angles, TemperatureLog(log.time_s[::40], log.temp_a_c[::40], log.temp_b_c[::40]))
    low, high = clock.offset_ci95_s
    assert low < 37.3 - 10.0
    assert high > 37.3
    assert any("no corner" in note for note in clock.notes)


def test_channels_that_are_swapped_are_no_offset():
    angles, log = messy_pair()
    with pytest.raises(NoResultError, match="the other way round"):
        estimate_clock(angles, TemperatureLog(log.time_s, log.temp_b_c, log.temp_a_c))


def test_a_log_in_another_unit_is_refused():
    angles, log = messy_pair()
    with pytest.raises(InputError, match="log, column temp_a_c: never is as cold as a room"):
        estimate_clock(angles, replace(log, temp_a_c=1.8 * log.temp_a_c + 32.0, temp_b_c=1.8 * log.temp_b_c + 32.0))
    with pytest.raises(InputError, match=r"log, column time_s: .*give times in seconds"):
        estimate_clock(angles, replace(log, time_s=log.time_s / 3600.0))


def test_no_motion_says_unknown_instead_of_guessing():
    angles, log = records(make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05))
    still = replace(angles, angle_rad=np.full(len(angles), 0.3))
    with pytest.raises(NoResultError, match="unknown") as caught:
        estimate_clock(still, log)
    assert caught.value.exit_code == 4


def test_constant_temperature_says_unknown():
    angles, log = records(make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05))
    cold = np.full(len(log), 24.0)
    with pytest.raises(NoResultError, match="unknown"):
        estimate_clock(angles, TemperatureLog(log.time_s, cold, cold))


def light_of(pair, phase_s=0.0):
    """First frames that show each change of a light that is on while a spring is heated."""
    begin, end = pair.switch_true_s[:, 0], pair.switch_true_s[:, 1]
    times = np.concatenate([begin, end]) + phase_s
    on = np.concatenate([np.ones(len(begin), bool), np.zeros(len(end), bool)])
    inside = (times > pair.film_s[1]) & (times < pair.film_s[-1])
    first = np.searchsorted(pair.film_s, times[inside])
    order = np.argsort(first)
    return LightEvents(pair.film_s[first][order], on[inside][order])


def test_a_shared_light_has_no_bias():
    fps, errors = 30.0, []
    for seed in range(40):
        rng = np.random.default_rng([seed, 1])
        offset_s, drift_ppm = float(rng.uniform(-600, 600)), float(rng.uniform(-200, 200))
        pair = make_pair(
            seed,
            rig=FAST,
            cycles=fast_programme(seed, half_cycles=4),
            offset_s=offset_s,
            drift_ppm=drift_ppm,
            film_fps=fps,
            log_step_s=0.015,
        )
        angles, log = records(pair)
        clock = find_clock(angles, LogReading(log), light=light_of(pair)).clock
        # Told at the middle of the film, where the events are: at its beginning the drift, hardly known here, comes in.
        middle_s = 0.5 * pair.film_s[-1]
        drift_error = (clock.drift_ppm - drift_ppm) * 1e-6
        errors.append(clock.offset_s - offset_s + drift_error * middle_s)
        assert covers(clock.offset_ci95_s, offset_s, widen=2.3)
    # Seven events, each off by an even spread over a frame: 0.29/√7 of it per film, and 1/√40 of that in the mean.
    assert abs(np.mean(errors)) * fps < 0.1
    assert np.std(errors) * fps < 0.4


def test_a_clock_that_jumps_forward_between_two_rows_is_told_by_the_light():
    """Nothing in the stamps shows it; rows on either side lie by different offsets, and neither is silently wrong."""
    pair = make_pair(5, rig=FAST, cycles=fast_programme(5), offset_s=31.0, film_fps=30.0, log_step_s=0.05)
    angles, log = records(pair)
    at_s = 31.0 + 0.5 * (pair.switch_true_s[2, 0] + pair.switch_true_s[1, 1])
    jumped = replace(log, time_s=np.where(log.time_s > at_s, log.time_s + 4.0, log.time_s))
    clock = find_clock(angles, LogReading(jumped), light=light_of(pair)).clock
    assert covers(clock.offset_ci95_s, 31.0)
    assert covers(clock.offset_ci95_s, 35.0)
    assert any("may have jumped" in note for note in clock.notes)
    whole = find_clock(angles, LogReading(log), light=light_of(pair)).clock
    assert not any("may have jumped" in note for note in whole.notes)
    assert np.ptp(whole.offset_ci95_s) < 0.2


def test_a_light_without_a_switch_in_the_log():
    pair = make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05)
    angles, log = records(pair)
    bare = replace(log, heat_a=None, heat_b=None)
    with pytest.raises(InputError, match="heat_a"):
        find_clock(angles, LogReading(bare), light=light_of(pair))


def test_a_light_that_fits_nothing():
    angles, log = records(make_pair(5, rig=FAST, cycles=fast_programme(5), film_fps=15.0, log_step_s=0.05))
    nonsense = LightEvents(np.array([3.0, 3.5, 4.1, 11.0, 11.3, 12.9]), np.ones(6, dtype=bool))
    with pytest.raises(NoResultError, match="LED"):
        find_clock(angles, LogReading(log), light=nonsense)


@pytest.mark.parametrize(("away_s", "drift_ppm"), [(0.0, None), (45.0, None), (45.0, -RESONATOR_PPM)])
def test_restart_during_a_rest_is_settled_by_the_motion(away_s, drift_ppm):
    cycles = fast_programme(2, rest_s=120.0)
    pair = make_pair(
        2, rig=FAST, cycles=cycles, film_fps=15.0, log_step_s=0.25, offset_s=77.0, drift_ppm=drift_ppm or 0.0
    )
    angles, log = records(pair)
    at_s = pair.switch_true_s[4, 0] - 60.0
    film = log.time_s - 77.0
    keep = (film < at_s) | (film > at_s + away_s)
    index = int(np.count_nonzero(film < at_s))
    true_s = log.time_s[keep]
    joined = true_s.copy()
    joined[index:] -= joined[index] - joined[index - 1] - 0.25
    short = TemperatureLog(joined, log.temp_a_c[keep], log.temp_b_c[keep])
    reading = LogReading(short, restarts=(Restart(index, 0.0, 0.25, float("inf")),))
    found = find_clock(angles, reading, given_drift_ppm=drift_ppm)
    assert covers(found.clock.offset_ci95_s, 77.0, widen=2.3)
    (restart,) = found.reading.restarts
    error_s = found.reading.log.time_s[index] - true_s[index]
    assert abs(error_s) < 5.0 * restart.gap_sigma_s
    assert restart.gap_sigma_s < 0.5


@pytest.mark.shared_data
@pytest.mark.parametrize("name", ["plain", "late_sensor", "uneven_friction"])
def test_records_on_one_clock(shared_data, name):
    from sync import read_temperature_log

    folder = shared_data / "records" / name
    clock = estimate_clock(read_angles(folder / "angle.csv"), read_temperature_log(folder / "temps.csv").log)
    assert covers(clock.offset_ci95_s, 0.0, widen=1.5)
    assert covers(clock.drift_ci95_ppm, 0.0, widen=1.5)
    assert abs(clock.offset_s) < 0.5


@pytest.mark.shared_data
def test_two_instruments_without_a_known_offset(shared_data):
    # Every cycle has another load, so no stroke repeats another's thresholds, and the rates are all alike.
    clock = estimate_clock(*read_pair(shared_data / "sma_react"))
    low, high = clock.offset_ci95_s
    assert high - low > 120.0
    # The chamber leaves its hold at 5397.0 s and 10651.2 s of the frame's clock; the specimen is hottest at 5430.8 s
    # and 10682.8 s of the meter's: the specimen follows the chamber, so the offset is at most some 30 s.
    assert low < 0.0 < high
    assert any("wide" in note for note in clock.notes)


@pytest.mark.parametrize("away_s", [0.0, 7.0])
def test_a_light_tells_how_long_a_logger_was_away(away_s):
    rig, cycles = FAST, fast_programme(3, half_cycles=4)
    pair = make_pair(3, rig=rig, cycles=cycles, film_fps=30.0, log_step_s=0.015, offset_s=-41.0, drift_ppm=50.0)
    angles, log = records(pair)
    index = int(np.searchsorted(log.time_s, pair.switch_true_s[2, 0] - 5.0 - 41.0))
    behind = index + round(away_s / 0.015)
    keep = np.r_[0:index, behind : len(log)]
    true_s = log.time_s[keep]
    joined = true_s.copy()
    joined[index:] += joined[index - 1] + 0.015 - joined[index]
    cut = TemperatureLog(joined, log.temp_a_c[keep], log.temp_b_c[keep], log.heat_a[keep], log.heat_b[keep])
    reading = LogReading(cut, restarts=(Restart(index, 0.0, 0.015, np.inf),))
    found = find_clock(angles, reading, light=light_of(pair))
    assert covers(found.clock.offset_ci95_s, -41.0, widen=2.3)
    assert found.clock.offset_ci95_s[1] - found.clock.offset_ci95_s[0] < 0.1
    # Behind the joint the rows stand where they were, to a frame or two.
    assert abs(found.reading.log.time_s[-1] - true_s[-1]) < 0.1


def test_the_value_is_where_most_of_the_weight_is_not_where_the_density_peaks():
    wide = Gaussian(np.array([45.0, 0.0]), np.diag([8.0**2, 1e-10]), float(np.log(0.97)))
    narrow = Gaussian(np.array([18.0, 0.0]), np.diag([0.05**2, 1e-10]), float(np.log(0.03)))
    clock = clock_of([wide, narrow], middle_s=0.0)
    # The narrow part, 27 s away, counts by its share and by how likely the wide one is there.
    assert clock.offset_s == pytest.approx(45.0, abs=1.1 * 27.0 * 0.03 * np.exp(-0.5 * (27.0 / 8.0) ** 2))
    # A fortieth of all weight below: five sixths of the narrow part's share.
    assert clock.offset_ci95_s[0] == pytest.approx(18.0, abs=0.2)


def test_many_restarts_are_no_more_hypotheses_than_are_weighed(monkeypatch):
    pair = make_pair(3, rig=FAST, cycles=fast_programme(3, half_cycles=2), film_fps=10.0, log_step_s=0.25)
    angles, log = records(pair)
    restarts = tuple(Restart(index, 0.0, 0.25, np.inf) for index in range(10, 60, 10))
    made = []
    monkeypatch.setattr("sync.clock.restarts.with_gap", lambda *changed: made.append(changed) or with_gap(*changed))
    monkeypatch.setattr("sync.clock.restarts.motion_likelihood", lambda *_log, **_gaps: None)
    weigh_restarts(angles, LogReading(log, restarts=restarts), prior=None)
    # Six ways for each of five restarts, of which the likeliest hypotheses are kept: all of them are 6⁵ = 7,776.
    assert len(made) <= 5 * 6 * MOST_HYPOTHESES + 5


@pytest.mark.parametrize("seed", [0, 3])
def test_motions_between_the_holds_of_a_heating_tell_the_offset_to_a_frame(seed):
    steps_c, rates = (44.0, 50.0, 56.0, 62.0, 68.0), (0.5, 0.3, 0.4, 0.6)
    cycles = [
        replace(one, rate_c_s=rate, peak_c=76.0, hold_s=60.0, steps_c=steps_c)
        for one, rate in zip(programme(seed, half_cycles=4), rates, strict=True)
    ]
    clock = estimate_clock(*records(make_pair(seed, rig=Rig(threshold_scatter_c=0.02), cycles=cycles, offset_s=120.0)))
    low, high = clock.offset_ci95_s
    assert low <= 120.0 <= high
    assert abs(clock.offset_s - 120.0) < 0.25
    assert high - low < 1.0


def test_hills_of_a_likelihood_are_parted_by_deep_valleys_alone():
    log_likelihood = np.array([-np.inf, 0.0, 10.0, 9.0, 10.5, 2.0, 8.0, -np.inf])
    assert maxima(log_likelihood) == [(1, 5), (6, 6)]
    assert maxima(np.full(3, -np.inf)) == []
