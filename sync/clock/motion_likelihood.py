"""All that motion and temperature say together about a clock: coarse range, thresholds, stops, roundness of corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sync.clock.gaussian_mixture import DRIFT_SIGMA_PPM, Belief
from sync.clock.offset_search import Plateau, assign, explained_share, find_plateaus
from sync.clock.sensor_lag import LagBelief, lag_belief, weighed
from sync.clock.threshold_crossings import Crossings, collect_crossings
from sync.clock.threshold_likelihood import refine, scan
from sync.clock.unknown_gaps import Jump
from sync.log.outliers import noise_c
from sync.merge.merged_table import longest_gap_s
from sync.signals.changepoints import MAX_LAG_S, SPLITS, Corner, cooling_corner, find_stop, heating_end
from sync.signals.heating_segments import Flank, LogPicture, lag_window_s, picture_log
from sync.signals.strokes import Stroke, find_strokes
from torsight.core.records import TemperatureLog
from torsight.core.tracks import StickAngles
from torsight.core.units import PPM

_SHORT_LAG_S: Final = 0.2
_PLATEAUS: Final = 12
_STARTS: Final = 4
_LEFT_OUT: Final = 8.0
"""Logarithm of how much less likely it is that a stroke has no flank at all."""
_TEMPER: Final = 0.2
"""Passings of one stroke are far from independent: their likelihoods count for less where answers are weighed."""
_STOP_SIGMA_S: Final = 0.05
_CORNER_PER_LAG: Final = 0.6
_STOP_ASTRAY_S: Final = 3.0
_STOP_ASTRAY_SHARE: Final = 0.05
_STOP_MEANS_NOTHING: Final = 1e-4
"""A stop that was given a heating of another cycle: a tenth of those astray, anywhere within some 1000 s."""
_STOP_ACCOUNTS: Final = 6
_UNLIKELY_STOPS: Final = 9.0
_SWAPPED: Final = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class MotionEvidence:
    """Belief about the clock from motion and temperature.

    Attributes
    ----------
    beliefs : tuple of Belief
        A mixture.
    middle_s : float
        Film time at which its offsets hold.
    lag : LagBelief
        What is known about the sensor's lag.
    strokes, matched, stops : int
        How many strokes the film has, how many have a flank, how many abrupt stops were paired with a corner.
    plateaus : tuple of Plateau
        Ranges that the coarse search left.
    swapped : bool
        Whether the motion fits better with the springs the other way round.
    """

    beliefs: tuple[Belief, ...]
    middle_s: float
    lag: LagBelief
    strokes: int
    matched: int
    stops: int
    plateaus: tuple[Plateau, ...]
    swapped: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    angles: StickAngles
    log: TemperatureLog
    strokes: tuple[Stroke, ...]
    picture: LogPicture
    corners: tuple[tuple[Flank, Corner], ...]
    lag: LagBelief
    jumps: tuple[Jump, ...]


def motion_evidence(
    angles: StickAngles, log: TemperatureLog, *, prior: Belief | None = None, jumps: Sequence[Jump] = ()
) -> MotionEvidence | None:
    """Weigh motion against temperature over the whole range of offsets.

    ``prior`` (offset at film time 0 and drift) narrows the range; ``jumps`` are joints of the log whose gap is not
    sure: they become further unknowns. ``None`` where nothing moves, nothing is
    heated, or no offset explains the motion.
    """
    strokes = find_strokes(angles)
    picture = picture_log(log, max_gap_s=longest_gap_s(log))
    if not strokes or not picture.flanks:
        return None
    lag = _lag(log, picture)
    corners = _corners(log, picture, lag.value_s, split=lag.split)
    if lag.value_s is not None and lag.value_s > _SHORT_LAG_S:
        window_s = lag_window_s(picture)
        picture = replace(
            picture_log(log, max_gap_s=longest_gap_s(log), slope_window_s=window_s), flanks=picture.flanks
        )
    picture = replace(picture, flanks=_sharpened(picture.flanks, corners))
    span = (float(angles.time_s[0]), float(angles.time_s[-1]))
    plateaus = find_plateaus(strokes, picture, film_span_s=span)
    if prior is not None:
        # The strokes are late by the sensor's lag, too: where they meet their heatings is further off than the offset.
        late_s = MAX_LAG_S if lag.sigma_s is None else 4.0 * lag.sigma_s
        reach = max(5.0 * float(np.sqrt(prior.covariance[0, 0])), 2.0) + late_s
        plateaus = tuple(
            replace(p, low_s=max(p.low_s, prior.mean[0] - reach), high_s=min(p.high_s, prior.mean[0] + reach))
            for p in plateaus
            if p.low_s <= prior.mean[0] + reach and p.high_s >= prior.mean[0] - reach
        )
    if not plateaus:
        return None
    scene = _Scene(angles, log, strokes, picture, corners, lag, tuple(jumps))
    found = [part for plateau in plateaus[:_PLATEAUS] if (part := _weigh(scene, plateau, prior)) is not None]
    if not found:
        return None
    best = max(found, key=lambda part: part.weight)
    # Offsets of all parts are told at one instant of the film.
    beliefs = [belief.moved(best.middle_s - part.middle_s) for part in found for belief in part.beliefs]
    mirrored = [replace(flank, spring="b" if flank.spring == "a" else "a") for flank in picture.flanks]
    offsets = np.arange(plateaus[0].low_s - 2000.0, plateaus[0].high_s + 2000.0, 5.0)
    swapped = float(explained_share(strokes, mirrored, offsets).max()) > plateaus[0].score + _SWAPPED
    return MotionEvidence(
        beliefs=tuple(beliefs),
        middle_s=best.middle_s,
        lag=scene.lag,
        strokes=len(strokes),
        matched=best.matched,
        stops=best.stops,
        plateaus=plateaus,
        swapped=swapped,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Weighed:
    beliefs: list[Belief]
    middle_s: float
    matched: int
    stops: int

    @property
    def weight(self) -> float:
        return max(belief.log_weight for belief in self.beliefs)


def _weigh(scene: _Scene, plateau: Plateau, prior: Belief | None) -> _Weighed | None:
    """Refine one range of offsets: thresholds first, then the lag's share of it, then the stops."""
    center_s = 0.5 * (plateau.low_s + plateau.high_s)
    flanks = assign(scene.strokes, scene.picture.flanks, center_s)
    matched = sum(flank is not None for flank in flanks)
    plateau = _possible(plateau, scene.strokes, flanks, slack_s=1.0 + (scene.lag.value_s or MAX_LAG_S))
    crossings = collect_crossings(scene.strokes, flanks)
    if crossings is None:
        return None
    wide = _before(scene, plateau, prior)
    # The thresholds see offset and lag as one delay; the stops see the offset alone.
    assumed_s = scene.lag.value_s or 0.0
    delays = _delays(scene, crossings, plateau, wide, lag_s=assumed_s)
    if not delays:
        return None
    lost = _LEFT_OUT * (len(scene.strokes) - matched)
    beliefs: list[Belief] = []
    paired = _paired_stops(scene, flanks)
    later = np.zeros(len(wide.mean))
    later[0] = 1.0
    for delay in delays:
        for lag_s, log_weight in zip(scene.lag.grid_s, scene.lag.log_weight, strict=True):
            belief = Belief(
                delay.mean - (lag_s - assumed_s) * later,
                delay.covariance,
                _TEMPER * delay.log_weight + float(log_weight) - lost,
            )
            if prior is not None:
                belief = _with_prior(belief, prior, crossings.middle_s)
            beliefs += _with_stops(belief, paired, scene.jumps, crossings.middle_s)
    return _Weighed(beliefs, crossings.middle_s, matched, len(paired))


