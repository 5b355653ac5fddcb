"""What goes into the model: temperature log, clock map, and angle and temperatures on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.units import PPM

if TYPE_CHECKING:
    from collections.abc import Mapping

SHARED_EVENT: Final = "shared event"
"""How the ``method`` of a clock map begins that rests on an event that both clocks saw."""


@dataclass(frozen=True, slots=True, eq=False)
class TemperatureLog:
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

    time_s: NDArray[np.float64]
    temp_a_c: NDArray[np.float64]
    temp_b_c: NDArray[np.float64]
    heat_a: NDArray[np.bool_] | None = None
    heat_b: NDArray[np.bool_] | None = None
    extra: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, slots=True)
class ClockMap:
    """Affine map between two clocks: temperature time = film time · (1 + drift) + offset.

    Attributes
    ----------
    offset_s, drift_ppm : float
        The map.
    offset_ci95_s, drift_ci95_ppm : (float, float)
        95 % intervals; infinite where nothing is known.
    method : str
        The evidence that the map rests on.
    notes : tuple of str
        What a person should know (degeneracies, repairs).
    """

    offset_s: float
    drift_ppm: float
    offset_ci95_s: tuple[float, float]
    drift_ci95_ppm: tuple[float, float]
    method: str
    notes: tuple[str, ...] = ()

    def to_temperature_time(self, film_time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the temperature log's time for times on the film's clock, s."""
        return film_time_s * (1.0 + self.drift_ppm * PPM) + self.offset_s

    def to_film_time(self, temperature_time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the film's time for times on the temperature log's clock, s."""
        return (temperature_time_s - self.offset_s) / (1.0 + self.drift_ppm * PPM)


@dataclass(frozen=True, slots=True, eq=False)
class SyncedTable:
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
    """

    time_s: NDArray[np.float64]
    angle_rad: NDArray[np.float64]
    angle_sigma_rad: NDArray[np.float64]
    temp_a_c: NDArray[np.float64]
    temp_b_c: NDArray[np.float64]
    heat_a: NDArray[np.bool_] | None = None
    heat_b: NDArray[np.bool_] | None = None
    extra: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_s)
