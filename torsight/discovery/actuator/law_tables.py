"""The measured laws of an answer as people read them: files' units, a curve with its uncertainty, one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.actuator.laws import between_nodes
from torsight.core.law import Law
from torsight.core.units import Floats
from torsight.core.words.wording import number, variable_name
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.explanation import Explanation, joint_covariance
from torsight.discovery.inference.measure import Measured
from torsight.discovery.measured_law import MeasuredLaw, numbered

_POINTS: Final = 121
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
    return numbered(sorted(found, key=lambda law: -law.share))


def _law(
    problem: ActuatorProblem,
    chosen: Explanation,
    item: Measured,
    spread: Floats,
    shares: Mapping[str, float],
    names: Mapping[str, str],
) -> MeasuredLaw:
    law, form = item.law, item.form
    places = [[p.name for p in chosen.fit.parameters].index(name) for name in form.names]
    values = form.values([chosen.fit.values[name] for name in form.names])
    sigma = np.sqrt(np.maximum(np.diag(form.basis @ spread[np.ix_(places, places)] @ form.basis.T), 0.0))
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
    )
    return replace(told, sentence=law_sentence(told, chosen.fit.values["tau_c_mnm"]))


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


_WHAT: Final = {
    "torque": "a stray torque",
    "friction": "friction torque",
    "reading": "the reading's error",
    "temperature": "the wire is warmer than its sensor says by",
    "winding": "a spring's torque beside its own",
    "phase": "the recoverable angle",
}
_CLOCK: Final = "what the temperature log's clock is ahead by"
_UNITS: Final = {
    "angle_deg": "°",
    "winding_deg": "°",
    "angle_rate_deg_s": "°/s",
    "temp_active_c": " °C",
    "temp_passive_c": " °C",
    "temp_rate_c_s": " °C/s",
    "time_s": " s",
    "dwell_s": " s",
}


def law_sentence(law: MeasuredLaw, tau_c_mnm: float) -> str:
    """Return a law in one sentence, over what the record covered."""
    driver, value = law.driver_values[law.covered], law.value[law.covered]
    if law.driver == "spring":
        way = "higher" if value[-1] > 0.0 else "lower"
        return f"spring B's transformation temperatures are {number(abs(value[-1]))} °C {way} than spring A's"
    what = _CLOCK if law.unit == "s" else _WHAT[law.port]
    unit = _UNITS.get(law.driver, "")
    over = f"between {number(driver[0])} and {number(driver[-1])}{unit}"
    if law.driver == "cycle":
        over = f"from half-cycle {driver[0]:.0f} to {driver[-1]:.0f}"
    if law.driver == "direction":
        return f"friction torque is {number(value[-1] - value[0])} mN·m higher when the angle rises than when it falls"
    monotone = abs(value[-1] - value[0]) > 0.8 * float(np.ptp(value))
    if law.port in ("friction", "phase") and monotone:
        whole = tau_c_mnm if law.port == "friction" else 100.0
        share = (whole + value[-1]) / max(whole + value[0], 1e-9) - 1.0
        return f"{what} {'rises' if share > 0 else 'falls'} by {100.0 * abs(share):.0f} % {over}"
    if law.port == "friction":
        value = value + tau_c_mnm
    low, high = float(value.min()), float(value.max())
    size = f"from {number(low)} to {number(high)} {law.unit}"
    return f"{what} goes {size} over {variable_name(law.driver)}, {over}"