def _possible(
    plateau: Plateau, strokes: Sequence[Stroke], flanks: Sequence[Flank | None], *, slack_s: float
) -> Plateau:
    """Narrow a range: no motion back before the power went off, none on after the temperature stopped rising."""
    pairs = [(stroke, flank) for stroke, flank in zip(strokes, flanks, strict=True) if flank is not None]
    low = max([flank.begin_s - stroke.begin_s - 0.5 for stroke, flank in pairs], default=plateau.low_s)
    high = min([flank.until_s - stroke.end_s for stroke, flank in pairs], default=plateau.high_s) + slack_s
    if high - low < 1.0:
        return plateau
    return replace(plateau, low_s=max(low, plateau.low_s), high_s=max(min(high, plateau.high_s), low + 0.5))


def _with_stops(belief: Belief, stops: Sequence[_PairedStop], jumps: Sequence[Jump], middle_s: float) -> list[Belief]:
    """Take the stops into account; any of them may have another cause.

    Where two contradict each other nothing tells which one is astray: both accounts are kept, by their weights.
    """
    accounts = [belief]
    for stop in stops:
        # Rows behind a jump stand earlier than they belong by what is missing there.
        behind = [-1.0 if stop.log_s > jump.after_s else 0.0 for jump in jumps]
        design = np.array([1.0, stop.film_s - middle_s, *behind])
        ways = ((stop.variance, 1.0 - stop.astray), (stop.variance + _STOP_ASTRAY_S**2, stop.astray))
        offset_s = stop.log_s - stop.film_s
        found = [
            _lighter(account.updated(design, offset_s, variance), share)
            for account in accounts
            for variance, share in ways
        ]
        found += [_lighter(account, stop.astray * _STOP_MEANS_NOTHING) for account in accounts]
        most = max(account.log_weight for account in found)
        found.sort(key=lambda account: -account.log_weight)
        accounts = [account for account in found[:_STOP_ACCOUNTS] if account.log_weight > most - _UNLIKELY_STOPS]
    return accounts


