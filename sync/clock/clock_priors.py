"""Prior assumptions on clocks, thresholds, stops, sensors and LEDs.

They are in one record, so that ``benchmarks/sync/prior_sensitivity.py`` can estimate the clock of pairs with a known
clock with half and with twice of each value. On four such pairs (``--seeds 4``) no value moved the offset by more than
0.24 of its standard deviation in the median and 0.5 at most; the intervals' widths changed by factors of 0.85 to 1.22,
and contained the truth as before. The weights of strokes, stops and changes of the LED without a partner have no effect
there: they are for logs that lack a part of the film, for stairs of a programme and for short strokes. Two assumptions
matter when removed entirely: without ``rate_noise`` the offsets of eleven pairs of ``clock_coverage.py`` move by up to
1.8 standard deviations, and without lags in two stages one of five pairs leaves its interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Priors:
    """Widths and shares; units at the end of each name, shares and weights plain."""

    drift_sigma_ppm: float = 100.0
    """Quartz clocks of computers: 95 % within ±200 ppm of each other."""
    no_segment_log: float = 8.0
    """Decrease of the log-likelihood by a stroke without any heating or cooling: e⁻⁸ is one of 3000."""
    uncovered_log: float = 5.0
    """Decrease of the log-likelihood per share of the film's time outside the log: films and logs are recorded for each
    other, so that this share has an exponential prior with a mean of one fifth."""
    crossing_temper: float = 0.2
    """Power of the thresholds' likelihood in the weights of the answers: the ten crossings of a stroke share one
    scatter and count as two."""
    curve_sigma_c: float = 60.0
    """Prior width of the threshold temperatures of a kind of stroke: wider than any heating, because they are
    unknown."""
    start_sigma_c_per_deg: float = 0.04
    """Dependence of a threshold on the start angle of its stroke, through the stress: E_M · d / (2 L_s) / C_M per
    radian, which for the reference rig is 20 GPa · 0.0039 / (32 MPa/K) · π/180 = 0.04 °C per degree."""
    far_scatter_c_per_deg: float = 0.003
    """Scatter of the thresholds of strokes that begin far from the others."""
    near_deg: float = 3.0
    """Distance from the usual start up to which the scatter of strokes depends on the actuator's motion before: on the
    extent of the heating."""
    near_scatter_c_per_deg: tuple[float, float] = (0.2, 0.03)
    """Scatter of the thresholds of such strokes, for a cooling and for a heating."""
    short_cooling_c: float = 10.0
    """Range of temperatures over which a cooling moves the disk. A cooling that moves it by a share less than the
    longest of its kind deviates at its end by that share of this range, and before in proportion to its progress."""
    farthest_deg: float = 40.0
    """Largest distance of a stroke's start from the others of its kind. Strokes that begin further away cross their
    levels under another stress (1.6 °C and more with ``start_sigma_c_per_deg``): they are not comparable and are left
    out."""
    scatter_reach: float = 0.2
    scatter_shape: float = 0.7
    """A stroke deviates from the curve of its kind by a constant, and by a smooth function along the stroke of the
    relative size ``scatter_shape`` and the correlation length ``scatter_reach``, a share of the stroke."""
    typical_scatter_c: float = 0.05
    """Scatter of thresholds from stroke to stroke: median of its prior."""
    typical_delay_s: float = 0.02
    """Size of the delay of the motion behind the temperature, beside the sensor's lag: median of its prior, which falls
    as slowly as one over the size. A plain rig has none. Half and twice this value move the offsets of four pairs of
    ``clock_coverage.py`` (slow and fast, seeds 0 and 1) by 0.14 of their standard deviations at most, and change the
    widths of the intervals by factors of 0.94 to 1.13."""
    delay_shape: float = 0.3
    """Variation of the delay along a stroke, and between the stops of strokes, relative to the delay. With viscous
    friction in the synthetic rig (``clock_coverage.py --kind viscous_friction``, seeds 1 and 6) the linear and the
    quadratic part of the delay are 0.15 to 0.4 of its mean."""
    delay_of_rate: tuple[float, float] = (0.5, 0.3)
    """Variation of the delay with the logarithm of the temperature's rate and with its square, relative to the delay.
    Where friction grows with the power p of the speed, the delay is proportional to the rate to the power p − 1, with
    slope p − 1 and curvature (p − 1)²/2: of Coulomb friction (p = 0) 1 and 0.5, of viscous friction (p = 1) none, in
    the middle 0.5; of curvatures the root mean square over p is 0.22, and 0.3 leaves room for other laws."""
    rate_noise: float = 1.5
    """Factor on the noise of rates within a kind of stroke, relative to that from the readings' noise. Noise of a rate
    would look like an error of the clock that differs from level to level, and hide the common one."""
    stop_sigma_s: float = 0.05
    """Standard deviation of the time between the end of the temperature's rise and the stop of the motion."""
    changepoint_per_lag: float = 0.6
    """Shift of a changepoint to earlier times per overestimation of the sensor's lag."""
    stop_complete: tuple[float, float] = (0.5, 0.1)
    stop_full_speed: float = 0.8
    """Share of the abrupt stops by a complete transformation, or an end stop, which come at any time of the heating:
    for motions that are slower before the stop than this share of their mean speed, and for others."""
    stop_astray: float = 0.05
    stop_astray_s: float = 3.0
    """Share of the other stops that come earlier or later than the rise ends, and the standard deviation of that."""
    lag_is_roundness: float = 0.8
    """Probability that the roundness of the log's changepoints is the sensor's lag, as it is where the power is cut
    abruptly; the rest is spread evenly over smaller lags."""
    no_lag: float = 0.15
    """Probability of zero lag without any measurable changepoint: large enough for the 95 % interval to contain it."""
    lag_model: float = 0.05
    """Relative deviation of a real sensor's lag from a first-order one."""
    led_jitter_s: float = 1e-3
    """Error of the timestamps of a frame and of a row."""
    led_repeats: float = 2.0
    """Switchings at the same phase of the frames repeat one error: as many as this count as one."""
    led_astray: float = 1e-3
    """Weight of a change of the LED that belongs to no switching."""
    gap_by_led_sigma_s: float = 1.0
    """Error of a gap from pairing the LED on both sides of it, before least squares: a row of a slow log."""


PRIORS: Final = Priors()
