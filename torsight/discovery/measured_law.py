"""A law that was measured without an assumed form: values over a driver, with their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import InputError
from torsight.core.files.storage import read_table
from torsight.core.units import Flags, Floats

_KEYS: Final = ("effect", "port", "driver", "spring", "unit", "share", "file")
"""Keys that an entry of ``laws`` must have."""

GIVES: Final = {
    "torque": "stray torque",
    "friction": "change of the friction torque",
    "reading": "error of the angle's reading",
    "temperature": "temperature of the wire less its sensor's",
    "winding": "change of a spring's torque",
    "phase": "change of the recoverable angle",
    "values": "change of a material value",
}
"""Quantity that a law at each port gives, in words."""
DRIVER_UNITS: Final = {
    "angle_deg": "°",
    "winding_deg": "°",
    "angle_rate_deg_s": "°/s",
    "temp_active_c": "°C",
    "temp_passive_c": "°C",
    "temp_rate_c_s": "°C/s",
    "time_s": "s",
    "dwell_s": "s",
}
"""Units of the drivers that have one."""
_CLOCK: Final = "lead of the temperature log's clock"
_MOVED: Final = "shift of the transformation temperatures"


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredLaw:
    """A measured law: a function of one driver that acts at one port of the model.

    Attributes
    ----------
    effect : str or None
        Id of the effect whose name the law carries; None for a law that no known effect explains.
    port : str
        Where the law acts: ``torque``, ``friction``, ``reading``, ``temperature``, ``winding``, ``phase`` or
        ``values``.
    driver : str
        Variable of the law: one of the drivers of ``discovery.json``, ``winding_deg`` or ``spring``.
    spring : str
        ``a``, ``b`` or ``both``.
    unit : str
        Unit of ``value`` and ``sigma``, for display.
    share : float
        Part of the plain model's residual that this law explains (0 to 1).
    driver_values : (n,) float64
        Values of the driver, rising, in the unit with which its name ends.
    value : (n,) float64
        Value of the law there; NaN where nothing is known.
    sigma : (n,) float64
        Standard deviation of ``value``.
    covered : (n,) bool
        Whether the record reached that value of the driver.
    sentence : str
        The law in one sentence.
    number : int
        Number among the laws with this port and this driver, from 1, strongest first.
    id : str
        Id of the law's family, as in ``alternatives``; empty in a file without it.
    way : str
        ``heating`` or ``cooling`` for a law of one of them, else empty.
    record : str
        Name of the record whose own a law of time is, where several were given; else empty.
    """

    effect: str | None
    port: str
    driver: str
    spring: str
    unit: str
    share: float
    driver_values: Floats
    value: Floats
    sigma: Floats
    covered: Flags
    sentence: str
    number: int = 1
    id: str = ""
    way: str = ""
    record: str = ""

    @property
    def csv_name(self) -> str:
        """Name of the file that holds the law's curve."""
        return f"law_{self.port}_{self.driver}{'' if self.number == 1 else f'_{self.number}'}.csv"

    @property
    def gives(self) -> str:
        """Quantity that the law gives, in a few words; for a model of one's own the law's name."""
        if self.way:
            return f"lead over the phase law on {self.way}"
        if self.beside_sensors:
            return _CLOCK if self.unit == "s" else _MOVED
        return GIVES.get(self.port, self.port)

    @property
    def beside_sensors(self) -> bool:
        """Whether the law acts on temperatures but is no sensor's error: a clock's, or a shift of a transformation."""
        return self.port == "temperature" and (self.unit == "s" or self.driver == "cycle")

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``laws`` in ``discovery.json``."""
        own = {name: getattr(self, name) for name in (*_KEYS, "way", "record", "sentence") if name != "file"}
        return {**own, "law": self.id, "file": self.csv_name}

    def table(self) -> dict[str, NDArray[np.generic]]:
        """Return the columns of the law's file."""
        return law_columns(self.driver_values, self.value, self.sigma, self.covered)


def law_columns(driver: Floats, value: Floats, sigma: Floats, covered: Flags) -> dict[str, NDArray[np.generic]]:
    """Return the columns of a law's file."""
    return {"driver": driver, "value": value, "sigma": sigma, "covered": covered.astype(np.int64)}


def read_laws(folder: Path, discovery: Mapping[str, Any]) -> tuple[MeasuredLaw, ...]:
    """Return the laws that a ``discovery.json`` names, with their curves from the files beside it.

    Raises InputError when an entry lacks a key, or its file is missing or damaged.
    """
    return numbered([_read_law(folder, entry) for entry in discovery.get("laws") or []])


def numbered(laws: Sequence[MeasuredLaw]) -> tuple[MeasuredLaw, ...]:
    """Return laws (strongest first) numbered among those that share a port and a driver."""
    places = [(law.port, law.driver) for law in laws]
    return tuple(replace(law, number=places[: i + 1].count(places[i])) for i, law in enumerate(laws))


def _read_law(folder: Path, entry: Mapping[str, Any]) -> MeasuredLaw:
    missing = [key for key in _KEYS if key not in entry]
    if missing:
        raise InputError(
            f"a law has no '{missing[0]}'",
            where=f"{folder / 'discovery.json'}, laws",
            do="write the file again with 'torsight discover'",
        )
    path = folder / Path(str(entry["file"])).name
    table = read_table(path, required=("driver", "value", "sigma", "covered"))
    driver_values, value, sigma, covered = (
        table[name].to_numpy(dtype=np.float64) for name in ("driver", "value", "sigma", "covered")
    )
    return MeasuredLaw(
        effect=None if entry["effect"] is None else str(entry["effect"]),
        port=str(entry["port"]),
        driver=str(entry["driver"]),
        spring=str(entry["spring"]),
        unit=str(entry["unit"]),
        share=float(entry["share"]),
        driver_values=driver_values,
        value=value,
        sigma=sigma,
        covered=covered > 0.5,
        sentence=str(entry.get("sentence") or ""),
        id=str(entry.get("law") or ""),
        way=str(entry.get("way") or ""),
        record=str(entry.get("record") or ""),
    )