def _lighter(belief: Belief, share: float) -> Belief:
    return replace(belief, log_weight=belief.log_weight + float(np.log(share)))


def _before(scene: _Scene, plateau: Plateau, prior: Belief | None) -> Belief:
    """Return the belief about offset, drift and jumps before the strokes speak."""
    sigmas = [0.5 * (plateau.high_s - plateau.low_s) + 1.0, DRIFT_SIGMA_PPM * PPM, *(j.sigma_s for j in scene.jumps)]
    mean = np.zeros(len(sigmas))
    mean[0] = 0.5 * (plateau.low_s + plateau.high_s)
    if prior is not None:
        mean[1], sigmas[1] = prior.mean[1], np.sqrt(prior.covariance[1, 1])
    return Belief(mean, np.diag(np.square(sigmas)), 0.0)


def _with_prior(belief: Belief, prior: Belief, middle_s: float) -> Belief:
    """Take a given offset into account: it is that of film time 0, and no lag of the sensor moves it."""
    design = np.zeros(len(belief.mean))
    design[:2] = 1.0, -middle_s
    return belief.updated(design, float(prior.mean[0]), float(prior.covariance[0, 0]))


def _delays(scene: _Scene, crossings: Crossings, plateau: Plateau, wide: Belief, *, lag_s: float) -> list[Belief]:
    """Return the distinct local answers of the thresholds on a plateau, from a scan over it."""
    step_s = max(0.5, (plateau.high_s - plateau.low_s) / 100.0)
    offset_s = np.arange(plateau.low_s, plateau.high_s + step_s, step_s)
    evidence = scan(crossings, scene.picture, offset_s=offset_s, prior=wide, lag_s=lag_s, jumps=scene.jumps)
    if not np.isfinite(evidence).any():
        return []
    order = np.argsort(evidence)[::-1]
    starts: list[float] = []
    for index in order[: max(20, len(order) // 4)]:
        if all(abs(offset_s[index] - other) > 3.0 * step_s for other in starts) and len(starts) < _STARTS:
            starts.append(float(offset_s[index]))
    found: list[Belief] = []
    for start_s in starts:
        delay = refine(crossings, scene.picture, start_s=start_s, prior=wide, lag_s=lag_s, jumps=scene.jumps)
        if delay is None:
            continue
        sigma = float(np.sqrt(delay.covariance[0, 0]))
        same = [other for other in found if abs(other.mean[0] - delay.mean[0]) < max(0.3 * sigma, 0.02)]
        if not same:
            found.append(delay)
    return found


@dataclass(frozen=True, slots=True)
class _PairedStop:
    """A stop on the film and the end of the heating that drove it."""

    film_s: float
    log_s: float
    variance: float
    astray: float


def _paired_stops(scene: _Scene, flanks: Sequence[Flank | None]) -> list[_PairedStop]:
    """Pair abrupt ends of motion with the ends of the heatings that drove them."""
    pairs: list[_PairedStop] = []
    heated = [s.length_rad for s, f in zip(scene.strokes, flanks, strict=True) if f is not None and f.heating]
    for number, (stroke, flank) in enumerate(zip(scene.strokes, flanks, strict=True)):
        if flank is None or not flank.heating:
            continue
        stop = find_stop(scene.angles, stroke, number=number)
        if stop is None:
            continue
        cooling = next(
            (c for f, c in scene.corners if f.spring == flank.spring and abs(f.begin_s - flank.end_s) < 1.0), None
        )
        temperature = scene.log.temp_a_c if flank.spring == "a" else scene.log.temp_b_c
        corner = heating_end(
            scene.log, flank, cooling, noise=noise_c(temperature), lag_s=scene.lag.value_s, split=scene.lag.split
        )
        if corner is None:
            continue
        # A corner looks the earlier, the later the sensor is taken to be.
        lag_part = _CORNER_PER_LAG * (scene.lag.sigma_s or 0.0)
        variance = stop.time_sigma_s**2 + corner.time_sigma_s**2 + lag_part**2 + _STOP_SIGMA_S**2
        # A full stroke can end abruptly by itself, at an end stop; one that is shorter than others was cut short.
        whole = stroke.length_rad > 0.95 * max(heated)
        pairs.append(_PairedStop(stop.time_s, corner.time_s, variance, 0.5 if whole else _STOP_ASTRAY_SHARE))
    return pairs


def _lag(log: TemperatureLog, picture: LogPicture) -> LagBelief:
    """Read the sensor's lag from the corners; whether it has two stages is asked only where it shows at all."""
    simple = [corner for _, corner in _corners(log, picture, None)]
    lag = lag_belief(simple)
    if lag.value_s is None or lag.value_s < _SHORT_LAG_S:
        return lag
    further = {split: [corner for _, corner in _corners(log, picture, None, split=split)] for split in SPLITS[1:]}
    same = {split: corners for split, corners in further.items() if len(corners) == len(simple)}
    return weighed({SPLITS[0]: simple} | same)


def _corners(
    log: TemperatureLog, picture: LogPicture, lag_s: float | None, *, split: float = 0.0
) -> tuple[tuple[Flank, Corner], ...]:
    found: list[tuple[Flank, Corner]] = []
    noise = {"a": noise_c(log.temp_a_c), "b": noise_c(log.temp_b_c)}
    switches = {"a": _off_times(log.time_s, log.heat_a), "b": _off_times(log.time_s, log.heat_b)}
    for flank in picture.flanks:
        if flank.heating:
            continue
        corner = cooling_corner(
            log, flank, noise=noise[flank.spring], switch_s=switches[flank.spring], lag_s=lag_s, split=split
        )
        if corner is not None:
            found.append((flank, corner))
    return tuple(found)


def _sharpened(flanks: Sequence[Flank], corners: Sequence[tuple[Flank, Corner]]) -> tuple[Flank, ...]:
    """Let coolings begin where the power went off: nothing can move back before."""
    begin = {(flank.spring, flank.begin_s): corner.time_s for flank, corner in corners}
    return tuple(
        flank if flank.heating else replace(flank, begin_s=begin.get((flank.spring, flank.begin_s), flank.begin_s))
        for flank in flanks
    )


def _off_times(time_s: NDArray[np.float64], switch: NDArray[np.bool_] | None) -> NDArray[np.float64] | None:
    if switch is None:
        return None
    off = np.flatnonzero(switch[:-1] & ~switch[1:])
    return np.asarray(0.5 * (time_s[off] + time_s[off + 1]))
