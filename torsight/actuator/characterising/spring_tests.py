"""The four tests of one spring as files: ``TESTS.toml`` and its logs.

::

    [spring]                      # geometry of the spring that is tested, and the lever of the load cell
    wire_diameter_mm = 0.5
    wire_length_mm = 64.1         # or mean_diameter_mm with active_coils
    lever_mm = 26.4

    [[free_recovery]]             # step 1: temp_c, angle_deg while it is heated without load
    file = "recovery_118.csv"
    pre_deformation_deg = -118.0

    [[force_angle]]               # step 2: angle_deg, force_n at room temperature
    file = "force_small.csv"
    range = "small"               # "small": before the critical angle; "large": beyond it
    from_deg = -60.0              # part of the angles for the line; optional
    to_deg = 0.0

    [block]                       # steps 3 and 4: temp_c, force_n while it is heated and cools, blocked
    file = "block.csv"
    pre_deformation_deg = -85.0

    [assembly]                    # values that no test of a spring determines; for actuator.toml
    theta_p_deg = 1080.0
    [friction]
    tau_c_mnm = 0.8

Paths are relative to the TOML file. Angles and pre-deformations may have either sign: their magnitudes count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from torsight.actuator.spec import KEYS, keys_of, wire_keys
from torsight.actuator.springs import strain_per_angle, stress_per_torque, wire_length_mm
from torsight.core.errors import ConfigError, InputError
from torsight.core.files.config import get_number, get_table, get_tables, get_text
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_table, read_toml
from torsight.core.frozen import Frozen
from torsight.core.series import block_means
from torsight.core.units import DEG, GPA, MM, Flags, Floats

LARGE_RANGE_DEG: Final = (300.0, 400.0)
"""Part of the large range that the paper fits: such a log begins with the slope of E_M, and may end with stiffening."""
_RANGES: Final = {
    "temp_c": (-275.0, 225.0, "give temperatures in °C, not in kelvin"),
    "angle_deg": (-1e5, 1e5, "give angles in degrees"),
    "force_n": (-1e5, 1e5, "give forces in newtons"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Recovery:
    """Free recovery: temperatures (°C), magnitudes of the angle (°) and of the pre-deformation (°)."""

    temp_c: Floats
    angle_deg: Floats
    pre_deformation_deg: float
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class ForceAngle:
    """Force against the magnitude of the angle at room temperature; the fit's range is ``low_deg`` to ``high_deg``."""

    angle_deg: Floats
    force_n: Floats
    large: bool
    low_deg: float
    high_deg: float
    source: str

    @property
    def inside(self) -> Flags:
        """The mask of the rows to which the line is fitted."""
        return (self.angle_deg >= self.low_deg) & (self.angle_deg <= self.high_deg)


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Block test: temperatures and forces, heating and cooling in one log."""

    temp_c: Floats
    force_n: Floats
    pre_deformation_deg: float
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class SpringTests(Frozen):
    """All four tests, the spring's geometry, and the values for ``actuator.toml`` that no test determines."""

    geometry: Mapping[str, float]
    lever_m: float
    recoveries: tuple[Recovery, ...]
    forces: tuple[ForceAngle, ...]
    block: Block
    assembly: Mapping[str, float]
    friction: Mapping[str, float]

    @property
    def sources(self) -> tuple[str, ...]:
        """The logs that the tests were read from."""
        recoveries, forces = (item.source for item in self.recoveries), (item.source for item in self.forces)
        return (*recoveries, *forces, self.block.source)

    @property
    def stress_per_force(self) -> float:
        """Stress per force on the lever, Pa/N."""
        return stress_per_torque(self.geometry["wire_diameter_mm"] * MM) * self.lever_m

    @property
    def force_per_deg_gpa(self) -> float:
        """Force on the lever per degree of winding and GPa of modulus, N."""
        strain = strain_per_angle(self.geometry["wire_diameter_mm"] * MM, wire_length_mm(self.geometry) * MM)
        return strain * DEG * GPA / self.stress_per_force


