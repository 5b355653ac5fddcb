"""The inputs of the model: temperature log, clock map, and the table of angle and temperatures on one clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.frozen import Columns
from torsight.core.parameter import REACH
from torsight.core.units import DEG, PPM, Flags, Floats
from torsight.core.words.plausible import SPRING_C
from torsight.core.words.shown import Shown, draw_series, share, span

GIVEN_OFFSET: Final = "given offset"
"""Beginning of the ``method`` of a clock map whose offset was given, not estimated."""


def clock_sigma_s(method: str, interval_s: tuple[float, float]) -> float | None:
    """Return an offset's standard deviation from its method and its 95 % interval; None where it is not known.

    It is not known for a given offset, whose interval does not describe its error.
    """
    low, high = interval_s
    if method.startswith(GIVEN_OFFSET) or not math.isfinite(high - low):
        return None
    # An event's time in both recordings is known to a frame of the film, 0.03 s at 30 per second, and a row of the log.
    return max((high - low) / (2.0 * REACH), 0.05)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TemperatureLog(Columns, Shown):
    """Temperatures of both springs on the logging computer's clock.

    Attributes
    ----------
    time_s : (n,) float64
        Strictly increasing.
    temp_a_c, temp_b_c : (n,) float64
        Temperature of spring A and B, °C; NaN where not known.
    heat_a, heat_b : (n,) bool or None
        Heating switches, where the log has them.
    extra : mapping of str to (n,) array
        Further columns, kept under their own names.
    """

    time_s: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    heat_a: Flags | None = None
    heat_b: Flags | None = None
    extra: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        _require_increasing(self)
        for name, temp_c in (("temp_a_c", self.temp_a_c), ("temp_b_c", self.temp_b_c)):
            wrong = np.flatnonzero((temp_c < SPRING_C[0]) | (temp_c > SPRING_C[1]))
            if len(wrong):
                raise InputError(
                    "is no temperature of a spring in °C",
                    where=f"TemperatureLog, row {wrong[0]}, {name}",
                    value=f"{temp_c[wrong[0]]:g}",
                    limit=f"{SPRING_C[0]:g} to {SPRING_C[1]:g}",
                    do="give °C, and NaN where it is not known",
                )

    def __len__(self) -> int:
        return len(self.time_s)

    def facts(self) -> dict[str, str]:
        """Return rows, time and temperatures."""
        return {"rows": str(len(self)), "time": span(self.time_s, "s"), **_temperature_facts(self)}

    def temp_c(self, spring: str) -> Floats:
        """Return the temperature of spring ``"a"`` or ``"b"``."""
        return self.temp_a_c if spring == "a" else self.temp_b_c

    def _columns(self) -> dict[str, Any]:
        return {"time_s": self.time_s, **_temperature_columns(self)}

    def _draw(self, axes: Any) -> None:
        draw_series(axes, self.time_s, {"A": self.temp_a_c, "B": self.temp_b_c}, label="temperature, °C")


@dataclass(frozen=True, slots=True, repr=False)
class ClockMap(Shown):
    """Affine map between two clocks: temperature time = film time · (1 + drift) + offset.

    Attributes
    ----------
    offset_s, drift_ppm : float
        The map.
    offset_ci95_s, drift_ci95_ppm : (float, float)
        95 % intervals; infinite where nothing is known. The offset is that at film time 0.
    film_offset_ci95_s : (float, float) or None
        95 % interval of temperature time minus film time at the film's first frame: narrower where the film's clock
        begins far from 0, because the drift is uncertain from there to 0. None: as ``offset_ci95_s``.
    method : str
        The evidence for the map.
    notes : tuple of str
        Notes for the user (degeneracies, repairs).
    """

    offset_s: float
    drift_ppm: float
    offset_ci95_s: tuple[float, float]
    drift_ci95_ppm: tuple[float, float]
    method: str
    notes: tuple[str, ...] = ()
    film_offset_ci95_s: tuple[float, float] | None = None

    @property
    def within_s(self) -> tuple[float, float]:
        """95 % interval of the offset where the film begins."""
        return self.offset_ci95_s if self.film_offset_ci95_s is None else self.film_offset_ci95_s

    def to_temperature_time(self, film_time_s: Floats) -> Floats:
        """Return the temperature log's time for times on the film's clock, s."""
        return film_time_s * (1.0 + self.drift_ppm * PPM) + self.offset_s

    def to_film_time(self, temperature_time_s: Floats) -> Floats:
        """Return the film's time for times on the temperature log's clock, s."""
        return (temperature_time_s - self.offset_s) / (1.0 + self.drift_ppm * PPM)

    def facts(self) -> dict[str, str]:
        """Return offset and drift with their intervals, and the evidence."""
        (offset_low, offset_high), (drift_low, drift_high) = self.offset_ci95_s, self.drift_ci95_ppm
        return {
            "offset": f"{self.offset_s:.3f} s (95 %: {offset_low:.3f} to {offset_high:.3f})",
            "drift": f"{self.drift_ppm:.0f} ppm (95 %: {drift_low:.0f} to {drift_high:.0f})",
            "from": self.method,
        }

    def _columns(self) -> dict[str, Any]:
        lows, highs = zip(self.offset_ci95_s, self.drift_ci95_ppm, strict=True)
        return {
            "name": ["offset_s", "drift_ppm"],
            "value": [self.offset_s, self.drift_ppm],
            "low": list(lows),
            "high": list(highs),
        }

    def _draw(self, axes: Any) -> None:
        """Draw the lead of the log's clock during the first hour of a film, with the offset's interval."""
        film_s = np.linspace(0.0, 3600.0, 61)
        ahead_s = self.to_temperature_time(film_s) - film_s
        draw_series(axes, film_s, {"ahead": ahead_s}, label="temperature log's time minus film time, s")
        low, high = (bound - self.offset_s for bound in self.offset_ci95_s)
        if np.isfinite([low, high]).all():
            axes.fill_between(film_s, ahead_s + low, ahead_s + high, alpha=0.3)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SyncedTable(Columns, Shown):
    """Angle and temperatures on the film's clock, one row per valid or invalid frame.

    Attributes
    ----------
    time_s : (n,) float64
        Film clock, strictly increasing.
    angle_rad, angle_sigma_rad : (n,) float64
        Angle and its standard deviation; NaN where the angle is not known.
    temp_a_c, temp_b_c : (n,) float64
        Temperatures at these instants; NaN in gaps of the log that are too long to bridge.
    heat_a, heat_b : (n,) bool or None
        Heating switches, where the log has them.
    extra : mapping of str to (n,) array
        Further columns, kept under their own names.
    clock_sigma_s : float or None
        Standard deviation of the error of the offset between the clocks; None where it is not known.
    """

    time_s: Floats
    angle_rad: Floats
    angle_sigma_rad: Floats
    temp_a_c: Floats
    temp_b_c: Floats
    heat_a: Flags | None = None
    heat_b: Flags | None = None
    extra: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    clock_sigma_s: float | None = None

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        _require_increasing(self)
        for row in np.flatnonzero(self.angle_sigma_rad < 0.0)[:1]:
            raise InputError(
                "is no standard deviation",
                where=f"SyncedTable, row {row}, angle_sigma_rad",
                value=f"{self.angle_sigma_rad[row]:g}",
                limit="0 rad or more, or NaN",
                do="correct that row",
            )

    def __len__(self) -> int:
        return len(self.time_s)

    def facts(self) -> dict[str, str]:
        """Return rows, time, angle and temperatures."""
        return {
            "rows": str(len(self)),
            "time": span(self.time_s, "s"),
            "angle": f"{span(self.angle_rad / DEG, '°')} in {share(np.isfinite(self.angle_rad))} of the rows",
            **_temperature_facts(self),
        }

    def at(self, rows: Flags) -> SyncedTable:
        """Return the table restricted to the rows of a mask (n,)."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        kept: dict[str, Any] = {name: column[rows] for name, column in values.items() if isinstance(column, np.ndarray)}
        return replace(self, **kept, extra={name: column[rows] for name, column in self.extra.items()})

    def _columns(self) -> dict[str, Any]:
        return merged_columns(self)

    def _draw(self, axes: Any) -> None:
        """Draw the angle against time, and both temperatures on a second axis."""
        draw_series(axes, self.time_s, {"angle": self.angle_rad / DEG}, label="angle, °")
        beside = axes.twinx()
        for name, values, colour in (("A", self.temp_a_c, "tab:red"), ("B", self.temp_b_c, "tab:orange")):
            beside.plot(self.time_s, values, label=name, linewidth=0.8, color=colour)
        beside.set_ylabel("temperature, °C")
        beside.legend()


