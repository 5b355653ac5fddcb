"""Where the actuator may lack a law: ports of the model and the variables that a law may depend on.

A family is a port with a driver. Which values its driver takes, and so where its nodes lie, comes from the record
(:func:`laws_of`); what a law does to the model, from its port alone (:func:`apply_law`), so that a model file needs no
record. Ports are those of :class:`torsight.actuator.ports.Ports`; angles are in degrees, torques in mN·m, friction in
shares of τ_c.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.ports import DWELL_DECADES, SPEEDS_RAD_S, Ports
from torsight.actuator.springs import Rig
from torsight.core.config import get_number, get_text
from torsight.core.errors import ConfigError
from torsight.core.law import Kernel, Law, LawForm, outer, slope, smooth_kernels, usual_kernels
from torsight.core.units import DEG, MNM

Array = NDArray[np.float64]
_Curve = Callable[[Array], Array]

_ANGLE_NODES: Final = 37
"""A wave five times per turn over the paper's range of 466° needs five nodes a period."""
_NODES: Final = 13
_MARGIN: Final = 0.05
"""Share of a driver's range by which its nodes reach beyond what the record covers."""
AHEAD: Final = 2
"""A law over cycles reaches beyond the record for as many again: what is said of them, and how surely, is the prior's.
"""
_VALUES: Final = ("a_start_c", "a_finish_c", "m_start_c", "m_finish_c")
_SHARES: Final = ("k_austenite", "k_martensite", "k_stress_induced", "theta_cr_rad")


@dataclass(frozen=True, slots=True)
class Family:
    """A port with a driver.

    Attributes
    ----------
    id : str
        ``<port>_<driver>``, with the spring where it is one spring's.
    port, driver, spring, unit, title : str
        As :class:`torsight.core.law.Law` has them.
    stage : str
        Where it acts among the effects: ``temperature``, ``phase``, ``torque``, ``friction`` or ``reading``.
    apply : callable
        From ports and the law as a function of its driver to ports.
    nodes : callable
        From a prepared record to the nodes; None where the record does not cover the driver.
    scale : float
        A size that matters, in ``unit``; torques: as a share of τ_c.
    kernels : callable
        From nodes to the bank.
    time_like : bool
        True where the driver only counts time or cycles.
    """

    id: str
    port: str
    driver: str
    unit: str
    title: str
    stage: str
    apply: Callable[[Ports, _Curve], Ports]
    nodes: Callable[[Drive], Array | None]
    scale: float
    kernels: Callable[[Array], tuple[Kernel, ...]]
    spring: str = "both"
    time_like: bool = False


def apply_law(ports: Ports, form: LawForm, parameters: Array) -> Ports:
    """Return the ports with a law of the given parameters."""
    values = form.values(parameters)
    return FAMILIES[form.id].apply(ports, lambda driver: np.interp(driver, form.nodes, values))


def law_to_json(form: LawForm) -> dict[str, Any]:
    """Return a form of a law as it stands in ``model.json``."""
    return {
        "id": form.id,
        "nodes": form.nodes.tolist(),
        "basis": form.basis.tolist(),
        "unit": form.unit,
        "scale": form.scale,
    }


def laws_from(entries: object, *, where: str) -> tuple[LawForm, ...]:
    """Read the laws of a ``model.json``.

    Raises
    ------
    ConfigError
        When the list is damaged: an unknown law, nodes that do not rise, a basis that does not fit them.
    """
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise ConfigError("is no list of laws", where=where, value=repr(entries)[:80])
    return tuple(_law_from(entry, where=where) for entry in entries)


