"""Ripple of a pulsed heater that a log is too slow to show: the wire follows its peaks, noise alone has none."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.actuator import ActuatorModel, reference_spec
from torsight.actuator.doubt import Doubt
from torsight.actuator.fitted import FittedModel
from torsight.actuator.record.conditioning import condition
from torsight.core.parameter import REACH
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG, Floats
from torsight.discovery.prediction import PredictedAngle, predict_with_sigma

BEGIN_S, END_S = 60.0, 360.0
ROOM_C = 23.0


def wire(time_s: Floats, *, height_c: float, period_s: float = 0.83) -> Floats:
    """Return a wire's temperature: rest, a ramp by pulses with such peaks, and cooling by itself."""
    ramp = ROOM_C + 0.15 * np.clip(time_s - BEGIN_S, 0.0, END_S - BEGIN_S)
    heated = (time_s > BEGIN_S) & (time_s < END_S)
    pulses = height_c * np.sin(2.0 * np.pi * time_s / period_s)
    cooling = np.exp(-np.maximum(time_s - END_S, 0.0) / 40.0)
    return np.where(heated, ramp + pulses, ROOM_C + (ramp - ROOM_C) * cooling)


def read(
    rate_hz: float, *, height_c: float, noise_c: float = 0.05, seed: int = 1, until_s: float = 600.0
) -> tuple[Floats, Floats]:
    """Return times and readings of a log with noise and a last digit of 0.1 °C."""
    time_s = np.arange(0.05, until_s, 1.0 / rate_hz)
    noise = noise_c * np.random.default_rng(seed).standard_normal(len(time_s))
    return time_s, np.round((wire(time_s, height_c=height_c) + noise) / 0.1) * 0.1


@pytest.mark.parametrize("rate_hz", [2.0, 4.0, 10.0])
def test_the_height_of_the_peaks_is_told_where_the_wire_is_heated(rate_hz: float) -> None:
    # A wire is heated for a third of a record: noise is what most of it shows.
    time_s, temp_c = read(rate_hz, height_c=0.6, until_s=900.0)
    peaks_c = condition(time_s, temp_c).peaks_c
    heated = (time_s > BEGIN_S + 20.0) & (time_s < END_S - 1.0)
    assert np.median(peaks_c[heated]) == pytest.approx(0.6, rel=0.2)
    assert peaks_c[heated].min() > 0.3
    assert not peaks_c[(time_s < BEGIN_S - 20.0) | (time_s > END_S + 20.0)].any()


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_has_no_peaks(seed: int) -> None:
    for rate_hz, noise_c in ((1.0, 0.05), (4.0, 0.02), (4.0, 0.2), (20.0, 0.1)):
        assert not condition(*read(rate_hz, height_c=0.0, noise_c=noise_c, seed=seed)).peaks_c.any()


@pytest.mark.parametrize("digit_c", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("step_s", [1.0, 0.25, 0.05])
def test_last_digits_are_no_ripple(step_s: float, digit_c: float) -> None:
    time_s = np.arange(0.0, 600.0, step_s)
    noise = 0.03 * np.random.default_rng(3).standard_normal(len(time_s))
    temp_c = np.round((wire(time_s, height_c=0.0) + noise) / digit_c) * digit_c
    assert not condition(time_s, temp_c).peaks_c.any()


@pytest.mark.parametrize(("step_s", "held"), [(0.25, 2), (0.25, 4), (0.1, 5)])
def test_readings_that_are_held_are_no_ripple(step_s: float, held: int) -> None:
    time_s, temp_c = read(1.0 / step_s, height_c=0.0, noise_c=0.03)
    assert not condition(time_s, temp_c[np.arange(len(temp_c)) // held * held]).peaks_c.any()


def predicted(log: TemperatureLog) -> PredictedAngle:
    """Return what the reference rig, whose values are known, does with a log."""
    model = ActuatorModel(reference_spec())
    fitted = FittedModel(model, model.nominal(), doubt=Doubt((), np.zeros((0, 0)), 0.1))
    return predict_with_sigma(fitted, log, start_angle_rad=177.6 * DEG)


def test_a_prediction_follows_the_peaks_and_knows_that_it_does_not_see_them() -> None:
    fine_s = np.arange(0.0, 600.0, 0.02)
    cold = np.full(len(fine_s), ROOM_C)
    time_s, temp_c = read(4.0, height_c=0.6, until_s=900.0)
    truth = predicted(TemperatureLog(fine_s, wire(fine_s, height_c=0.6), cold)).angle_rad
    true_deg = np.interp(time_s, fine_s, truth) / DEG
    later = predicted(TemperatureLog(time_s, temp_c, np.full(len(time_s), ROOM_C)))
    moving = np.abs(np.gradient(true_deg, time_s)) > 0.05
    error_deg, sigma_deg = (later.angle_rad / DEG - true_deg)[moving], later.sigma_rad[moving] / DEG
    # By the mean temperature, 0.6 °C lower, it would be 4° off.
    assert np.sqrt(np.mean(error_deg**2)) < 1.5
    assert np.mean(np.abs(error_deg) < REACH * sigma_deg) > 0.9
    without = predicted(TemperatureLog(*read(4.0, height_c=0.0, until_s=900.0), np.full(len(time_s), ROOM_C)))
    assert np.median(sigma_deg) > 2.0 * np.median(without.sigma_rad[moving] / DEG)
