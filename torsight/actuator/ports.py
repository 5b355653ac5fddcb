"""The ports at which an effect can act on the model: wire temperature, phase, torque, friction, reading.

A :class:`Ports` holds all inputs of one simulation. An effect is a function from ports to ports; the plain model's
ports are those before any effect. This module does not depend on any effect.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.record.segments import by_role
from torsight.actuator.record.turns import at_places, on_lines
from torsight.actuator.springs import Rig
from torsight.actuator.stepping.kernel_laws import sampled
from torsight.actuator.stepping.phase import PLACES
from torsight.core.units import DEG, Floats, Ints

Reading = Callable[[Floats, Floats], Floats]

STEEPEST: Final = 0.9
"""Steepest rise of a loading curve over its second slope, as a share of K_M − K_S: unwinding with K_M is steeper."""
REACH_RAD: Final = 100.0 * DEG
"""Angle beyond an onset at which a power law has its declared size, whatever the exponent."""
_GRID_POINTS: Final = len(PLACES)
"""Nodes of a table, 1.35° apart over the paper's angles: linear interpolation misses a wave five times per turn, the
shortest of a law, by (2π 1.35° / 72°)² / 8 = 0.2 % of its size."""
SPEEDS_RAD_S: Final = np.linspace(0.0, 1.0, _GRID_POINTS)
"""Speeds of the table of friction over speed; the last value holds beyond. The paper's rig reaches 0.2 rad/s."""
_SAMPLED: Final = frozenset(("time_s", "temp_a_c", "temp_b_c", "active", "half", "passive_share"))
"""Attributes that determine the samples."""
DWELL_DECADES: Final = np.linspace(0.0, 6.0, _GRID_POINTS)
"""log10(1 + rest in s) of the table of friction after a rest."""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """State of the springs when a log begins: ``cycles`` counts the earlier heatings of A and of B.

    ``after_record`` is true where the simulated log comes after the record that the model was fitted to.
    ``unwound_rad`` is the difference between the last maximum of the winding of A and of B and their winding when the
    log begins; None: by the rule for homes.
    """

    cycles: tuple[int, int] = (0, 0)
    after_record: bool = False
    unwound_rad: tuple[float, float] | None = None


Pair = tuple[Floats | None, Floats | None]
"""A table of spring A and a table of spring B."""


def no_steeper(torque_nm: Floats, theta_rad: Floats, most: float, least: float = -np.inf) -> Floats:
    """Return a torque (n,) at rising angles with its slopes limited to ``least`` … ``most``, N·m/rad."""
    step = np.diff(theta_rad)
    rise = np.clip(np.diff(torque_nm), least * step, most * step)
    return np.concatenate([torque_nm[:1], torque_nm[0] + np.cumsum(rise)])


def _added(tables: Pair, torque_nm: Floats, spring: str) -> Pair:
    """Return the tables with a torque added to that of one spring (``a``, ``b``) or of ``both``."""
    a, b = (
        table if spring not in ("both", name) else torque_nm if table is None else table + torque_nm
        for name, table in zip("ab", tables, strict=True)
    )
    return a, b


@functools.lru_cache(maxsize=16)
def _grids_rad(theta_p_rad: float) -> tuple[Floats, Floats]:
    """Return the tables' angles θ^A and φ, read-only: a quarter of θ_P beyond both ends, where the last values hold."""
    margin = 0.25 * theta_p_rad
    own = np.linspace(-margin, theta_p_rad + margin, _GRID_POINTS)
    phi = own - 0.5 * theta_p_rad
    own.flags.writeable = phi.flags.writeable = False
    return own, phi