def _law_from(entry: Mapping[str, Any], *, where: str) -> LawForm:
    name = get_text(entry, "id", where=where, choices=tuple(FAMILIES))
    try:
        nodes = np.array(entry.get("nodes"), np.float64).reshape(-1)
        basis = np.array(entry.get("basis"), np.float64).reshape(len(nodes), -1)
    except (TypeError, ValueError) as error:
        raise ConfigError("a law's nodes and basis are no tables of numbers", where=where, value=name) from error
    rising = len(nodes) > 0 and bool(np.all(np.diff(nodes) > 0.0))
    if not (rising and basis.shape[1] and np.isfinite(nodes).all() and np.isfinite(basis).all()):
        raise ConfigError("a law has no rising nodes with finite values", where=where, value=name)
    unit = get_text(entry, "unit", where=where)
    scale = get_number(entry, "scale", where=where, lower=0.0, upper=1e6)
    return LawForm(name, nodes, basis, unit, scale, prior=True)


def laws_of(drive: Drive, tau_c_mnm: float) -> tuple[Law, ...]:
    """Return the laws that a record may show, with their nodes where it covers their drivers.

    Parameters
    ----------
    drive : Drive
        The prepared record.
    tau_c_mnm : float
        The friction torque's start value: the measure of all torques.
    """
    found = []
    for family in FAMILIES.values():
        nodes = family.nodes(drive)
        if nodes is None:
            continue
        scale = family.scale * tau_c_mnm if family.unit == "mN·m" else family.scale
        found.append(
            Law(
                id=family.id,
                port=family.port,
                driver=family.driver,
                unit=family.unit,
                title=family.title,
                nodes=nodes,
                scale=scale,
                kernels=family.kernels(nodes),
                spring=family.spring,
                time_like=family.time_like,
            )
        )
    return tuple(found)


def _over(low: float, high: float, count: int) -> Array | None:
    """Return evenly spaced nodes from ``low`` to ``high`` and a little beyond; None where nothing lies between."""
    span = high - low
    if not span > 0.0:
        return None
    return np.linspace(low - _MARGIN * span, high + _MARGIN * span, count)


def _angle_nodes(drive: Drive) -> Array | None:
    angle_deg = drive.angle_rad[np.isfinite(drive.angle_rad)] / DEG
    return _over(float(angle_deg.min()), float(angle_deg.max()), _ANGLE_NODES)


def _winding_nodes(drive: Drive) -> Array | None:
    """Return nodes over the windings of both springs, from the middle of both outwards."""
    angle_deg = np.abs(drive.angle_rad[np.isfinite(drive.angle_rad)] / DEG)
    return _over(-float(angle_deg.max()), float(angle_deg.max()), _ANGLE_NODES)


def _active_nodes(drive: Drive) -> Array | None:
    active_c = np.where(drive.cycles.active == 0, drive.temp_a_c, drive.temp_b_c)
    return _over(float(active_c.min()), float(active_c.max()), _NODES)


def _passive_nodes(drive: Drive) -> Array | None:
    passive_c = np.where(drive.cycles.active == 0, drive.temp_b_c, drive.temp_a_c)
    low, high = float(passive_c.min()), float(np.quantile(passive_c, 0.99))
    return _over(low, high, _NODES) if high - low > _LEAST_WARMING_C else None


_LEAST_WARMING_C: Final = 3.0
"""A passive spring that warms up by less tells nothing of what depends on it."""


def _rate_nodes(drive: Drive) -> Array | None:
    rate = np.concatenate([drive.rate_a_c_s, drive.rate_b_c_s])
    low, high = np.quantile(rate, [0.002, 0.998])
    return _over(float(low), float(high), _NODES)


def _speed_nodes(drive: Drive) -> Array | None:
    """Return nodes over speeds in °/s, denser where it is slow."""
    good = np.isfinite(drive.angle_rad)
    time_s, angle_deg = drive.time_s[good], drive.angle_rad[good] / DEG
    every = max(1, round(2.0 / float(np.median(np.diff(time_s)))))
    speed = np.abs(np.diff(angle_deg[::every]) / np.diff(time_s[::every]))
    fastest = float(np.quantile(speed, 0.998)) if len(speed) else 0.0
    return fastest * np.linspace(0.0, 1.1, _NODES) ** 2 if fastest > 0.0 else None


def _dwell_nodes(drive: Drive) -> Array | None:
    """Return nodes over rests, in decades of seconds."""
    longest_s = float(np.max(np.bincount(drive.cycles.half))) * float(np.median(np.diff(drive.time_s)))
    return np.linspace(0.0, np.log10(1.0 + longest_s), 9)


