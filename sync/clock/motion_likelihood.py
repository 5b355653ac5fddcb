"""The likelihood of the clock from motion and temperature: offset search, thresholds, stops, lag."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from sync.clock.clock_priors import PRIORS
from sync.clock.gaussian_mixture import MOST_HYPOTHESES, NEGLIGIBLE_LOG, Gaussian, UnknownGap, mixed
from sync.clock.lag_likelihood import SHORT_LAG_S, LagMixture, lag_mixture, weighed_lags
from sync.clock.offset_search import ALIKE, Assignment, OffsetRange, assignments, explained_share, find_ranges
from sync.clock.stops import PairedStop, paired_stops, rise_ends, with_stops
from sync.clock.threshold_crossings import collect_crossings
from sync.clock.threshold_likelihood import Thresholds, log_weights, maxima
from sync.led import switchings_of
from sync.log.outliers import noise_c
from sync.log.timestamps import longest_gap_s
from sync.signals.changepoints import MAX_LAG_S, SPLITS, Changepoint, cooling_start, find_stop
from sync.signals.heating_segments import LATEST_S, HeatingSegment, LogSignals, log_signals
from sync.signals.strokes import Stroke, find_strokes
from torsight.core.parameter import REACH
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import PPM, Flags, Floats


@dataclass(frozen=True, slots=True, eq=False)
class MotionLikelihood:
    """The clock's distribution from motion and temperature: a mixture, and the film time at which its offsets hold.

    ``lag`` is the distribution of the sensor's lag. ``strokes``, ``matched`` and ``stops`` count the film's strokes,
    those with a segment, and the abrupt stops that are paired with a changepoint. ``ranges`` are the possible ranges of
    the offset; ``swapped`` is true where the motion fits better with the springs exchanged. ``scatter_c`` is the
    scatter of the temperatures at which strokes of one kind pass the same angle, ``late_s`` the mean size of the
    motion's delay behind the wire's temperature.
    """

    mixture: tuple[Gaussian, ...]
    middle_s: float
    lag: LagMixture
    strokes: int
    matched: int
    stops: int
    ranges: tuple[OffsetRange, ...]
    swapped: bool
    scatter_c: float
    late_s: float

    @property
    def weight(self) -> float:
        """Largest logarithm of a weight in the mixture."""
        return max(gaussian.log_weight for gaussian in self.mixture)

    def weighted(self, log_weight: float) -> MotionLikelihood:
        """Return the same distribution with another weight among others."""
        return replace(self, mixture=tuple(one.weighted(log_weight) for one in self.mixture))


@dataclass(frozen=True, slots=True, eq=False)
class _Inputs:
    angles: StickAngles
    log: TemperatureLog
    strokes: tuple[Stroke, ...]
    signals: LogSignals
    lag: LagMixture
    gaps: tuple[UnknownGap, ...]


def begin_s(time_s: Floats) -> float:
    """Return the time from which a record's clock (n,) counts in the likelihood: its first whole second.

    Seconds of the calendar have ten digits before the point, and their products too few behind it. Whole seconds are
    subtracted exactly.
    """
    return float(np.floor(time_s[0]))


def motion_likelihood(
    angles: StickAngles, log: TemperatureLog, *, prior: Gaussian | None, gaps: Sequence[UnknownGap]
) -> MotionLikelihood | None:
    """Return the likelihood of the clock from motion and temperature over all possible offsets.

    ``prior`` (offset where the film begins, and drift) narrows the range; ``gaps`` are joints of the log with an
    uncertain gap, which is a further unknown. None where nothing moves, nothing is heated, or no offset explains the
    motion.
    """
    film_s, log_s = begin_s(angles.time_s), begin_s(log.time_s)
    found = _from_start(
        replace(angles, time_s=angles.time_s - film_s),
        replace(log, time_s=log.time_s - log_s),
        prior=None if prior is None else _later(prior, film_s - log_s),
        gaps=[UnknownGap(gap.after_s - log_s, gap.begin_s - log_s, gap.sigma_s) for gap in gaps],
    )
    if found is None:
        return None
    later_s = log_s - film_s
    return replace(
        found,
        mixture=tuple(_later(gaussian, later_s) for gaussian in found.mixture),
        middle_s=found.middle_s + film_s,
        ranges=tuple(replace(one, low_s=one.low_s + later_s, high_s=one.high_s + later_s) for one in found.ranges),
    )


def _later(gaussian: Gaussian, later_s: float) -> Gaussian:
    """Return the Gaussian with a larger offset."""
    mean = gaussian.mean.copy()
    mean[0] += later_s
    return Gaussian(mean, gaussian.covariance, gaussian.log_weight)


def _from_start(
    angles: StickAngles, log: TemperatureLog, *, prior: Gaussian | None, gaps: Sequence[UnknownGap]
) -> MotionLikelihood | None:
    """Return the likelihood of the clock; both clocks count from about the beginning of their records."""
    strokes = find_strokes(angles)
    signals = log_signals(log, max_gap_s=longest_gap_s(log.time_s))
    if not strokes or not signals.segments:
        return None
    lag = _lag(log, signals)
    changepoints = _changepoints(log, signals, lag.value_s, split=lag.split)
    signals = replace(signals, segments=_begun_at_power_off(signals.segments, changepoints))
    ranges = find_ranges(strokes, signals)
    if prior is not None:
        # The sensor's lag shifts strokes against their heatings, so that the range extends beyond the offset's prior.
        late_s = MAX_LAG_S if lag.sigma_s is None else 4.0 * lag.sigma_s
        reach = max(5.0 * float(np.sqrt(prior.covariance[0, 0])), 2.0) + late_s
        ranges = tuple(
            replace(p, low_s=max(p.low_s, prior.mean[0] - reach), high_s=min(p.high_s, prior.mean[0] + reach))
            for p in ranges
            if p.low_s <= prior.mean[0] + reach and p.high_s >= prior.mean[0] - reach
        )
    if not ranges:
        return None
    # Pieces of the range share their strokes and segments, and a stop takes a hundred fits.
    stop = functools.cache(functools.partial(find_stop, angles))
    corners = functools.cache(functools.partial(rise_ends, log, changepoints, lag))
    inputs = _Inputs(angles, log, strokes, signals, lag, tuple(gaps))
    # Strokes have other segments at other offsets: each piece of a range has its own crossings.
    pieces = [piece for one in ranges[:MOST_HYPOTHESES] for piece in assignments(strokes, signals.segments, one)]
    least = min(piece.lost for piece in pieces)
    likely = sorted(pieces, key=lambda piece: piece.lost)[:MOST_HYPOTHESES]
    likely = [piece for piece in likely if piece.lost < least + NEGLIGIBLE_LOG]
    stops = [paired_stops(strokes, piece.segments, stop_of=stop, corners_of=corners) for piece in likely]
    # Every piece accounts for the stops of all: one that it does not pair may have been at any instant of the film.
    every, any_log = {stop.film_s for one in stops for stop in one}, -float(np.log(np.ptp(angles.time_s)))
    weighed = ((_weigh(inputs, piece, own, prior), len(own)) for piece, own in zip(likely, stops, strict=True))
    found = [part.weighted((len(every) - paired) * any_log) for part, paired in weighed if part is not None]
    if not found:
        return None
    found = [replace(part, mixture=_as_covered(part.mixture, angles.time_s, log.time_s)) for part in found]
    best = max(found, key=lambda part: part.weight)
    # Offsets of all parts refer to one instant of the film.
    mixture = [gaussian.moved(best.middle_s - part.middle_s) for part in found for gaussian in part.mixture]
    mirrored = [replace(segment, spring="b" if segment.spring == "a" else "a") for segment in signals.segments]
    # With the springs exchanged a motion fits at another half-cycle, which may be half an hour away.
    offsets = np.arange(ranges[0].low_s - 2000.0, ranges[0].high_s + 2000.0, 5.0)
    swapped = float(explained_share(strokes, mirrored, offsets).max()) > ranges[0].score + ALIKE
    return replace(best, mixture=tuple(mixture), ranges=ranges, swapped=swapped)


def _as_covered(mixture: Sequence[Gaussian], film_s: Floats, log_s: Floats) -> tuple[Gaussian, ...]:
    """Return a mixture, weighed by the share of the film (n,) that lies outside the log (m,) at its offsets."""
    offset_s = np.array([gaussian.mean[0] for gaussian in mixture])
    inside_s = np.minimum(film_s[-1] + offset_s, log_s[-1]) - np.maximum(film_s[0] + offset_s, log_s[0])
    outside = 1.0 - np.maximum(inside_s, 0.0) / np.ptp(film_s)
    lost = (PRIORS.uncovered_log * outside).tolist()
    return tuple(one.weighted(-log_weight) for one, log_weight in zip(mixture, lost, strict=True))


def _weigh(
    inputs: _Inputs, piece: Assignment, paired: Sequence[PairedStop], prior: Gaussian | None
) -> MotionLikelihood | None:
    """Return the likelihood in one range of offsets: by the thresholds, for every possible lag, then by the stops."""
    segments = piece.segments
    latest_s = LATEST_S + (inputs.lag.value_s or MAX_LAG_S)
    offset_range = _possible(piece.where, inputs.strokes, segments, latest_s=latest_s)
    crossings = collect_crossings(inputs.strokes, segments)
    if crossings is None:
        return None
    wide = _before(inputs, offset_range, prior)
    # Thresholds determine the sum of offset and lag, a delay; stops determine the offset alone.
    assumed_s = inputs.lag.value_s or 0.0
    thresholds = Thresholds(crossings, inputs.signals, inputs.gaps, assumed_s, wide)
    delays = _delays(thresholds, offset_range)
    if not delays:
        return None
    mixture: list[Gaussian] = []
    late: list[float] = []
    later = np.zeros(len(wide.mean))
    later[0] = 1.0
    totals = [mixed(parts.values()) for parts in delays]
    sizes = [(*item, total) for parts, total in zip(delays, totals, strict=True) for item in parts.items()]
    for late_s, part, total in sizes:
        # Only the weights between maxima are tempered: the sizes of delay of one maximum share its crossings.
        own = PRIORS.crossing_temper * total.log_weight + part.log_weight - total.log_weight
        for lag_s, log_weight in zip(inputs.lag.grid_s, inputs.lag.log_weight, strict=True):
            gaussian = Gaussian(
                part.mean - (lag_s - assumed_s) * later, part.covariance, own + float(log_weight) - piece.lost
            )
            mixture.append(gaussian if prior is None else _with_prior(gaussian, prior, crossings.middle_s))
            late.append(late_s)
    mixture = with_stops(mixture, np.array(late), paired, gaps=inputs.gaps, middle_s=crossings.middle_s)
    likeliest = int(np.argmax([total.log_weight for total in totals]))
    late_weight = softmax([part.log_weight for part in delays[likeliest].values()])
    return MotionLikelihood(
        mixture=tuple(mixture),
        middle_s=crossings.middle_s,
        lag=inputs.lag,
        strokes=len(inputs.strokes),
        matched=piece.driven.count(True),
        stops=len(paired),
        ranges=(piece.where,),
        swapped=False,
        scatter_c=thresholds.scatter_c(totals[likeliest]),
        late_s=float(late_weight @ list(delays[likeliest])),
    )


def _possible(
    offset_range: OffsetRange, strokes: Sequence[Stroke], segments: Sequence[HeatingSegment | None], *, latest_s: float
) -> OffsetRange:
    """Narrow a range: return motions begin after the power is cut, motions end soon after the temperature stops rising.

    A motion that is late behind its temperature, as read by a late sensor, ends at most ``latest_s`` after it.
    """
    pairs = [(stroke, segment) for stroke, segment in zip(strokes, segments, strict=True) if segment is not None]
    low = max([segment.begin_s - stroke.begin_s - 0.5 for stroke, segment in pairs], default=offset_range.low_s)
    high = min([segment.until_s - stroke.end_s for stroke, segment in pairs], default=offset_range.high_s) + latest_s
    if high - low < 1.0:
        return offset_range
    low = max(low, offset_range.low_s)
    return replace(offset_range, low_s=low, high_s=max(min(high, offset_range.high_s), low + 0.5))


def _before(inputs: _Inputs, offset_range: OffsetRange, prior: Gaussian | None) -> Gaussian:
    """Return the prior of offset, drift and gaps in one range of offsets."""
    sigmas = [
        0.5 * (offset_range.high_s - offset_range.low_s) + 1.0,
        PRIORS.drift_sigma_ppm * PPM,
        *(j.sigma_s for j in inputs.gaps),
    ]
    mean = np.zeros(len(sigmas))
    mean[0] = 0.5 * (offset_range.low_s + offset_range.high_s)
    if prior is not None:
        mean[1], sigmas[1] = prior.mean[1], np.sqrt(prior.covariance[1, 1])
    return Gaussian(mean, np.diag(np.square(sigmas)), 0.0)


def _with_prior(gaussian: Gaussian, prior: Gaussian, middle_s: float) -> Gaussian:
    """Return the Gaussian conditioned on an offset that was given where the film begins, without the sensor's lag."""
    design = np.zeros(len(gaussian.mean))
    design[:2] = 1.0, -middle_s
    return gaussian.updated(design, float(prior.mean[0]), float(prior.covariance[0, 0]))