@dataclass(frozen=True, eq=False)
class Ports:
    """All inputs of one simulation."""

    rig: Rig
    rig_b: Rig
    """The values of the rig with those of spring A, and with those of spring B."""
    time_s: Floats
    """(n,): Times of the rows."""
    temp_a_c: Floats
    temp_b_c: Floats
    """(n,): Temperature of either wire."""
    rate_a_c_s: Floats
    rate_b_c_s: Floats
    """(n,): Slope of the measured temperature of the wire."""
    active: NDArray[np.int8]
    """(n,): 0 while A is driven, 1 while B is."""
    half: Ints
    """(n,): Number of the half-cycle."""
    cycle: Ints
    """(halves,): Number of heatings of the driven spring before each half-cycle, including those of the history."""
    half_cycle: Ints
    """(halves,): Number of heatings of both springs before each half-cycle."""
    room_c: float
    """Room temperature."""
    drive: Drive
    """The prepared log, at all of its rows."""
    log_rows: Floats
    """(n,): Rows of the drive from which the temperatures are taken; fractions are interpolated."""
    history: History = field(default_factory=History)
    """State of the springs after earlier records."""
    tanaka: bool = False
    """Whether the phase law is Tanaka's exponential, and not the cosine of Liang and Rogers."""
    fixed_theta_l: float = 0.0
    """A constant recoverable angle, rad, in place of the one that follows from the last winding; 0: none."""
    section_weight: Floats = field(default_factory=lambda: np.ones(1))
    section_drop_c: Floats = field(default_factory=lambda: np.zeros(1))
    section_drop_share: Floats = field(default_factory=lambda: np.zeros(1))
    """(m,): Sections of the wire: weight, and temperature below that of the sensor, absolute and as a share of the
    excess over the room."""
    passive_share: float = 0.0
    """Share of the passive spring that transforms at its own temperature and stress."""
    theta_l_scale: Floats = field(default_factory=lambda: np.ones(1))
    theta_l_loss_rad: Floats = field(default_factory=lambda: np.zeros(1))
    """(halves,): Factor on the recoverable angle, and loss of this angle independent of the winding."""
    warmer_heating_c: Floats = field(default_factory=lambda: np.zeros(1))
    warmer_cooling_c: Floats = field(default_factory=lambda: np.zeros(1))
    """(halves,): Shift of the driven spring's transformation temperatures."""
    friction_scale: Floats = field(default_factory=lambda: np.ones(1))
    """(n,): Factor on the friction torque."""
    passive_scale: Floats | None = None
    """(n,): Factor on the torque of the spring that is not driven."""
    cold_scale: Floats | None = None
    """(n,): Factor on the torque of cold martensite, whichever spring is driven."""
    side_a_nm: Floats | None = None
    side_b_nm: Floats | None = None
    """(n,): Torque of either spring in addition to that of its phase."""
    slipped_rad: Pair = (None, None)
    """(n,): Slip of the fixed ends of A and of B: each spring's winding is reduced by it."""
    first_share: float = 1.0
    """Share of its torque that the spring that is driven first carried before the record."""
    home_hold: float = 1.0
    """Share of the friction that holds at the start of the record, from −1 to 1."""
    heating_bend: float = 0.0
    cooling_bend: float = 0.0
    """Bend of the phase law: its lead is bend · u (1 − u) at the place u in its window."""
    loop_memory: float = 0.0
    """Memory of a transformation after an incomplete one: 0 scales the law to the remaining share (Liang and Rogers), 1
    holds ξ until the complete law reaches it."""
    renewal: float = 0.0
    """Share by which a standstill within a stroke renews the reference state of the driven spring, from 0 to 1."""
    change_held: float = 0.0
    """Share by which the disk is held where it is when the other spring's turn comes, from 0 (it gives way) to 1."""
    lead: tuple[Floats, Floats] | None = None
    """(g,): Lead of the transformation over the phase law on heating and on cooling, in windows, over
    :data:`~torsight.actuator.stepping.phase.PLACES`."""
    latent_c_s: float = 0.0
    """Temperature of a wire above its sensor's reading per rate of ξ."""
    viscous_nms: float = 0.0
    viscous_power: float = 1.0
    """Friction torque at 1 rad/s, and the power of the speed with which it grows."""
    dwell_factor: Floats | None = None
    """(g,): Factor on the friction that has to be overcome after a rest, over :data:`DWELL_DECADES`; None: one."""
    seat_rad: float = 0.0
    seat_spread: float = 0.0
    """Mean angle by which the friction's elastic elements yield at τ_c before the disk slides (0: no elasticity), and
    the relative spread of their angles about the mean."""
    swing: float = 0.0
    """Distance by which inertia carries the disk past its balance, as a share of a jump after a rest, from 0 to 1."""
    speed_friction_nm: Floats | None = None
    """(g,): Additional friction torque over :data:`SPEEDS_RAD_S`; None: none."""
    friction_down_nm: Floats | None = None
    friction_up_nm: Floats | None = None
    """(g,): Friction torque over θ^A (:meth:`grid_rad`) for a falling and a rising φ; None: τ_c."""
    stray_nm: Floats | None = None
    """(g,): Further torque along φ over θ^A."""
    loading_nm: Pair = (None, None)
    """(g,): Torque of the loading curves of A and of B in addition to the two slopes, over the spring's own angle
    (:meth:`grid_rad`)."""
    loading_follows: tuple[float, float] = (1.0, 1.0)
    """Share of this torque that the recoverable angle follows."""
    side_nm: Pair = (None, None)
    """(g,): Torque of A and of B in addition to that of their phases, over their own angle (the same grid)."""
    reading: tuple[Reading, ...] = ()
    """Functions from φ and times to the reading, rad, applied in this order."""
    samples: tuple[Floats, Floats, NDArray[np.int8]] | None = None
    """Cached result of :meth:`sampled`."""

    def changed(self, **values: Any) -> Ports:
        """Return ports with other values of some attributes; a faster :func:`dataclasses.replace`."""
        if not values.keys() <= self.__dict__.keys():
            msg = f"ports have no {', '.join(sorted(values.keys() - self.__dict__.keys()))}"
            raise TypeError(msg)
        other = object.__new__(Ports)
        other.__dict__.update(self.__dict__)
        other.__dict__.update(values)
        if not _SAMPLED.isdisjoint(values):
            other.__dict__["samples"] = None
        return other

    def sampled(self) -> tuple[Floats, Floats, NDArray[np.int8]]:
        """Return the result of :func:`~torsight.actuator.stepping.kernel_laws.sampled` for these temperatures."""
        courses = (self.time_s, self.temp_a_c, self.temp_b_c, self.active, self.half)
        return self.samples or sampled(*courses, self.passive_share > 0.0)

    def grid_rad(self) -> Floats:
        """Return the angles of the tables, θ^A = φ + θ_P/2, rad."""
        return _grids_rad(self.rig.theta_p_rad)[0]

    def phi_grid_rad(self) -> Floats:
        """Return the actuator angles φ of the tables, rad."""
        return _grids_rad(self.rig.theta_p_rad)[1]

    @property
    def steepest_bend_nm(self) -> float:
        """The largest slope that a law may add to a loading curve, N·m/rad."""
        return STEEPEST * (self.rig.k_martensite - self.rig.k_stress_induced)

    @property
    def load_changes(self) -> bool:
        """Whether a spring's torque may change with time while its phase and its angle are constant."""
        return not (self.passive_scale is self.cold_scale is self.side_a_nm is self.side_b_nm is None)

    def load_change(self) -> Floats:
        """Return the changes of the springs' torques with time, as in :class:`Samples`.

        Shape (4, n); (4, 0) where nothing changes.
        """
        if not self.load_changes:
            return np.zeros((4, 0))
        n = len(self.time_s)
        factor, keeps = (np.ones(n) if one is None else one for one in (self.passive_scale, self.cold_scale))
        a, b = (np.zeros(n) if side is None else side for side in (self.side_a_nm, self.side_b_nm))
        return np.stack([factor, *by_role(self.active, a, b), keeps])

    @property
    def slips(self) -> bool:
        """Whether a fixed end of a spring slips."""
        return any(end is not None for end in self.slipped_rad)

    def slipped(self) -> Floats:
        """Return the slip (2, n) of the fixed ends of A and of B, rad; (2, 0) where none slips."""
        if not self.slips:
            return np.zeros((2, 0))
        return np.stack([np.zeros(len(self.time_s)) if end is None else end for end in self.slipped_rad])

    def with_slip(self, slipped_rad: Floats, *, spring: str) -> Ports:
        """Return ports in which further angles (n,) are added to the slip of the fixed end of spring ``a`` or ``b``."""
        return self.changed(slipped_rad=_added(self.slipped_rad, slipped_rad, spring))

    def with_friction(self, factor_down: Floats, factor_up: Floats, added_nm: Floats | float = 0.0) -> Ports:
        """Return ports with factors on the friction over :meth:`grid_rad` per direction, and an added torque."""
        plain = np.full(_GRID_POINTS, self.rig.tau_c_nm)
        down = plain if self.friction_down_nm is None else self.friction_down_nm
        up = plain if self.friction_up_nm is None else self.friction_up_nm
        return self.changed(friction_down_nm=down * factor_down + added_nm, friction_up_nm=up * factor_up + added_nm)

    def with_speed_friction(self, torque_nm: Floats) -> Ports:
        """Return ports with a further friction torque over :data:`SPEEDS_RAD_S`."""
        before = self.speed_friction_nm
        return self.changed(speed_friction_nm=torque_nm if before is None else before + torque_nm)

    def with_dwell(self, factor: Floats) -> Ports:
        """Return ports with a further factor on the friction after a rest, over :data:`DWELL_DECADES`."""
        return self.changed(dwell_factor=factor if self.dwell_factor is None else self.dwell_factor * factor)

    def with_lead(self, heating: Floats, cooling: Floats) -> Ports:
        """Return ports with a further lead of the transformations over the phase law, in windows over its places."""
        before = self.lead or (0.0, 0.0)
        return self.changed(lead=(before[0] + heating, before[1] + cooling))

    def moved_places(self) -> tuple[Floats | None, Floats | None]:
        """Return the leads, limited so that a transformation never reverses while its temperature advances.

        It goes on at a twentieth of the phase law's rate, a choice.
        """
        if self.lead is None:
            return None, None
        heating, cooling = (no_steeper(lead, PLACES, np.inf, 0.05 - 1.0) for lead in self.lead)
        return heating, cooling

    def with_loading(self, torque_nm: Floats, *, follows: float = 1.0, spring: str = "both") -> Ports:
        """Return ports with a further torque of the loading curves over the spring's angle (on :meth:`grid_rad`).

        The recoverable angle follows this torque by the share ``follows``.
        """
        a, b = (spring in ("both", one) for one in "ab")
        shares = (follows if a else self.loading_follows[0], follows if b else self.loading_follows[1])
        return self.changed(loading_nm=_added(self.loading_nm, torque_nm, spring), loading_follows=shares)

    def with_stray(self, torque_nm: Floats) -> Ports:
        """Return ports with a further torque along φ over :meth:`grid_rad`."""
        return self.changed(stray_nm=torque_nm if self.stray_nm is None else self.stray_nm + torque_nm)

    def with_side(self, torque_nm: Floats, *, spring: str = "both") -> Ports:
        """Return ports with a further torque of the springs over their own angle (on :meth:`grid_rad`)."""
        return self.changed(side_nm=_added(self.side_nm, torque_nm, spring))

    def with_temperatures(self, change: Callable[[Floats, Floats], tuple[Floats, Floats]]) -> Ports:
        """Return ports with both wires' temperatures and slopes mapped by ``change``."""
        temp_a_c, rate_a = change(self.temp_a_c, self.rate_a_c_s)
        temp_b_c, rate_b = change(self.temp_b_c, self.rate_b_c_s)
        return self.changed(temp_a_c=temp_a_c, temp_b_c=temp_b_c, rate_a_c_s=rate_a, rate_b_c_s=rate_b)

    def behind_sensors(self, lag_a_s: float, lag_b_s: float) -> Ports:
        """Return ports with the wires' temperatures estimated for sensors with these time constants, s."""
        wires_c = []
        for spring, (temp_c, lag_s) in enumerate(((self.temp_a_c, lag_a_s), (self.temp_b_c, lag_b_s))):
            (off_c,) = self.logged(self.drive.sensors.lag_correction(spring, lag_s))
            wires_c.append(temp_c + off_c)
        return self.changed(temp_a_c=wires_c[0], temp_b_c=wires_c[1])

    def at_log_times(self, wanted_s: Floats) -> Ports:
        """Return ports with the temperatures and half-cycles of the log at other times (n,)."""
        moved, cycles = self.read_at(wanted_s), self.drive.cycles
        rows = np.ceil(moved.log_rows).astype(np.int64)
        return moved.changed(active=cycles.active[rows], half=cycles.half[rows])

    def read_at(self, wanted_s: Floats) -> Ports:
        """Return ports with the temperatures of the log at other times (n,), half-cycles unchanged."""
        drive = self.drive
        places = np.interp(wanted_s, drive.time_s, np.arange(float(len(drive))))
        moved = self.changed(log_rows=places)
        rate_a, rate_b = moved.logged(drive.rate_a_c_s, drive.rate_b_c_s)
        temps_c = (drive.temp_a_c, drive.temp_b_c)
        a, b = (at_places(temp_c, turns, places) for temp_c, turns in zip(temps_c, drive.turning, strict=True))
        return moved.changed(temp_a_c=a, temp_b_c=b, rate_a_c_s=rate_a, rate_b_c_s=rate_b)

    @property
    def log_time_s(self) -> Floats:
        """Times of the log (n,) from which the temperatures are taken: ``time_s`` where the clocks agree."""
        return self.logged(self.drive.time_s)[0]

    def logged(self, *courses: Floats) -> tuple[Floats, ...]:
        """Return series over the drive's rows, linearly interpolated at ``log_rows``."""
        return tuple(on_lines(course, self.log_rows) for course in courses)

    def with_reading(self, reading: Reading) -> Ports:
        """Return ports with a further function from φ to the reading."""
        return self.changed(reading=(*self.reading, reading))

    def read(self, phi_rad: Floats, time_s: Floats) -> Floats:
        """Return angles (k,) at times (k,) as a camera would read them."""
        for reading in self.reading:
            phi_rad = reading(phi_rad, time_s)
        return phi_rad