def _time_nodes(drive: Drive) -> Array | None:
    return _over(float(drive.time_s[0]), float(drive.time_s[-1]), 2 * _NODES)


def _half_nodes(drive: Drive) -> Array | None:
    count = len(drive.cycles.springs)
    return np.arange(AHEAD * count, dtype=np.float64) if count > 2 else None


def _cycle_nodes(drive: Drive) -> Array | None:
    count = int(drive.cycles.counts().max()) + 1
    return np.arange(AHEAD * count, dtype=np.float64) if count > 1 else None


def _waves(nodes: Array) -> tuple[Kernel, ...]:
    """Return a constant, a slope, waves one to six times per turn, and smooth functions."""
    turn = nodes * DEG
    waves = tuple(
        Kernel(f"wave, {n} per turn", outer(np.sin(n * turn)) + outer(np.cos(n * turn)), smooth=False)
        for n in range(1, 7)
    )
    forms = usual_kernels([("constant", np.ones_like(nodes)), ("slope", nodes - nodes.mean())])
    return (*forms, *waves, *smooth_kernels(nodes))


def _wound(nodes: Array) -> tuple[Kernel, ...]:
    """Return slopes and cubics beyond an onset of either half, and smooth functions."""
    onsets = np.quantile(nodes, [0.5, 0.6, 0.7, 0.8])
    forms = [("slope", nodes - nodes[0])]
    forms += [(f"cubic beyond {onset:.0f}°", np.maximum(0.0, nodes - onset) ** 3) for onset in onsets]
    return (*usual_kernels(forms), *smooth_kernels(nodes, shares=(0.5, 0.25, 0.12)))


def _plain(nodes: Array) -> tuple[Kernel, ...]:
    """Return a slope, a bow and smooth functions, all without a mean: that is another value of the model."""
    middle = nodes - 0.5 * (nodes[0] + nodes[-1])
    smooth = smooth_kernels(nodes, shares=(0.5, 0.25, 0.12), line=True)
    return (
        *usual_kernels([("slope", middle), ("bow", middle**2 - np.mean(middle**2))]),
        *(Kernel(kernel.name, _centred(kernel.matrix), smooth=True) for kernel in smooth),
    )


def _centred(matrix: Array) -> Array:
    """Return the covariance of the same function less its mean over the nodes."""
    less_mean = np.eye(len(matrix)) - 1.0 / len(matrix)
    return np.asarray(less_mean @ matrix @ less_mean)


def _from_zero(nodes: Array) -> tuple[Kernel, ...]:
    """Return functions that vanish at the first node: proportional, its root, and smooth ones."""
    off = nodes - nodes[0]
    smooth = smooth_kernels(off, shares=(0.7, 0.35, 0.2))
    return (
        *usual_kernels([("proportional", off), ("root", np.sqrt(off))]),
        *(Kernel(kernel.name, _pinned(kernel.matrix), smooth=True) for kernel in smooth),
    )


def _pinned(matrix: Array) -> Array:
    """Return the covariance of the same function less its value at the first node."""
    first = matrix[0]
    return np.asarray(matrix - first[:, None] - first[None, :] + matrix[0, 0])


def _through_zero(nodes: Array) -> tuple[Kernel, ...]:
    """Return functions of a signed variable: proportional, its sign's, and smooth ones."""
    forms = [("proportional", nodes), ("square", nodes * np.abs(nodes))]
    return (*usual_kernels(forms), *smooth_kernels(nodes, shares=(0.5, 0.25)))


def _counted(nodes: Array) -> tuple[Kernel, ...]:
    """Return a slope, a decay towards a limit, and a slope with a smooth function; all vanish at the first node."""
    off = nodes - nodes[0]
    forms = [("slope", off)]
    forms += [(f"towards a limit, {n} of them", 1.0 - np.exp(-off / n)) for n in (2.0, 5.0) if len(nodes) > n]
    smooth = smooth_kernels(off, shares=(0.7, 0.35), line=True)
    steps = Kernel("from one to the next", np.minimum.outer(off, off) / max(off[-1], 1.0), smooth=True)
    return (*usual_kernels(forms), *(Kernel(k.name, _pinned(k.matrix), smooth=True) for k in smooth), steps)