def _delays(thresholds: Thresholds, offset_range: OffsetRange) -> list[dict[float, Gaussian]]:
    """Return the distinct maxima of the thresholds' likelihood in a range of offsets, from a scan over it."""
    step_s = max(0.5, (offset_range.high_s - offset_range.low_s) / 100.0)
    offset_s = np.arange(offset_range.low_s, offset_range.high_s + step_s, step_s)
    log_likelihood = log_weights(thresholds.scan(offset_s))
    found: list[dict[float, Gaussian]] = []
    totals: list[Gaussian] = []
    for first, last in maxima(log_likelihood)[:MOST_HYPOTHESES]:
        top = first + int(np.argmax(log_likelihood[first : last + 1]))
        parts = thresholds.refine(start_s=float(offset_s[top]), limit_s=min(5.0, 3.0 * step_s))
        if not _is_maximum(parts, offset_range, log_likelihood[top]):
            parts = thresholds.around_maximum(float(offset_s[first] - step_s), float(offset_s[last] + step_s))
        if not parts:
            continue
        total = mixed(parts.values())
        sigma = float(np.sqrt(total.covariance[0, 0]))
        if all(abs(other.mean[0] - total.mean[0]) >= max(0.3 * sigma, 0.02) for other in totals):
            found.append(parts)
            totals.append(total)
    return found


