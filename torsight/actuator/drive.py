"""A record prepared for the model: all preprocessing that does not depend on a parameter's value.

Temperatures are conditioned at their own rate, half-cycles are detected, and a fast record is thinned to a few rows per
second (angles averaged over each row's interval), which loses no information that a quasi-static model could use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from sync.log.outliers import spikes
from sync.log.timestamps import BRIDGED_S, longest_gap_s
from torsight.actuator.record.conditioning import Conditioned, Readings, conditioned
from torsight.actuator.record.segments import HalfCycles, begun_with_a_jump, by_role, half_cycles, turn_of
from torsight.actuator.record.sensors import Sensors
from torsight.actuator.record.slow_log import SLOW_S
from torsight.actuator.record.turns import at_places, turns_of
from torsight.core.errors import InputError
from torsight.core.records import SyncedTable, TemperatureLog
from torsight.core.series import APART, extent, pair_means, scatter, usual_step
from torsight.core.series.outliers import outliers
from torsight.core.units import DEG, Flags, Floats, Ints
from torsight.core.words.shown import span
from torsight.core.words.wording import RESOLUTION_DEG, counted, number

ROW_RATE_HZ: Final = 5.0
"""Rows per second to which a faster record is thinned for a fit, approximately."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Drive:
    """Conditioned temperatures, half-cycles, measured angle and start of one record.

    Attributes
    ----------
    time_s : (n,) float64
        Increasing.
    temp_a_c, temp_b_c : (n,) float64
        Conditioned temperatures at the sensors, finite. Where a temperature has ripple: its peaks, because the
        transformation follows them.
    peaks_a_c, peaks_b_c : (n,) float64
        Height of the ripple's peaks above the mean temperatures.
    rate_a_c_s, rate_b_c_s : (n,) float64
        Slopes of the temperatures.
    temp_sigma_c : (n,) float64
        Standard deviation of the noise that remains in the driven spring's temperature.
    noise_c : float
        Noise of the temperatures before conditioning.
    reading_s : float
        Seconds between readings of the temperatures whose noise is independent.
    cycles : HalfCycles
        Which spring is driven when.
    angle_rad, angle_sigma_rad : (n,) float64
        Measured angle minus the whole turns (NaN: no reading, or a wrong frame) and its standard deviation.
    start_angle_rad : float
        Angle at the first row, minus the whole turns.
    room_c : float
        Room temperature: the lowest to which the springs return.
    known : (n,) bool
        False in gaps of the temperature log that are too long to bridge.
    sensors : Sensors
        The temperatures as logged.
    turning : two (k,) int64
        Rows of the whole drive at which the temperatures of A and of B turn.
    turns : int
        Whole turns by which the reading is ahead of the actuator's own angle.
    clock_sigma_s : float or None
        Standard deviation of the record's clock offset; None for a log alone.
    wrong_angles, wrong_readings : int
        Numbers of measured angles and of temperature readings that are left out as wrong. Where rows hold several
        frames, an angle is that of a frame, or the mean of a row's.
    left_out_s : float or None
        Seconds cut off at the start of a record that begins within a transformation; None: the record does not.
    part_of : (Drive, (n,) float64) or None
        The whole drive and the indices of its rows that this drive holds; None where it holds all of them.
    """

    time_s: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    rate_a_c_s: Floats
    rate_b_c_s: Floats
    temp_sigma_c: Floats
    peaks_a_c: Floats
    peaks_b_c: Floats
    noise_c: float
    reading_s: float
    cycles: HalfCycles
    angle_rad: Floats
    angle_sigma_rad: Floats
    start_angle_rad: float
    room_c: float
    known: Flags
    sensors: Sensors
    turning: tuple[Ints, Ints]
    turns: int = 0
    clock_sigma_s: float | None = None
    wrong_angles: int = 0
    wrong_readings: int = 0
    left_out_s: float | None = None
    part_of: tuple[Drive, Floats] | None = None

    def __len__(self) -> int:
        return len(self.time_s)

    def __repr__(self) -> str:
        lasts_s = float(np.ptp(self.time_s)) if len(self) else 0.0
        return (
            f"Drive({counted(len(self), 'row')} over {number(lasts_s)} s, "
            f"{counted(len(self.cycles.springs), 'half-cycle')}, {span([self.temp_a_c, self.temp_b_c], '°C')})"
        )

    @property
    def measured(self) -> Flags:
        """Where (n,) the angle was read and the temperatures are known."""
        return np.isfinite(self.angle_rad) & self.known

    @property
    def readings_of_a_row(self) -> int:
        """Number of readings, centred on a row, over which the row's angle is averaged where none is missing."""
        rows = self.whole[0].sensors.rows
        return 2 * (int(rows[1] - rows[0]) // 2) + 1

    @property
    def whole(self) -> tuple[Drive, Floats]:
        """The whole drive, which effects on clocks read at other times, and the indices (n,) of this drive's rows."""
        return self.part_of or (self, np.arange(float(len(self))))

    def temps_by_role(self) -> tuple[Floats, Floats]:
        """Return the temperature (n,) of the driven spring of each row, and that of the other spring, °C."""
        return by_role(self.cycles.active, self.temp_a_c, self.temp_b_c)

    def rates_by_role(self) -> tuple[Floats, Floats]:
        """Return the slopes (n,) of these temperatures, °C/s."""
        return by_role(self.cycles.active, self.rate_a_c_s, self.rate_b_c_s)

    def half_cycles(self) -> Iterator[tuple[int, Ints, Floats, Floats]]:
        """Yield each half-cycle's driven spring and rows (k,), and the temperature and slope (k,) of this spring."""
        series = ((self.temp_a_c, self.rate_a_c_s), (self.temp_b_c, self.rate_b_c_s))
        for half, spring in enumerate(self.cycles.springs):
            rows = np.flatnonzero(self.cycles.half == half)
            temp_c, rate_c_s = series[spring]
            yield spring, rows, temp_c[rows], rate_c_s[rows]

    def at(self, rows: Ints) -> Drive:
        """Return the drive restricted to the given rows (m,)."""
        cycles = replace(self.cycles, active=self.cycles.active[rows], half=self.cycles.half[rows])
        names = ("time_s", "temp_a_c", "temp_b_c", "rate_a_c_s", "rate_b_c_s", "temp_sigma_c", "peaks_a_c",
                 "peaks_b_c", "angle_rad", "angle_sigma_rad", "known")  # fmt: skip
        rowwise = {name: getattr(self, name)[rows] for name in names}
        whole, places = self.whole
        return replace(self, cycles=cycles, part_of=(whole, places[rows]), **rowwise)

    def ahead(self, turns: int) -> Drive:
        """Return the whole drive whose readings are ahead of the actuator's angle by so many whole turns more."""
        ahead_rad = 2.0 * math.pi * turns
        angle_rad, start_rad = self.angle_rad - ahead_rad, self.start_angle_rad - ahead_rad
        return replace(self, angle_rad=angle_rad, start_angle_rad=start_rad, turns=self.turns + turns)


def whole_turns(angle_rad: Floats) -> int:
    """Return the number of whole turns by which the readings exceed the actuator's own angle.

    A film cannot tell a stick at 185° from one at −175°. The actuator's range lies around zero (the paper shifts its
    profile so that the middle is zero), so the middle of the range of the readings decides, as long as no model does.
    """
    return round(sum(extent(angle_rad)) / 2.0 / (2.0 * math.pi))


def prepare_table(table: SyncedTable, *, row_rate_hz: float = ROW_RATE_HZ, where: str = "record") -> Drive:
    """Return the drive of a merged record.

    Raises InputError when the record has fewer than 20 rows, no angle or no temperature; NoResultError when neither
    spring is heated.
    """
    if len(table) < 20:
        raise InputError("is too short", where=where, value=f"{len(table)} rows", limit="20 rows or more")
    if not np.isfinite(table.angle_rad).any():
        raise InputError("has no angle", where=f"{where}, column angle_deg", do="track the film again")
    sigma = table.angle_sigma_rad
    wrong = wrong_frames(table.time_s, table.angle_rad, sigma)
    angle, count = np.where(wrong, np.nan, table.angle_rad), np.count_nonzero(wrong)
    start = start_angle(angle, sigma)
    turns = whole_turns(angle)
    ahead_rad = 2.0 * math.pi * turns
    drive = _driven(table, table, row_rate_hz=row_rate_hz, start_angle_rad=start - ahead_rad, where=where)
    if len(drive) < len(table):
        rows = drive.sensors.rows
        angle, sigma = pair_means(table.time_s, angle, sigma, rows, np.full(len(rows), drive.readings_of_a_row // 2))
        # What is wrong for longer than three frames is an outlier among the rows.
        wrong = wrong_frames(drive.time_s, angle, sigma)
        angle, count = np.where(wrong, np.nan, angle), count + np.count_nonzero(wrong)
    angle = np.where(drive.known, angle - ahead_rad, np.nan)
    temps = (drive.temp_a_c, drive.temp_b_c)
    cycles = begun_with_a_jump(drive.cycles, drive.time_s, angle, temps)
    return replace(
        drive,
        angle_rad=angle,
        angle_sigma_rad=sigma,
        turns=turns,
        cycles=cycles,
        clock_sigma_s=table.clock_sigma_s,
        wrong_angles=int(count),
    )


def prepare_log(
    log: TemperatureLog, *, start_angle_rad: float, where: str = "log", readings: TemperatureLog | None = None
) -> Drive:
    """Return the drive of a temperature log alone, at every one of its instants.

    Where ``log`` has interpolated rows (:func:`filled_in`), ``readings`` is the log without these rows.

    Raises InputError, NoResultError as :func:`prepare_table`.
    """
    return _driven(log, readings or log, row_rate_hz=math.inf, start_angle_rad=start_angle_rad, where=where)


def filled_in(log: TemperatureLog) -> tuple[TemperatureLog, Ints]:
    """Return a log with linearly interpolated rows between readings that are far apart, and the readings' rows (n,).

    The model needs these rows to place the temperature's corners between two readings. With readings every 1.25 s they
    reduce the error on later records from 0.85 to 0.76°, every 2 s from 1.35 to 1.26°, every 3 s from 2.31 to 1.60°
    (benchmarks/actuator/slow_logs.py, tops held for up to 15 s). Rows beside a missing reading are NaN.
    """
    interval_s = usual_step(log.time_s)
    if interval_s <= SLOW_S:
        return log, np.arange(len(log))
    every = math.ceil(interval_s * ROW_RATE_HZ)
    rows = np.arange(len(log)) * every
    fine = np.arange(rows[-1] + 1)
    held = fine // every
    # Interpolation towards NaN gives NaN.
    time_s, a, b = (np.interp(fine, rows, column) for column in (log.time_s, log.temp_a_c, log.temp_b_c))
    heat_a, heat_b = (None if heat is None else heat[held] for heat in (log.heat_a, log.heat_b))
    return TemperatureLog(time_s, a, b, heat_a, heat_b), rows


def wrong_frames(time_s: Floats, angle_rad: Floats, sigma_rad: Floats) -> Flags:
    """Return the mask (n,) of rows whose angle belongs to no motion: another marker was taken, or a hand passed.

    Such an angle is further off its neighbours' line than ``APART`` times the row's own sigma and the angle's scatter,
    and than a difference that matters.
    """
    noise = np.fmax(sigma_rad, scatter(angle_rad[np.isfinite(angle_rad)]))
    return outliers(time_s, angle_rad, np.fmax(APART * noise, RESOLUTION_DEG * DEG))


def start_angle(angle_rad: Floats, sigma_rad: Floats) -> float:
    """Return the mean angle over the rest with which a record starts.

    The rest is extended block by block. It ends where more than a fifth of a block's angles lie further than five
    standard deviations from the median of the rest so far, or where the block's median differs from that median by more
    than the scatter of both medians explains.
    """
    valid = np.flatnonzero(np.isfinite(angle_rad))
    angle = angle_rad[valid]
    sigma = np.where(np.isfinite(sigma_rad[valid]), sigma_rad[valid], 0.0)
    spread = float(np.median(np.abs(np.diff(angle[:200])))) if len(angle) > 8 else 0.0
    # Differences below 1e-5 rad are rounding errors.
    band = 5.0 * max(float(np.median(sigma[:200])), spread, 1e-5)
    count = min(4, len(angle))
    while count < min(len(angle), 4000):
        step = angle[count : count + max(4, count // 2)]
        middle = float(np.median(angle[:count]))
        doubt = 0.25 * band * math.sqrt(1.0 / count + 1.0 / len(step))
        moved = abs(float(np.median(step)) - middle) > 0.25 * band + 3.0 * doubt
        if moved or np.mean(np.abs(step - middle) > band) > 0.2:
            break
        count += len(step)
    rest = angle[:count]
    middle = float(np.median(rest))
    inside = rest[np.abs(rest - middle) <= band]
    if not len(inside):
        # A record that starts in the middle of a motion has no rest to average over.
        inside = rest[:1]
    return float(np.mean(inside))


def _driven(
    log: SyncedTable | TemperatureLog,
    readings: SyncedTable | TemperatureLog,
    *,
    row_rate_hz: float,
    start_angle_rad: float,
    where: str,
) -> Drive:
    """Return the drive of a record's temperatures and heating switches, without an angle.

    ``log`` holds the rows; ``readings`` holds the log's own readings, the same object where no rows were interpolated.
    """
    time_s = log.time_s
    (filled_a, known_a, wrong_a), (filled_b, known_b, wrong_b) = _bridged(log, where=where)
    if readings is log:
        of_a, of_b = (Readings.of_rows(time_s, filled_c) for filled_c in (filled_a, filled_b))
    else:
        pair = _bridged(readings, where=where)
        of_a, of_b = (Readings.of(readings.time_s, filled_c, far_apart=True) for filled_c, _, _ in pair)
    a, b = conditioned(of_a, time_s, filled_a), conditioned(of_b, time_s, filled_b)
    noise = max(a.noise_c, b.noise_c)
    cycles = half_cycles(a.temp_c, b.temp_c, heat_a=log.heat_a, heat_b=log.heat_b, noise_c=noise, where=where)
    fastest_c_s = max(float(np.quantile(np.abs(item.rate_c_s), 0.99)) for item in (a, b))
    # In 99 % of the rows a temperature changes by less than 0.25 °C: a row's mean angle then lies within 0.1° of the
    # angle at its instant, unless motion starts or stops within the row.
    rows = _kept_rows(time_s, max(row_rate_hz, fastest_c_s / 0.25))
    nothing, least_c = np.full(len(rows), np.nan), turn_of(noise)
    at_a, at_b = (_at_rows(item, rows, least_c) for item in (a, b))
    sigma_c = by_role(cycles.active, a.sigma_c, b.sigma_c)[0][rows]
    return Drive(
        time_s=time_s[rows],
        temp_a_c=at_a.temp_c,
        temp_b_c=at_b.temp_c,
        rate_a_c_s=at_a.rate_c_s,
        rate_b_c_s=at_b.rate_c_s,
        temp_sigma_c=sigma_c,
        peaks_a_c=a.peaks_c[rows],
        peaks_b_c=b.peaks_c[rows],
        noise_c=noise,
        reading_s=max(a.reading_s, b.reading_s),
        cycles=replace(cycles, active=cycles.active[rows], half=cycles.half[rows]),
        angle_rad=nothing,
        angle_sigma_rad=nothing,
        start_angle_rad=start_angle_rad,
        room_c=min(float(np.quantile(item.temp_c, 0.02)) for item in (a, b)),
        known=(known_a & known_b)[rows],
        sensors=Sensors(
            time_s=time_s,
            readings=(of_a, of_b),
            rows=rows,
            driven_c=(at_a.sensor_c, at_b.sensor_c),
            sigma_c=sigma_c,
            least_turn_c=least_c,
            without_lag=(a.log_evidence, b.log_evidence),
        ),
        turning=(at_a.turning, at_b.turning),
        wrong_readings=wrong_a + wrong_b,
    )


class _AtRows(NamedTuple):
    """A temperature at the rows that a drive keeps: with the ripple's peaks, its slope, and without the peaks.

    ``turning`` holds the rows at which the temperature turns; its slope there is zero.
    """

    temp_c: Floats
    rate_c_s: Floats
    sensor_c: Floats
    turning: Ints


def _at_rows(log: Conditioned, rows: Ints, least_turn_c: float) -> _AtRows:
    places, driven_c = rows.astype(float), log.temp_c + log.peaks_c
    turns = turns_of(driven_c, least_turn_c)
    turning = np.searchsorted(rows, turns)
    turning = turning[turning < len(rows)]
    rate = log.rate_c_s[rows]
    rate[turning] = 0.0
    return _AtRows(at_places(driven_c, turns, places), rate, at_places(log.temp_c, turns, places), turning)


def _bridged(log: SyncedTable | TemperatureLog, *, where: str) -> list[tuple[Floats, Flags, int]]:
    """Return for A and B: temperature with gaps and spikes bridged by lines, where it is known, number of spikes.

    Only a reading whose neighbours are near enough for interpolation can be a spike: between readings that are further
    apart it may be the top of a heating.
    """
    time_s, found = log.time_s, []
    near = np.gradient(time_s) <= BRIDGED_S if len(time_s) > 1 else np.zeros(1, bool)
    for temp_c, column in ((log.temp_a_c, "temp_a_c"), (log.temp_b_c, "temp_b_c")):
        wrong = near & spikes(time_s, temp_c)
        good = np.isfinite(temp_c) & ~wrong
        known, filled = good, temp_c
        if not good.all():
            if good.sum() < 2:
                raise InputError("has no temperature", where=f"{where}, column {column}", do="check it in the log")
            filled = np.interp(time_s, time_s[good], temp_c[good])
            before = np.maximum.accumulate(np.where(good, time_s, -np.inf))
            after = np.minimum.accumulate(np.where(good, time_s, np.inf)[::-1])[::-1]
            known = good | (after - before <= longest_gap_s(time_s[good]))
        found.append((filled, known, int(np.count_nonzero(wrong))))
    return found


def _kept_rows(time_s: Floats, row_rate_hz: float) -> Ints:
    n = len(time_s)
    interval = usual_step(time_s)
    every = int(1.0 / (interval * row_rate_hz)) if interval > 0 else 1
    if every < 2:
        return np.arange(n)
    every += 1 - every % 2
    # Whole blocks only: a kept row represents the same number of samples on either side.
    return np.arange(every // 2, n - every // 2, every)