def _drifting(nodes: Array) -> tuple[Kernel, ...]:
    kernels = smooth_kernels(nodes, shares=(0.5, 0.2, 0.1), line=True)
    return (Kernel("slope", slope(nodes), smooth=False), *kernels)


def _unlike(nodes: Array) -> tuple[Kernel, ...]:
    """Return what two springs of one kind may differ by: transformation temperatures together, moduli, and all.

    The values are those of :func:`_differing`: four temperatures in °C, four shares in per cent.
    """
    size = len(nodes)
    together = np.zeros(size)
    together[:4] = 1.0
    moduli = np.zeros(size)
    moduli[4:7] = 1.0
    each = 0.1 * np.eye(size)
    return (
        Kernel("transformation temperatures together", np.outer(together, together), smooth=False),
        Kernel("moduli together", np.outer(moduli, moduli), smooth=False),
        Kernel("all values", np.outer(together, together) + np.outer(moduli, moduli) + each, smooth=True),
    )


def _stray(ports: Ports, law: _Curve) -> Ports:
    return ports.with_stray(law(ports.phi_grid_rad() / DEG) * MNM)


def _friction_angle(ports: Ports, law: _Curve) -> Ports:
    factor = np.maximum(0.0, 1.0 + law(ports.phi_grid_rad() / DEG))
    return ports.with_friction(factor, factor)


def _scaled_friction(ports: Ports, share: Array) -> Ports:
    return replace(ports, friction_scale=ports.friction_scale * np.maximum(0.0, 1.0 + share))


def _friction_active(ports: Ports, law: _Curve) -> Ports:
    return _scaled_friction(ports, law(np.where(ports.active == 0, ports.temp_a_c, ports.temp_b_c)))


def _friction_passive(ports: Ports, law: _Curve) -> Ports:
    return _scaled_friction(ports, law(np.where(ports.active == 0, ports.temp_b_c, ports.temp_a_c)))


def _friction_cycle(ports: Ports, law: _Curve) -> Ports:
    return _scaled_friction(ports, law(ports.half_cycle[ports.half].astype(np.float64)))


def _friction_speed(ports: Ports, law: _Curve) -> Ports:
    return ports.with_speed_friction(law(SPEEDS_RAD_S / DEG) * ports.rig.tau_c_nm)


def _friction_dwell(ports: Ports, law: _Curve) -> Ports:
    return ports.with_dwell(np.maximum(1.0, 1.0 + law(DWELL_DECADES)))


def _friction_direction(ports: Ports, law: _Curve) -> Ports:
    down, up = (np.maximum(0.0, 1.0 + law(np.full_like(ports.grid_rad(), sign))) for sign in (-1.0, 1.0))
    return ports.with_friction(down, up)


def _reading_angle(ports: Ports, law: _Curve) -> Ports:
    return ports.with_reading(lambda angle_rad, _time_s: angle_rad + law(angle_rad / DEG) * DEG)


def _reading_time(ports: Ports, law: _Curve) -> Ports:
    if ports.history.after_record:
        return ports
    return ports.with_reading(lambda angle_rad, time_s: angle_rad + law(time_s) * DEG)


def _temperature(spring: str) -> Callable[[Ports, _Curve], Ports]:
    def apply(ports: Ports, law: _Curve) -> Ports:
        temp_a_c = ports.temp_a_c + law(ports.temp_a_c) if spring != "b" else ports.temp_a_c
        temp_b_c = ports.temp_b_c + law(ports.temp_b_c) if spring != "a" else ports.temp_b_c
        return replace(ports, temp_a_c=temp_a_c, temp_b_c=temp_b_c)

    return apply


