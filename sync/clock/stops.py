"""Abrupt stops of the motion in the clock's likelihood: each pairs with the end of a rise of its heating."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import MOST_HYPOTHESES, NEGLIGIBLE_LOG, Gaussian, UnknownGap, conditioned
from sync.clock.lag_likelihood import LagMixture
from sync.log.outliers import noise_c, rounding_c
from sync.signals.changepoints import Changepoint, Stop, heating_end
from sync.signals.heating_segments import HeatingSegment
from sync.signals.strokes import Stroke
from torsight.core.records import TemperatureLog
from torsight.core.units import Floats


@dataclass(frozen=True, slots=True)
class Corner:
    """An instant of the log at which a temperature stops rising, and its variance."""

    log_s: float
    variance: float


@dataclass(frozen=True, slots=True)
class PairedStop:
    """A stop on the film, paired with the ends of the rises of the heating that drove the stroke.

    ``complete`` is the probability that the transformation was completed: the motion may then stop at any time of the
    heating, which lasts ``heated_s``.
    """

    film_s: float
    variance: float
    corners: tuple[Corner, ...]
    complete: float
    heated_s: float


def paired_stops(
    strokes: Sequence[Stroke],
    segments: Sequence[HeatingSegment | None],
    *,
    stop_of: Callable[[Stroke], Stop | None],
    corners_of: Callable[[HeatingSegment], tuple[Corner, ...]],
) -> list[PairedStop]:
    """Pair abrupt ends of motion with the ends of the rises that may have driven them.

    A heating that is held on its way rises several times, and a motion may stop at the end of each.
    """
    pairs: list[PairedStop] = []
    for stroke, segment in zip(strokes, segments, strict=True):
        if segment is None or not segment.heating:
            continue
        stop, corners = stop_of(stroke), corners_of(segment)
        if stop is not None and corners:
            variance, heated_s = stop.sigma_s**2 + PRIORS.stop_sigma_s**2, segment.end_s - segment.begin_s
            # A transformation that completes slows the motion down before.
            complete = PRIORS.stop_complete[int(stop.speed > PRIORS.stop_full_speed)]
            pairs.append(PairedStop(stop.time_s, variance, corners, complete, heated_s))
    return pairs


def rise_ends(
    log: TemperatureLog,
    changepoints: Sequence[tuple[HeatingSegment, Changepoint]],
    lag: LagMixture,
    segment: HeatingSegment,
) -> tuple[Corner, ...]:
    """Return the instants at which a heating's temperature stops rising, at holds and at its end."""
    temperature = log.temp_c(segment.spring)
    noise, rounding = noise_c(temperature), rounding_c(temperature)
    cooling = next(
        (c for f, c in changepoints if f.spring == segment.spring and abs(f.begin_s - segment.end_s) < 1.0), None
    )
    found = []
    for rise in segment.rises(log):
        changepoint = heating_end(
            log,
            rise,
            cooling if rise.end_s == segment.end_s else None,
            noise=noise,
            rounding=rounding,
            lag_s=lag.value_s,
            split=lag.split,
        )
        if changepoint is not None:
            # The larger the assumed lag, the earlier the changepoint's estimated time.
            lag_part = PRIORS.changepoint_per_lag * (lag.sigma_s or 0.0)
            found.append(Corner(changepoint.time_s, changepoint.time_sigma_s**2 + lag_part**2))
    return tuple(found)


def with_stops(
    mixture: Sequence[Gaussian],
    late_s: Floats,
    stops: Sequence[PairedStop],
    *,
    gaps: Sequence[UnknownGap],
    middle_s: float,
) -> list[Gaussian]:
    """Return the mixture conditioned on the stops, each of which may have another cause.

    Where two stops contradict each other, both hypotheses are kept with their weights. All stops of a component share
    a delay behind their temperatures of the size ``late_s`` (n,), which is integrated out, up to a part of their own.
    """
    unknowns = len(mixture[0].mean)
    mean = np.column_stack([np.stack([gaussian.mean for gaussian in mixture]), late_s])
    covariance = np.zeros((len(mixture), unknowns + 1, unknowns + 1))
    covariance[:, :unknowns, :unknowns] = [gaussian.covariance for gaussian in mixture]
    covariance[:, unknowns, unknowns] = late_s**2
    log_weight = np.array([gaussian.log_weight for gaussian in mixture])
    for stop in stops:
        cut_short = 1.0 - stop.complete
        found = [(mean, covariance, log_weight + np.log(stop.complete / stop.heated_s))]
        for corner in stop.corners:
            # Rows after a gap have timestamps that are too early by the missing time.
            after_gap = [-1.0 if corner.log_s > gap.after_s else 0.0 for gap in gaps]
            design = np.array([1.0, stop.film_s - middle_s, *after_gap, -1.0])
            own_variance = stop.variance + corner.variance + (PRIORS.delay_shape * late_s) ** 2
            for variance, share in (
                (own_variance, 1.0 - PRIORS.stop_astray),
                (own_variance + PRIORS.stop_astray_s**2, PRIORS.stop_astray),
            ):
                moved, smaller, fit = conditioned(
                    mean, covariance, design=design, value=corner.log_s - stop.film_s, variance=variance
                )
                found.append((moved, smaller, log_weight + fit + np.log(cut_short * share / len(stop.corners))))
        mean, covariance, log_weight = (np.concatenate(columns) for columns in zip(*found, strict=True))
        order = np.argsort(-log_weight)[: MOST_HYPOTHESES * len(mixture)]
        order = order[log_weight[order] > log_weight[order[0]] - NEGLIGIBLE_LOG]
        mean, covariance, log_weight = mean[order], covariance[order], log_weight[order]
        late_s = late_s[order % len(late_s)]
    return [
        Gaussian(mean[k, :unknowns], covariance[k, :unknowns, :unknowns], float(log_weight[k]))
        for k in range(len(log_weight))
    ]