def _is_maximum(parts: Mapping[float, Gaussian], offset_range: OffsetRange, start_log: float) -> bool:
    """Return whether linearised temperatures led to a maximum, and not past their corners to where little fits.

    With an unknown gap of the log the range holds for the rows before it only.
    """
    if not parts:
        return False
    total = mixed(parts.values())
    reach_s = REACH * float(np.sqrt(total.covariance[0, 0]))
    possible = offset_range.low_s - reach_s <= total.mean[0] <= offset_range.high_s + reach_s
    return bool((possible or len(total.mean) > 2) and total.log_weight >= start_log - NEGLIGIBLE_LOG)


def _lag(log: TemperatureLog, signals: LogSignals) -> LagMixture:
    """Return the sensor's lag from the changepoints; a second stage is fitted only where a lag is measurable."""
    simple = [changepoint for _, changepoint in _changepoints(log, signals, None)]
    lag = lag_mixture(simple)
    if lag.value_s is None or lag.value_s < SHORT_LAG_S:
        return lag
    further = {
        split: [changepoint for _, changepoint in _changepoints(log, signals, None, split=split)]
        for split in SPLITS[1:]
    }
    same = {split: changepoints for split, changepoints in further.items() if len(changepoints) == len(simple)}
    return weighed_lags({SPLITS[0]: simple} | same)