def _require_increasing(table: TemperatureLog | SyncedTable) -> None:
    """Refuse a table without rows, and times that are not finite or do not increase."""
    time_s = table.time_s
    if len(time_s) == 0:
        raise InputError("has no rows", where=type(table).__name__, limit="at least one", do="record it again")
    wrong = ~np.isfinite(time_s)
    wrong[1:] |= ~(time_s[1:] > time_s[:-1])
    for row in np.flatnonzero(wrong)[:1]:
        before = f" after {time_s[row - 1]:.15g}" if row else ""
        raise InputError(
            "time does not increase",
            where=f"{type(table).__name__}, row {row}, time_s",
            value=f"{time_s[row]:.15g}{before}",
            limit="a larger time than in the row before",
            do="sort the rows by time, and leave out those without a time or with the time of another row",
        )


def merged_columns(table: SyncedTable) -> dict[str, Any]:
    """Return the columns of ``merged.csv``."""
    return {
        "time_s": table.time_s,
        "angle_deg": table.angle_rad / DEG,
        "angle_sigma_deg": table.angle_sigma_rad / DEG,
        **_temperature_columns(table),
    }


def _temperature_facts(table: TemperatureLog | SyncedTable) -> dict[str, str]:
    return {"A": span(table.temp_a_c, "°C"), "B": span(table.temp_b_c, "°C")}


def _temperature_columns(table: TemperatureLog | SyncedTable) -> dict[str, Any]:
    heat = {"heat_a": table.heat_a, "heat_b": table.heat_b}
    known = {name: values for name, values in heat.items() if values is not None}
    return {"temp_a_c": table.temp_a_c, "temp_b_c": table.temp_b_c, **known, **table.extra}
