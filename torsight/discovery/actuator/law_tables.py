"""The measured laws of an answer in the units of files: a curve with its uncertainty, and one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from torsight.actuator.laws import FAMILIES, between_nodes
from torsight.actuator.laws.acts import TEMPERATURES
from torsight.actuator.laws.nodes import cycle_nodes, phase_nodes
from torsight.actuator.laws.phase_window import BRANCH, OWN_STEPS, phase_places
from torsight.actuator.record.segments import by_role
from torsight.actuator.simulation import Simulation
from torsight.actuator.springs import Rig
from torsight.core.law import Law
from torsight.core.units import Flags, Floats
from torsight.discovery.actuator.law_words import OnNodes, law_sentence
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.explanation import Explanation, joint_covariance, on_nodes
from torsight.discovery.inference.law.measure import Measured
from torsight.discovery.measured_law import MeasuredLaw, numbered

_POINTS: Final = 121
"""Rows of a law's file: smooth to the eye over the width of a page."""


class Acting(NamedTuple):
    """A measured law, and the record on which it acts; ``record`` is empty where it acts on all of them."""

    record: str
    problem: ActuatorProblem
    measured: Measured


def measured_laws(
    laws: Sequence[Acting], chosen: Explanation, shares: Mapping[str, float], names: Mapping[str, str]
) -> tuple[MeasuredLaw, ...]:
    """Return the laws of an explanation, strongest first.

    ``shares`` are the shares of the explained residual, ``names`` the effects whose names laws carry, both by law; laws
    without a name are missing.
    """
    spread = joint_covariance(chosen)
    found = []
    for record, problem, measured in laws:
        law = measured.law
        share = float(shares.get(law.id, 1.0))
        known = _Known(law, *on_nodes(chosen, measured.form, spread), names.get(law.id), share, record)
        in_steps = FAMILIES[law.id].nodes is phase_nodes
        found += _phase_laws(problem, chosen, known) if in_steps else [_law(problem, chosen, known)]
    found.sort(key=lambda one: -one[0].share)
    ranked = numbered([law for law, _ in found])
    tau_c_mnm = chosen.fit.values["tau_c_mnm"]
    return tuple(
        replace(law, sentence=law_sentence(law, tau_c_mnm, known))
        for law, (_, known) in zip(ranked, found, strict=True)
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """A law's values on its nodes (k,) and their covariance (k, k), its name, its share and its record."""

    law: Law
    values: Floats
    covariance: Floats
    name: str | None
    share: float
    record: str

    @property
    def sigma(self) -> Floats:
        """One standard deviation on the nodes (k,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def written(
        self, driver: Floats, curve: Floats, width: Floats, covered: Flags, *, unit: str, way: str = ""
    ) -> MeasuredLaw:
        """Return the law in the units of files: driver (n,), value (n,) and one standard deviation (n,)."""
        law = self.law
        return MeasuredLaw(
            effect=self.name,
            port=law.port,
            driver=law.driver,
            spring=law.spring or "both",
            unit=unit,
            share=self.share,
            driver_values=driver,
            value=curve,
            sigma=width,
            covered=covered,
            sentence="",
            id=law.id,
            way=way,
            record=self.record,
        )


def _law(problem: ActuatorProblem, chosen: Explanation, known: _Known) -> tuple[MeasuredLaw, OnNodes]:
    law, values, sigma = known.law, known.values, known.sigma
    factor, unit, converted = _scales(problem, chosen, law)
    if law.driver == "spring":
        mean, together = (float(np.mean(one[:TEMPERATURES])) for one in (values, sigma))
        driver, curve, width = np.array([0.0, 1.0]), np.array([0.0, mean]), np.array([0.0, together])
        covered = np.ones(2, np.bool_)
    else:
        counted = law.driver == "cycle"
        driver = law.nodes if counted or len(law.nodes) < 3 else np.linspace(law.nodes[0], law.nodes[-1], _POINTS)
        curve, width = np.interp(driver, *between_nodes(law.id, law.nodes, values)), np.interp(driver, law.nodes, sigma)
        covered = (driver >= law.covered[0]) & (driver <= law.covered[1])
    reached = np.flatnonzero((law.nodes >= law.covered[0]) & (law.nodes <= law.covered[1]))
    own_cycles = FAMILIES[law.id].nodes is cycle_nodes
    there = OnNodes(
        places=converted(law.nodes[reached]),
        values=values[reached] * factor,
        covariance=known.covariance[np.ix_(reached, reached)] * factor**2,
        counted="cycle" if own_cycles else "half-cycle",
        springs=() if own_cycles else problem.drive.cycles.springs,
    )
    return known.written(converted(driver), curve * factor, width * factor, covered, unit=unit), there


class _Window(NamedTuple):
    """Between which temperatures a wire without load transforms on its ``way``, ``heating`` or ``cooling``.

    ``branch`` is the first step of the window on the nodes of the phase law; ``reached_c`` are the lowest and the
    highest temperature in the record, minus the load's shift of the window.
    """

    way: str
    branch: float
    start_c: float
    end_c: float
    reached_c: tuple[float, float]

    @property
    def width_c(self) -> float:
        """Width of the window."""
        return abs(self.end_c - self.start_c)

    def temperatures_c(self, steps: Floats) -> Floats:
        """Return the temperatures (n,) at steps through the window."""
        return self.start_c + phase_places(steps) * (self.end_c - self.start_c)

    def reaches(self, temp_c: Floats) -> Flags:
        """Return whether the record covers temperatures (n,)."""
        low_c, high_c = self.reached_c
        return (temp_c >= low_c) & (temp_c <= high_c)


def _phase_laws(problem: ActuatorProblem, chosen: Explanation, known: _Known) -> list[tuple[MeasuredLaw, OnNodes]]:
    """Return the phase law on heating and on cooling: its lead in °C over the wire's temperature without load."""
    nominal = problem.model().nominal()
    plain = nominal | {name: value for name, value in chosen.fit.values.items() if name in nominal}
    rig, simulation = Rig.from_values(plain), problem.simulate(plain)
    up_c, down_c = (
        _reached_c(problem, simulation, rig.stress_per_torque / stress_per_k)
        for stress_per_k in (rig.c_austenite, rig.c_martensite)
    )
    heating = _phase_law(known, _Window("heating", 0.0, rig.a_start_c, rig.a_finish_c, up_c))
    cooling = _phase_law(known, _Window("cooling", BRANCH, rig.m_start_c, rig.m_finish_c, down_c))
    # The engine gives one share for both: it is divided by the ratio of their sums of squares.
    sizes = [float(np.sum(law.value**2)) for law, _ in (heating, cooling)]
    whole = sum(sizes)
    return [
        (replace(law, share=known.share * size / whole if whole > 0.0 else known.share), there)
        for (law, there), size in zip((heating, cooling), sizes, strict=True)
    ]


def _phase_law(known: _Known, window: _Window) -> tuple[MeasuredLaw, OnNodes]:
    """Return the phase law on heating or on cooling."""
    law, width_c = known.law, window.width_c
    # Temperatures increase in a file; on cooling they decrease from step to step.
    rising = slice(None, None, 1 if window.end_c > window.start_c else -1)

    own_steps = OWN_STEPS[rising]
    own = np.flatnonzero(np.isin(law.nodes, window.branch + OWN_STEPS))[rising]
    nodes_c, node_sigma = window.temperatures_c(own_steps), known.sigma[own]
    lead, sigma = _lead(own_steps, known.values[own], node_sigma)
    # The lead is limited by the ends of the transformation: where that reduces sigma, the covariance is reduced, too.
    kept = np.divide(sigma, node_sigma, out=np.zeros(len(own)), where=node_sigma > 0.0)
    covariance = known.covariance[np.ix_(own, own)] * np.outer(kept, kept) * width_c**2
    reached = window.reaches(nodes_c)
    there = OnNodes(nodes_c[reached], lead[reached] * width_c, covariance[np.ix_(reached, reached)])

    steps = np.linspace(OWN_STEPS[0], OWN_STEPS[-1], _POINTS)[rising]
    at, driver_c = window.branch + steps, window.temperatures_c(steps)
    ahead = np.interp(at, *between_nodes(law.id, law.nodes, known.values))
    lead, sigma = _lead(steps, ahead, np.interp(at, law.nodes, known.sigma))
    covered = window.reaches(driver_c)
    written = known.written(driver_c, lead * width_c, sigma * width_c, covered, unit="°C", way=window.way)
    return written, there


def _lead(steps: Floats, ahead: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Return a transformation's lead in windows, and one sigma; both are zero before its start and after its end."""
    place = phase_places(steps)
    low, lead, high = (
        np.clip(place + ahead + z * sigma, 0.0, 1.0) - np.clip(place, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)
    )
    return lead, 0.5 * (high - low)


def _reached_c(problem: ActuatorProblem, simulation: Simulation, per_torque: float) -> tuple[float, float]:
    """Return the range of the driven wires' temperatures, minus the shift of the transformation by stress.

    ``per_torque`` is this shift in K per N·m.
    """
    active = problem.drive.cycles.active
    torque, _ = by_role(active, simulation.torque_a_nm, simulation.torque_b_nm)
    temp_c, _ = by_role(active, simulation.temp_a_c, simulation.temp_b_c)
    unloaded_c = temp_c - torque * per_torque
    return float(unloaded_c.min()), float(unloaded_c.max())


def _scales(problem: ActuatorProblem, chosen: Explanation, law: Law) -> tuple[float, str, Callable[[Floats], Floats]]:
    """Return the conversion to the units of a law's file: factor on values, their unit, conversion of the driver."""
    values, spec = chosen.fit.values, problem.spec.values
    zero_deg = 0.0 if law.port == "reading" else values.get("zero_deg", spec.get("zero_deg", 0.0))
    shifts = {
        "angle_deg": 360.0 * problem.drive.turns + zero_deg, "winding_deg": 0.5 * spec["theta_p_deg"], "cycle": 1.0,
    }  # fmt: skip
    shift = shifts.get(law.driver, 0.0)

    def converted(driver: Floats) -> Floats:
        return 10.0**driver - 1.0 if law.driver == "dwell_s" else driver + shift

    if law.port == "friction":
        return values["tau_c_mnm"], "mN·m", converted
    return (1.0, law.unit, converted) if law.unit else (100.0, "%", converted)