def _changepoints(
    log: TemperatureLog, signals: LogSignals, lag_s: float | None, *, split: float = 0.0
) -> tuple[tuple[HeatingSegment, Changepoint], ...]:
    found: list[tuple[HeatingSegment, Changepoint]] = []
    noise = {"a": noise_c(log.temp_a_c), "b": noise_c(log.temp_b_c)}
    switches = {"a": _off_times(log.time_s, log.heat_a), "b": _off_times(log.time_s, log.heat_b)}
    for segment in signals.segments:
        if segment.heating:
            continue
        changepoint = cooling_start(
            log, segment, noise=noise[segment.spring], switch_s=switches[segment.spring], lag_s=lag_s, split=split
        )
        if changepoint is not None:
            found.append((segment, changepoint))
    return tuple(found)


def _begun_at_power_off(
    segments: Sequence[HeatingSegment], changepoints: Sequence[tuple[HeatingSegment, Changepoint]]
) -> tuple[HeatingSegment, ...]:
    """Return the segments with coolings that begin when the power is cut: no return motion begins earlier."""
    begin = {(segment.spring, segment.begin_s): changepoint.time_s for segment, changepoint in changepoints}
    return tuple(
        segment
        if segment.heating
        else replace(segment, begin_s=begin.get((segment.spring, segment.begin_s), segment.begin_s))
        for segment in segments
    )


def _off_times(time_s: Floats, switch: Flags | None) -> Floats | None:
    if switch is None:
        return None
    switchings = switchings_of(time_s, switch)
    return switchings.time_s[~switchings.goes_on]