def _temperature_rate(ports: Ports, law: _Curve) -> Ports:
    return replace(
        ports, temp_a_c=ports.temp_a_c + law(ports.rate_a_c_s), temp_b_c=ports.temp_b_c + law(ports.rate_b_c_s)
    )


def _temperature_time(ports: Ports, law: _Curve) -> Ports:
    if ports.history.after_record:
        return ports
    off_c = law(ports.time_s)
    return replace(ports, temp_a_c=ports.temp_a_c + off_c, temp_b_c=ports.temp_b_c + off_c)


def _over_winding(ports: Ports, law: _Curve) -> Array:
    """Return the law over a spring's own angle on the grid, N·m; its driver is the winding beyond θ_P/2."""
    return law((ports.grid_rad() - 0.5 * ports.rig.theta_p_rad) / DEG) * MNM


def _winding(spring: str) -> Callable[[Ports, _Curve], Ports]:
    return lambda ports, law: ports.with_side(_over_winding(ports, law), spring=spring)


def _loading(spring: str, *, follows: float = 1.0) -> Callable[[Ports, _Curve], Ports]:
    def apply(ports: Ports, law: _Curve) -> Ports:
        return ports.with_loading(_gentle(ports, _over_winding(ports, law)), follows=follows, spring=spring)

    return apply


_STEEPEST: Final = 0.9
"""Share of the way from the second slope to K_M that the loading curve may steepen by: it is wound, not unwound."""


def _gentle(ports: Ports, torque_nm: Array) -> Array:
    """Return a torque over the grid that makes the loading curve nowhere as steep as unwinding, nor falling."""
    rig, step = ports.rig, float(np.diff(ports.grid_rad()[:2])[0])
    most = _STEEPEST * (rig.k_martensite - rig.k_stress_induced) * step
    rise = np.clip(np.diff(torque_nm), -_STEEPEST * rig.k_stress_induced * step, most)
    return np.concatenate([torque_nm[:1], torque_nm[0] + np.cumsum(rise)])


def _theta_l_half(ports: Ports, law: _Curve) -> Ports:
    share = np.maximum(0.0, 1.0 + law(ports.half_cycle.astype(np.float64)))
    return replace(ports, theta_l_scale=ports.theta_l_scale * share)


def _theta_l_cycle(ports: Ports, law: _Curve) -> Ports:
    share = np.maximum(0.0, 1.0 + law(ports.cycle.astype(np.float64)))
    return replace(ports, theta_l_scale=ports.theta_l_scale * share)


def _differing(ports: Ports, law: _Curve) -> Ports:
    """Let spring B differ from A: four temperatures by so many °C, three moduli and θ_cr by so many per cent."""
    rig = ports.rig_b
    values = law(np.arange(len(_VALUES) + len(_SHARES), dtype=np.float64))
    shifted = {name: getattr(rig, name) + float(by) for name, by in zip(_VALUES, values[:4], strict=True)}
    scaled = {
        name: getattr(rig, name) * (1.0 + 0.01 * by) for name, by in zip(_SHARES, values[4:].tolist(), strict=True)
    }
    other: Rig = replace(rig, **shifted, **scaled)
    return replace(ports, rig_b=other)


def _unlike_nodes(drive: Drive) -> Array | None:
    both = len(set(drive.cycles.springs)) > 1
    return np.arange(float(len(_VALUES) + len(_SHARES))) if both else None


def _signs(_drive: Drive) -> Array:
    return np.array([-1.0, 1.0])


def _antisymmetric(nodes: Array) -> tuple[Kernel, ...]:
    return usual_kernels([("sign", nodes)])


