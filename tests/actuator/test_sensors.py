"""What a log says of its sensors' time constants."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from torsight.actuator import ActuatorModel, Drive, reference_spec
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem

NOISE_C, FINE_S, ROOM_C = 0.05, 0.01, 23.0


def wire(hold_s: float) -> NDArray[np.float64]:
    """Return a wire that is heated four times, at half a degree per second, and cools each time for four minutes."""
    heated_s, after_s = np.arange(0.0, 80.0, FINE_S), np.arange(0.0, 240.0, FINE_S)
    once = np.concatenate([0.5 * heated_s, np.full(round(hold_s / FINE_S), 40.0), 40.0 * np.exp(-after_s / 45.0)])
    return ROOM_C + np.tile(once, 4)


def drive_of(lag_s: float, *, noise_c: float = NOISE_C, interval_s: float = 0.25, hold_s: float = 10.0) -> Drive:
    """Return a record in which A is heated and B stays at room temperature, read by sensors with a lag."""
    read_c = wire(hold_s)
    if lag_s > 0.0:
        keep = np.exp(-FINE_S / lag_s)
        read_c = lfilter([1.0 - keep], [1.0, -keep], read_c - ROOM_C) + ROOM_C
    read_c = read_c[:: round(interval_s / FINE_S)]
    rng = np.random.default_rng(2)
    noise, other = noise_c * rng.standard_normal((2, len(read_c)))
    time_s = interval_s * np.arange(len(read_c))
    still = np.full(len(time_s), 177.6 * DEG)
    table = SyncedTable(time_s, still, np.full(len(time_s), 0.05 * DEG), read_c + noise, ROOM_C + other)
    return ActuatorModel(reference_spec()).prepare(table, where="record")


@pytest.fixture(scope="module")
def sharp() -> Drive:
    return drive_of(0.0)


def test_a_log_with_sharp_corners_was_not_read_by_a_slow_sensor(sharp: Drive) -> None:
    against = [-sharp.sensors.log_evidence(lag_s, 0.0) for lag_s in (0.0, 1.5, 3.0, 6.0)]
    assert against[0] == 0.0
    assert against == sorted(against)
    # One to twenty are the odds from which evidence is called strong (Kass and Raftery (1995)).
    assert against[2] > np.log(20.0)


@pytest.mark.parametrize("lag_s", [3.0, 6.0])
def test_a_rounded_log_refutes_longer_lags_and_no_shorter_ones(lag_s: float) -> None:
    rounded = drive_of(lag_s).sensors
    own, none, longer = (rounded.log_evidence(each, 0.0) for each in (lag_s, 0.0, 2.5 * lag_s))
    # The wire's own corners may be rounded: the odds for a lag are those of one rounding among the possible ones.
    assert 0.0 <= own - none < np.log(20.0)
    assert own - longer > np.log(20.0)


def test_a_wire_that_stays_level_shows_no_lag(sharp: Drive) -> None:
    assert sharp.sensors.log_evidence(0.0, 6.0) == pytest.approx(0.0, abs=np.log(3.0))


@pytest.mark.parametrize("case", [{"noise_c": 0.0}, {"interval_s": 5.0}])
def test_readings_that_do_not_show_corners_are_no_evidence(case: dict[str, float]) -> None:
    assert drive_of(0.0, **case).sensors.log_evidence(6.0, 6.0) == pytest.approx(0.0, abs=1e-9)


def test_the_log_counts_beside_the_fitted_rows_with_a_lag_less_its_pure_delay(sharp: Drive) -> None:
    problem = ActuatorProblem(sharp, reference_spec(), seed=0)
    lag = problem.also_seen({"lag_s": 6.0, "lag_delay_share": 0.5}, ["sensor_lag"])
    assert lag == pytest.approx(sharp.sensors.log_evidence(3.0, 3.0))
    each = problem.also_seen({"lag_a_s": 2.0, "lag_b_s": 9.0}, ["unlike_lags"])
    assert each == pytest.approx(sharp.sensors.log_evidence(2.0, 9.0))
    assert problem.also_seen({}, []) == 0.0


@pytest.mark.parametrize("lag_s", [3.1, 4.7, 6.0])
def test_a_top_behind_a_slow_sensor_is_as_high_between_the_time_constants_of_the_grid(lag_s: float) -> None:
    drive = drive_of(lag_s, noise_c=0.005, hold_s=0.0)
    wire_c = drive.temp_a_c + drive.sensors.lag_correction(0, lag_s)
    tops_c = [wire_c[abs(drive.time_s - top_s) < 5.0].max() for top_s in 80.0 + 320.0 * np.arange(4.0)]
    # The mean of four tops, whose readings have a noise of 0.005 °C.
    assert np.mean(tops_c) == pytest.approx(ROOM_C + 40.0, abs=0.004)
