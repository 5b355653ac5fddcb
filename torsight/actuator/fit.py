"""Least-squares fit of the actuator to a record, with characterised values as priors.

Minimised is Σ r²/(σ² κ) + Σ ((v − v₀)/s)²: residuals over their row's sigma, which counts how long errors last
(:mod:`torsight.actuator.record.weights`), divided by κ, the variance times correlation time of what is left beyond
that, and every value's distance from its prior. σ and κ follow from the fit before, in a few rounds. Intervals come
from the curvature at the minimum and so are inflated for correlation and misfit alike. Several starts guard against
local minima.

Only the ratios E : τ_c : C show in an angle–temperature curve. Where moduli carry an uncertainty and C does not, the
exact C fixes the scale; where all are uncertain the priors do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.drive import Drive
from torsight.actuator.fitting.estimates import covariance_of, estimates_of, quiet, share_explained
from torsight.actuator.fitting.fit_problem import Problem
from torsight.actuator.model import ActuatorModel, Simulation
from torsight.actuator.record.weights import correlation_rows, noisy_drives, spikes
from torsight.actuator.stepping.cycle import Cycle, fitted_cycle
from torsight.core.errors import NoResultError
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, Parameter
from torsight.core.progress import Progress, silent
from torsight.core.threads import one_thread
from torsight.core.units import DEG
from torsight.core.words.shown import Shown, draw_series
from torsight.core.words.wording import estimate as estimate_words

Array = NDArray[np.float64]

_FIRST_KAPPA: Final = 20.0
_ROUNDS: Final = 3
_SCREENED: Final = 2
_LEAST_MOTION: Final = 8.0
_SCALE_NOTE: Final = (
    "only the ratios of moduli, friction torque and stress influences show in an angle-temperature record: "
    "the torque's absolute size rests on the characterised values"
)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FitResult(Frozen, Shown):
    """A fitted model.

    Attributes
    ----------
    model : ActuatorModel
        What was fitted.
    values : mapping of str to float
        All parameters, the exact ones too, public names and units.
    estimates : mapping of str to Estimate
        The same with their sigmas and intervals; derived values of effects as well.
    free : tuple of str
        Names of the free parameters, in the order of ``covariance``.
    covariance : (p, p) float64
        Of the free parameters.
    simulation : Simulation
        The fitted angles.
    residual_rad : (n,) float64
        Measured less fitted angle; NaN where not measured or set aside.
    sigma_rad : (n,) float64
        Standard deviation of every row.
    correlation_rows : float
        Correlation time of the whitened residual.
    variance_ratio : float
        Variance of the whitened residual (1: the record's noise explains it).
    rmse_deg, r2 : float
        Over the rows that counted.
    cycle : Cycle
        θ_1, θ_2, θ_3, case and critical angle.
    converged : bool
        Whether the last round ended at a minimum.
    silent_about : tuple of str
        Parameters about which the record says nothing that was not known.
    notes : tuple of str
        What a person should know.
    """

    model: ActuatorModel
    values: Mapping[str, float]
    estimates: Mapping[str, Estimate]
    free: tuple[str, ...]
    covariance: Array
    simulation: Simulation
    residual_rad: Array
    sigma_rad: Array
    correlation_rows: float
    variance_ratio: float
    rmse_deg: float
    r2: float
    cycle: Cycle
    converged: bool
    silent_about: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def facts(self) -> dict[str, str]:
        """Return the error, whether the fit converged, and the free parameters."""
        free = {name: estimate_words(self.estimates[name].to_json()) for name in self.free}
        error = f"{self.rmse_deg:.3g}°, R² {self.r2:.4f}"
        effects = {"effects": ", ".join(self.model.effects)} if self.model.effects else {}
        return {"error": error, "converged": "yes" if self.converged else "no", **effects, **free}

    def __repr__(self) -> str:
        tau = f", friction torque {estimate_words(self.estimates['tau_c_mnm'].to_json())}"
        return f"FitResult(error {self.rmse_deg:.3g}°, R² {self.r2:.4f}{tau}, {len(self.free)} parameters)"

    def _columns(self) -> dict[str, Any]:
        return {
            "time_s": self.simulation.time_s,
            "fitted_deg": self.simulation.angle_rad / DEG,
            "residual_deg": self.residual_rad / DEG,
            "sigma_deg": self.sigma_rad / DEG,
        }

    def _draw(self, axes: Any) -> None:
        fitted_deg = self.simulation.angle_rad / DEG
        lines = {"measured": fitted_deg + self.residual_rad / DEG, "fitted": fitted_deg}
        draw_series(axes, self.simulation.time_s, lines, label="angle, °")

    def to_json(self) -> dict[str, Any]:
        """Return the content of ``fit.json``."""
        return {
            "parameters": {name: estimate.to_json() for name, estimate in self.estimates.items()},
            "rmse_deg": self.rmse_deg,
            "r2": self.r2,
            **self.cycle.to_json(),
            "converged": self.converged,
            "effects": list(self.model.effects),
            "silent_about": list(self.silent_about),
            "residual": {
                "variance_ratio": self.variance_ratio,
                "correlation_rows": self.correlation_rows,
                "rows": int(np.isfinite(self.residual_rad).sum()),
            },
            "notes": list(self.notes),
        }


@one_thread()
def fit_model(
    model: ActuatorModel,
    drive: Drive,
    *,
    use: NDArray[np.bool_] | None = None,
    starts: Sequence[Mapping[str, float]] | None = None,
    progress: Progress = silent,
    where: str = "record",
) -> FitResult:
    """Fit all free parameters of a model to a record.

    Parameters
    ----------
    model : ActuatorModel
        Plain or with effects.
    drive : Drive
        From ``model.prepare``.
    use : (n,) bool, optional
        Rows that count; the whole record is simulated either way.
    starts : sequence of mappings, optional
        Starting points by public name; by default a few of the friction and of the effects.
    progress : Progress
        Told how far the work is.
    where : str
        Name of the record in messages.

    Raises
    ------
    NoResultError
        When nothing moves.
    """
    require_motion(drive, where=where)
    parameters = model.parameters
    counted = np.isfinite(drive.angle_rad) & drive.known & ~spikes(drive)
    if use is not None:
        counted &= use
    scale = np.array([parameter.sigma or _own_scale(parameter) for parameter in parameters])
    problem = Problem(parameters, scale, model, drive, counted, noisy_drives(drive))
    u, weight, converged = _solve(problem, list(starts or default_starts(model, drive)), progress)
    return _result(problem, u, weight, converged=converged)


def require_motion(drive: Drive, *, where: str) -> None:
    """Refuse a record in which the actuator does not move.

    Raises
    ------
    NoResultError
        Saying how far it moved, and how warm the springs became.
    """
    angle = drive.angle_rad[np.isfinite(drive.angle_rad) & drive.known]
    # A row whose whole turn is not certain says so by its sigma: that is no noise of its reading.
    read = drive.angle_sigma_rad[drive.angle_sigma_rad < np.pi]
    noise = float(np.median(read)) if len(read) else 0.0
    low, high = np.quantile(angle, [0.002, 0.998]) if len(angle) else (0.0, 0.0)
    least = max(_LEAST_MOTION * noise, 0.5 * DEG)
    if high - low < least:
        warmest = max(float(drive.temp_a_c.max()), float(drive.temp_b_c.max()))
        raise NoResultError(
            "the actuator does not move",
            where=where,
            value=f"a range of {(high - low) / DEG:.2f}°, springs up to {warmest:.1f} °C",
            limit=f"{least / DEG:.2f}° or more",
            do="heat a spring through its transformation, and check that the markers of the moving stick are tracked",
        )


def default_starts(model: ActuatorModel, drive: Drive) -> list[dict[str, float]]:
    """Return starting points: nominal values with other frictions and zeros, and those that the effects name."""
    tau = model.nominal()["tau_c_mnm"]
    starts = [{"tau_c_mnm": factor * max(tau, 1e-3)} for factor in (1.0, 0.4, 2.0)]
    if any(parameter.name == "zero_deg" for parameter in model.parameters):
        starts.append({"zero_deg": middle_deg(drive)})
    starts += [dict(start) for effect in model.chosen for start in effect.starts]
    return starts


def middle_deg(drive: Drive) -> float:
    """Return the middle of what was read, degrees: the zero, if both strokes are alike."""
    low, high = np.nanquantile(drive.angle_rad, [0.005, 0.995])
    return float(low + high) / (2.0 * DEG)


def _own_scale(parameter: Parameter) -> float:
    if parameter.value != 0.0:
        return 0.25 * abs(parameter.value)
    span = parameter.upper - parameter.lower
    return 0.05 * span if np.isfinite(span) and span < 1e3 else 1.0


def _solve(problem: Problem, starts: list[Mapping[str, float]], progress: Progress) -> tuple[Array, Array, bool]:
    """Return the minimum, the rows' weights and whether it converged."""
    from scipy.optimize import least_squares

    lower, upper = problem.bounds()
    drive = problem.drive

    def inside(u: Array) -> Array:
        margin = np.minimum(1e-6, 0.25 * (upper - lower))
        return np.clip(u, lower + margin, upper - margin)

    def run(u: Array, weight: Array, evaluations: int) -> Any:
        return least_squares(
            problem.misfit, inside(u), problem.jacobian, bounds=(lower, upper), args=(weight,),
            ftol=1e-7, xtol=1e-7, gtol=1e-7, max_nfev=evaluations,
        )  # fmt: skip

    sigma = problem.row_sigma(problem.scaled(starts[0]))
    weight = 1.0 / (sigma * np.sqrt(_FIRST_KAPPA))
    rough = []
    for number, start in enumerate(starts):
        progress("fit: starting points", number, len(starts))
        rough.append(run(problem.scaled(start), weight, 6))
    progress("fit: starting points", len(starts), len(starts))
    rough.sort(key=lambda found: float(found.cost))
    best = min((run(item.x, weight, 60) for item in rough[:_SCREENED]), key=lambda found: float(found.cost))
    for number in range(_ROUNDS):
        progress("fit: rounds", number, _ROUNDS)
        angle = problem.model.simulate(drive, problem.values(best.x)).angle_rad
        sigma = problem.row_sigma(best.x)
        ratio, rows = _spread(problem, angle, sigma)
        weight = 1.0 / (sigma * np.sqrt(max(1.0, ratio * rows)))
        best = run(best.x, weight, 60)
    progress("fit: rounds", _ROUNDS, _ROUNDS)
    return best.x, weight, bool(best.status > 0)


def _spread(problem: Problem, angle: Array, sigma: Array) -> tuple[float, float]:
    """Return variance and correlation time of the whitened residual."""
    white = ((problem.drive.angle_rad - angle) / sigma)[problem.counted]
    return float(np.mean(white**2)), correlation_rows(white)


def _result(problem: Problem, u: Array, weight: Array, *, converged: bool) -> FitResult:
    model, drive, counted = problem.model, problem.drive, problem.counted
    values = {**model.nominal(), **problem.values(u)}
    simulation = model.simulate(drive, values)
    residual = np.where(counted, drive.angle_rad - simulation.angle_rad, np.nan)
    sigma = problem.row_sigma(u)
    ratio, rows = _spread(problem, simulation.angle_rad, sigma)
    covariance, known = covariance_of(problem, u, weight)
    estimates = estimates_of(model, values, problem, covariance, known)
    says_nothing_of = quiet(problem.parameters, np.where(known, np.sqrt(np.diag(covariance)), np.nan))
    return FitResult(
        model=model,
        values=values,
        estimates=estimates,
        free=problem.names,
        covariance=covariance,
        simulation=simulation,
        residual_rad=residual,
        sigma_rad=sigma,
        correlation_rows=rows,
        variance_ratio=ratio,
        rmse_deg=float(np.sqrt(np.mean(residual[counted] ** 2))) / DEG,
        r2=share_explained(drive.angle_rad[counted], simulation.angle_rad[counted]),
        cycle=fitted_cycle(drive, simulation, values),
        converged=converged,
        silent_about=says_nothing_of,
        notes=notes_of_fit(model, says_nothing_of, ratio, rows),
    )


def notes_of_fit(model: ActuatorModel, quiet: tuple[str, ...], ratio: float, rows: float) -> tuple[str, ...]:
    """Return what a person should know of a fit that leaves so many times the noise's variance, so correlated."""
    uncertain = (
        f"the residual is {np.sqrt(ratio):.1f} times what the noise of angle and temperatures makes, and one in "
        f"{rows:.0f} rows of it counts as independent; the intervals allow for both"
    )
    notes = [_SCALE_NOTE, uncertain]
    scale = {"E_A_gpa", "E_M_gpa", "E_S_gpa", "C_A_mpa_per_k", "C_M_mpa_per_k"}
    if scale <= set(model.spec.uncertainty):
        notes.append("moduli and stress influences are all uncertain: their common scale is fixed by the priors alone")
    if quiet:
        notes.append(f"the record says nothing new about {', '.join(quiet)}")
    return tuple(notes)
