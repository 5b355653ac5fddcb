"""The measured laws of an answer as people read them: files' units, a curve with its uncertainty, one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.actuator.laws import between_nodes
from torsight.core.law import Law
from torsight.core.units import Floats
from torsight.discovery.actuator.law_words import OnNodes, law_sentence
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.explanation import Explanation, joint_covariance
from torsight.discovery.inference.measure import Measured
from torsight.discovery.measured_law import MeasuredLaw, numbered

_POINTS: Final = 121
_OWN_CYCLES: Final = "phase_cycle"
"""The law that counts either spring's own cycles; the others count half-cycles."""
_TEMPERATURES: Final = 4
"""How many of the values in which the springs may differ are transformation temperatures."""


@dataclass(frozen=True, slots=True)
class _Scales:
    """From a law's own units to those of its file: a factor on values, a unit, and what happens to the driver."""

    factor: float
    unit: str
    driver: Callable[[Floats], Floats]


def measured_laws(
    problem: ActuatorProblem,
    chosen: Explanation,
    shares: Mapping[str, float],
    names: Mapping[str, str],
) -> tuple[MeasuredLaw, ...]:
    """Return the laws of an explanation, strongest first.

    Parameters
    ----------
    problem : ActuatorProblem
        The record.
    chosen : Explanation
        Whose laws.
    shares : mapping of str to float
        Law to its share of what is explained.
    names : mapping of str to str
        Law to the effect whose name it carries; laws without a name are not in it.
    """
    spread = joint_covariance(chosen)
    found = [_law(problem, chosen, item, spread, shares, names) for item in chosen.laws]
    found.sort(key=lambda one: -one[0].share)
    laws = numbered([law for law, _ in found])
    tau_c_mnm = chosen.fit.values["tau_c_mnm"]
    return tuple(
        replace(law, sentence=law_sentence(law, tau_c_mnm, known)) for law, (_, known) in zip(laws, found, strict=True)
    )


def _law(
    problem: ActuatorProblem,
    chosen: Explanation,
    item: Measured,
    spread: Floats,
    shares: Mapping[str, float],
    names: Mapping[str, str],
) -> tuple[MeasuredLaw, OnNodes]:
    law, form = item.law, item.form
    places = [[p.name for p in chosen.fit.parameters].index(name) for name in form.names]
    values = form.values([chosen.fit.values[name] for name in form.names])
    covariance = form.basis @ spread[np.ix_(places, places)] @ form.basis.T
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if law.driver == "spring":
        mean = float(np.mean(values[:_TEMPERATURES]))
        together = float(np.mean(sigma[:_TEMPERATURES]))
        driver, curve, width = np.array([0.0, 1.0]), np.array([0.0, mean]), np.array([0.0, together])
        scales, covered = _Scales(1.0, law.unit, lambda x: x), np.ones(2, np.bool_)
    else:
        counted = law.driver == "cycle"
        driver = law.nodes if counted or len(law.nodes) < 3 else np.linspace(law.nodes[0], law.nodes[-1], _POINTS)
        curve, width = np.interp(driver, *between_nodes(law.id, law.nodes, values)), np.interp(driver, law.nodes, sigma)
        scales = _scales(problem, chosen, law)
        covered = (driver >= law.covered[0]) & (driver <= law.covered[1])
    reached = np.flatnonzero((law.nodes >= law.covered[0]) & (law.nodes <= law.covered[1]))
    known = OnNodes(
        places=scales.driver(law.nodes[reached]),
        values=values[reached] * scales.factor,
        covariance=covariance[np.ix_(reached, reached)] * scales.factor**2,
        counted="cycle" if law.id == _OWN_CYCLES else "half-cycle",
        springs=problem.drive.cycles.springs if law.id != _OWN_CYCLES else (),
    )
    told = MeasuredLaw(
        effect=names.get(law.id),
        port=law.port,
        driver=law.driver,
        spring=law.spring or "both",
        unit=scales.unit,
        share=float(shares.get(law.id, 1.0)),
        driver_values=scales.driver(driver),
        value=curve * scales.factor,
        sigma=width * scales.factor,
        covered=covered,
        sentence="",
        id=law.id,
    )
    return told, known


def _scales(problem: ActuatorProblem, chosen: Explanation, law: Law) -> _Scales:
    port, driver = law.port, law.driver
    values = chosen.fit.values
    ahead_deg = 360.0 * problem.drive.turns
    zero_deg = values.get("zero_deg", problem.spec.values.get("zero_deg", 0.0))
    drivers: dict[str, Callable[[Floats], Floats]] = {
        "angle_deg": lambda x: x + ahead_deg + (0.0 if port == "reading" else zero_deg),
        "winding_deg": lambda x: x + 0.5 * problem.spec.values["theta_p_deg"],
        "dwell_s": lambda x: 10.0**x - 1.0,
        "cycle": lambda x: x + 1.0,
    }
    moved = drivers.get(driver, lambda x: x)
    if port == "friction":
        return _Scales(values["tau_c_mnm"], "mN·m", moved)
    if port == "phase":
        return _Scales(100.0, "%", moved)
    return _Scales(1.0, law.unit, moved)
