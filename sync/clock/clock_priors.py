"""What is assumed about clocks, thresholds, stops, sensors and LEDs before the data speak.

In one record, so that ``benchmarks/sync/prior_sensitivity.py`` can estimate the clock of pairs whose clock is known
with half and with twice of each value. Of four such pairs (``--seeds 4``) none of them moved the offset by more than
0.08 of its standard deviation in the median and 0.6 at most; the intervals' widths changed by factors of 0.92 to 1.17,
and held the truth as before. The weights of strokes, stops and changes of the LED that have no partner do not count
there at all: they are for logs that lack a part of the film. Taken away altogether two of them count: without
``rate_noise`` the offsets of eleven pairs of ``clock_coverage.py`` move by up to 1.8 standard deviations, and without
lags in two stages one of five pairs leaves its interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Priors:
    """Widths and shares; units at the end of each name, shares and weights plain.

    Attributes
    ----------
    drift_sigma_ppm : float
        Quartz clocks of computers: 95 % within ±200 ppm of each other.
    idle_heating_weight : float
        How much of the explained share of the motion is lost by heatings during which nothing moved their way: such a
        heating may have been too short to move anything.
    no_segment_log : float
        Logarithm of how much less likely it is that a stroke has no heating or cooling at all: e⁻⁸ is one of 3000.
    crossing_temper : float
        Power to which the thresholds' likelihood counts where answers are weighed: the ten crossings of a stroke share
        one scatter and count as two.
    curve_sigma_c : float
        Threshold temperatures of a kind of stroke are not known: wider than any heating.
    start_sigma_c_per_deg : float
        How much a threshold depends on the angle at which its stroke began, through the stress: E_M · d / (2 L_s) / C_M
        per radian, which for the reference rig is 20 GPa · 0.0039 / (32 MPa/K) · π/180 = 0.04 °C per degree.
    far_scatter_c_per_deg : float
        Scatter of the thresholds of strokes that begin far from the others.
    near_deg : float
        Strokes that begin so near to the usual start scatter with how the actuator came there: how far a heating went.
    near_scatter_c_per_deg : (float, float)
        Scatter of thresholds that begin so near, for a cooling and for a heating.
    farthest_deg : float
        Strokes that begin further from the others of their kind cross their levels under another stress: 1.6 °C and
        more with ``start_sigma_c_per_deg``. They are not comparable and are left out.
    scatter_reach, scatter_shape : float
        A stroke misses the curve of its kind as a whole, and by this much of that smoothly along its way, over this
        share of it.
    typical_scatter_c : float
        Scatter of thresholds from stroke to stroke: median of its prior.
    ordinary_scatter_c, with_rate : float
        A larger scatter than this has a cause that nobody knows. It may go with the rate of heating, as a friction does
        that grows with speed, and an offset does the same: then a scatter that goes with the rate is allowed, up to
        ``with_rate`` times as large as the rest of it.
    rate_noise : float
        Noise in the rates of a kind of stroke is taken to be so many times what the readings' own noise makes it: in a
        rate it would look like an error of the clock that differs from level to level, and hide the one that does not.
    stop_sigma_s : float
        How exactly the motion stops when the temperature stops rising.
    changepoint_per_lag : float
        A changepoint looks earlier by so much of what the sensor's lag is taken too large.
    stop_astray, stop_astray_s : float
        Share of the stops of short strokes that had another cause, and by how much those are off. Of the stops of full
        strokes, which may end at an end stop, half are taken to be.
    lag_is_roundness : float
        Weight of the roundness of the log's changepoints being the sensor's lag, which it is where the power is cut at
        once; the rest is spread evenly below.
    no_lag : float
        Weight of no lag at all where no changepoint can be read: enough that it lies within the 95 % interval.
    lag_model : float
        By how much of its lag a real sensor differs from a first-order one.
    led_jitter_s : float
        Error of a frame's and of a row's timestamp.
    led_repeats : float
        Switchings that meet the frames at one phase repeat one error: two count as one.
    led_astray : float
        Weight of a change of the LED that belongs to no switching.
    gap_by_led_sigma_s : float
        Error of a gap as pairing the LED on both sides of it gives it, before least squares: a row of a slow log.
    """

    drift_sigma_ppm: float = 100.0
    idle_heating_weight: float = 0.5
    no_segment_log: float = 8.0
    crossing_temper: float = 0.2
    curve_sigma_c: float = 60.0
    start_sigma_c_per_deg: float = 0.04
    far_scatter_c_per_deg: float = 0.003
    near_deg: float = 3.0
    near_scatter_c_per_deg: tuple[float, float] = (0.2, 0.03)
    farthest_deg: float = 40.0
    scatter_reach: float = 0.2
    scatter_shape: float = 0.7
    typical_scatter_c: float = 0.05
    ordinary_scatter_c: float = 0.03
    with_rate: float = 2.0
    rate_noise: float = 1.5
    stop_sigma_s: float = 0.05
    changepoint_per_lag: float = 0.6
    stop_astray: float = 0.05
    stop_astray_s: float = 3.0
    lag_is_roundness: float = 0.8
    no_lag: float = 0.15
    lag_model: float = 0.05
    led_jitter_s: float = 1e-3
    led_repeats: float = 2.0
    led_astray: float = 1e-3
    gap_by_led_sigma_s: float = 1.0


PRIORS: Final = Priors()