_ALL: Final = (
    Family("torque_angle_deg", "torque", "angle_deg", "mN·m", "stray torque over the angle", "torque", _stray,
           _angle_nodes, 0.1, _waves),
    Family("winding_winding_deg", "winding", "winding_deg", "mN·m", "a spring's torque over its winding", "torque",
           _winding("both"), _winding_nodes, 0.1, _wound),
    *(Family(f"winding_{one}_winding_deg", "winding", "winding_deg", "mN·m",
             f"spring {one.upper()}'s torque over its winding", "torque", _winding(one), _winding_nodes, 0.1, _wound,
             spring=one) for one in "ab"),
    Family("loading_winding_deg", "winding", "winding_deg", "mN·m", "the loading curve over the winding", "torque",
           _loading("both"), _winding_nodes, 0.1, _wound),
    *(Family(f"loading_{one}_winding_deg", "winding", "winding_deg", "mN·m",
             f"spring {one.upper()}'s loading curve over the winding", "torque", _loading(one), _winding_nodes, 0.1,
             _wound, spring=one) for one in "ab"),
    Family("loading_alone_winding_deg", "winding", "winding_deg", "mN·m",
           "the loading curve over the winding, recoverable angle as before", "torque",
           _loading("both", follows=0.0), _winding_nodes, 0.1, _wound),
    Family("friction_angle_deg", "friction", "angle_deg", "", "friction over the angle", "friction", _friction_angle,
           _angle_nodes, 0.1, _waves),
    Family("friction_temp_active_c", "friction", "temp_active_c", "", "friction over the driven spring's temperature",
           "friction", _friction_active, _active_nodes, 0.1, _plain),
    Family("friction_temp_passive_c", "friction", "temp_passive_c", "", "friction over the other spring's temperature",
           "friction", _friction_passive, _passive_nodes, 0.1, _plain),
    Family("friction_angle_rate_deg_s", "friction", "angle_rate_deg_s", "", "friction over the speed", "friction",
           _friction_speed, _speed_nodes, 0.1, _from_zero),
    Family("friction_dwell_s", "friction", "dwell_s", "", "friction over the rest before motion", "friction",
           _friction_dwell, _dwell_nodes, 0.1, _from_zero),
    Family("friction_direction", "friction", "direction", "", "friction over the direction", "friction",
           _friction_direction, _signs, 0.1, _antisymmetric),
    Family("friction_cycle", "friction", "cycle", "", "friction over the half-cycles", "friction", _friction_cycle,
           _half_nodes, 0.1, _counted, time_like=True),
    Family("reading_angle_deg", "reading", "angle_deg", "°", "the reading over the angle", "reading", _reading_angle,
           _angle_nodes, 0.3, _waves, spring=""),
    Family("reading_time_s", "reading", "time_s", "°", "the reading over time", "reading", _reading_time, _time_nodes,
           0.3, _drifting, spring="", time_like=True),
    Family("temperature_temp_active_c", "temperature", "temp_active_c", "°C", "the wires' temperatures over themselves",
           "temperature", _temperature("both"), _active_nodes, 0.3, _plain),
    Family("temperature_a_temp_active_c", "temperature", "temp_active_c", "°C", "wire A's temperature over itself",
           "temperature", _temperature("a"), _active_nodes, 0.3, _plain, spring="a"),
    Family("temperature_b_temp_active_c", "temperature", "temp_active_c", "°C", "wire B's temperature over itself",
           "temperature", _temperature("b"), _active_nodes, 0.3, _plain, spring="b"),
    Family("temperature_temp_rate_c_s", "temperature", "temp_rate_c_s", "°C", "the wires' temperatures over their rate",
           "temperature", _temperature_rate, _rate_nodes, 0.3, _through_zero),
    Family("temperature_time_s", "temperature", "time_s", "°C", "the wires' temperatures over time", "temperature",
           _temperature_time, _time_nodes, 0.3, _drifting, time_like=True),
    Family("phase_half_cycle", "phase", "cycle", "", "the recoverable angle over the half-cycles", "phase",
           _theta_l_half, _half_nodes, 0.03, _counted),
    Family("phase_cycle", "phase", "cycle", "", "the recoverable angle over a spring's own cycles", "phase",
           _theta_l_cycle, _cycle_nodes, 0.03, _counted),
    Family("values_spring", "values", "spring", "°C", "spring B's values", "phase", _differing, _unlike_nodes, 1.0,
           _unlike, spring="b"),
)  # fmt: skip
FAMILIES: Final[Mapping[str, Family]] = {family.id: family for family in _ALL}
"""All families by id."""