def read_tests(path: AnyPath) -> SpringTests:
    """Read ``TESTS.toml`` and its logs.

    Raises
    ------
    ConfigError
        For an unknown or missing key or table, or a value out of range.
    InputError
        When a log is missing, lacks a column, or has too few rows.
    """
    path = Path(path)
    content = read_toml(path, kind="tests")
    where = str(path)
    check_keys(content, ("spring", "free_recovery", "force_angle", "block", "assembly", "friction"), where=where)
    spring = get_table(content, "spring", where=where, required=True)
    check_keys(spring, (*keys_of("geometry"), "lever_mm"), where=f"{where}, [spring]")
    geometry = {name: float(spring[name]) for name in wire_keys(spring, where=f"{where}, [spring]")}
    block = get_table(content, "block", where=where, required=True)
    others = {}
    for name, key in (("assembly", "theta_p_deg"), ("friction", "tau_c_mnm")):
        table = get_table(content, name, where=where, required=True)
        check_keys(table, (key,), where=f"{where}, [{name}]")
        others[name] = {key: KEYS[key].number(table, key, where=f"{where}, [{name}]")}
    folder = path.parent
    logs = {name: get_tables(content, name, where=where, required=True) for name in ("free_recovery", "force_angle")}
    return SpringTests(
        geometry=geometry,
        lever_m=get_number(spring, "lever_mm", where=f"{where}, [spring]", lower=0.1, upper=1e4, hint="give it in mm")
        * MM,
        recoveries=tuple(_recovery(item, folder, where=spot) for item, spot in logs["free_recovery"]),
        forces=_both_ranges(tuple(_force(item, folder, where=spot) for item, spot in logs["force_angle"]), where=where),
        block=_block(block, folder, where=f"{where}, [block]"),
        assembly=others["assembly"],
        friction=others["friction"],
    )


def _log(table: Mapping[str, Any], folder: Path, columns: tuple[str, str], *, where: str) -> tuple[Floats, Floats, str]:
    """Return two columns of a log, thinned by means over neighbouring rows, and the log's path."""
    name = folder / get_text(table, "file", where=where)
    frame = read_table(name, required=columns)
    rows = frame[list(columns)].to_numpy(np.float64)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 20:
        raise InputError("has too few rows", where=str(name), value=f"{len(rows)} rows", limit="20 rows or more")
    for column, values in zip(columns, rows.T, strict=True):
        low, high, hint = _RANGES[column]
        wrong = values[(values < low) | (values > high)]
        if len(wrong):
            raise InputError(
                "is out of range",
                where=f"{name}, column {column}",
                value=f"{wrong[0]:g}",
                limit=f"{low:g} to {high:g}",
                do=hint,
            )
    # At most 4000 rows are fitted: denser logs are averaged, without loss for so smooth a curve.
    every = -(-len(rows) // 4000)
    means = block_means(rows, every)
    return means[:, 0], means[:, 1], str(name)


def _pre_deformation(table: Mapping[str, Any], *, where: str) -> float:
    # The range of a critical angle: a smaller value is most likely in radians, the paper's 85° are 1.5 rad.
    key = KEYS["theta_cr_deg"]
    size = abs(get_number(table, "pre_deformation_deg", where=where, lower=-key.upper, upper=key.upper))
    if size < key.lower:
        limit = f"{key.lower:g} or more, either sign"
        raise ConfigError(
            "'pre_deformation_deg' is too small", where=where, value=f"{size:g}", limit=limit, do=key.hint
        )
    return size


def _recovery(table: Mapping[str, Any], folder: Path, *, where: str) -> Recovery:
    check_keys(table, ("file", "pre_deformation_deg"), where=where)
    temp, angle, source = _log(table, folder, ("temp_c", "angle_deg"), where=where)
    size = _pre_deformation(table, where=where)
    start = float(np.mean(angle[: max(3, len(angle) // 50)]))
    return Recovery(temp, np.copysign(1.0, start) * angle, size, source)


def _force(table: Mapping[str, Any], folder: Path, *, where: str) -> ForceAngle:
    check_keys(table, ("file", "range", "from_deg", "to_deg"), where=where)
    angle, force, source = _log(table, folder, ("angle_deg", "force_n"), where=where)
    large = get_text(table, "range", where=where, choices=("small", "large")) == "large"
    given = [
        abs(get_number(table, key, where=where, lower=-5000.0, upper=5000.0))
        for key in ("from_deg", "to_deg")
        if key in table
    ]
    if len(given) == 1:
        raise ConfigError("has one of 'from_deg' and 'to_deg'", where=where, do="give both or none")
    size = np.abs(angle)
    low, high = sorted(given) if given else (LARGE_RANGE_DEG if large else (float(size.min()), float(size.max())))
    made = ForceAngle(size, force, large, low, high, source)
    if int(made.inside.sum()) < 10:
        raise InputError(
            "has too few rows in the range of the line", where=source,
            value=f"{int(made.inside.sum())} rows from {low:g} to {high:g}°",
            limit="10 rows or more", do="give 'from_deg' and 'to_deg' that the log covers",
        )  # fmt: skip
    return made


def _both_ranges(forces: tuple[ForceAngle, ...], *, where: str) -> tuple[ForceAngle, ...]:
    for large, name in ((False, "small"), (True, "large")):
        if not any(item.large is large for item in forces):
            do = "add it: both lines meet in the critical angle"
            raise ConfigError(f'has no [[force_angle]] with range = "{name}"', where=where, do=do)
    return forces


def _block(table: Mapping[str, Any], folder: Path, *, where: str) -> Block:
    check_keys(table, ("file", "pre_deformation_deg"), where=where)
    temp, force, source = _log(table, folder, ("temp_c", "force_n"), where=where)
    return Block(temp, force, _pre_deformation(table, where=where), source)
