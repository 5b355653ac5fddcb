"""The fit of a known model, plain or with effects: the discovery's own, without its choice among models.

``torsight fit`` and ``torsight discover`` show the same values, torque and error of the plain model, because both use
the same fit.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.fit_result import FitResult, misfit, notes_of_drive, notes_of_fit, quiet, require_motion
from torsight.actuator.model import ActuatorModel
from torsight.actuator.stepping.cycle import fitted_cycle
from torsight.core.errors import require_kind
from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import Estimate
from torsight.core.progress import Progress, silent
from torsight.core.series import correlation_time, rms, share_explained
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.discover import (
    characterised,
    contradiction,
    fixed_values,
    own_parameters,
    pulls_of,
    single_reading_deg,
)
from torsight.discovery.inference.explanation import Explanation, covariance, estimates
from torsight.discovery.inference.noise import Stretches
from torsight.discovery.own.find import fit_known


@one_thread()
def fit_model(
    model: ActuatorModel,
    drive: Drive,
    *,
    progress: Progress = silent,
    where: str = "record",
) -> FitResult:
    """Fit all free parameters of a model to a record.

    The plain model is fitted first; then the effects and measured laws of the model are added one by one, each beside
    all earlier ones. The initial state of a record and the phase laws' own form are always fitted beside them.

    Parameters
    ----------
    model : ActuatorModel
        Plain or with effects.
    drive : Drive
        From ``model.prepare``.
    progress : Progress
        Called with the name of each step and how much of the step is done.
    where : str
        Name of the record in messages.

    Raises
    ------
    NoResultError
        When nothing moves.
    """
    require_kind(model, ActuatorModel, where="fit_model, model", do="ActuatorModel(read_actuator(path)) is one")
    require_kind(drive, Drive, where="fit_model, drive", do="model.prepare(read_merged(path)) gives one")
    require_motion(model, drive, where=where)
    forms = model.laws
    problem = ActuatorProblem(
        drive,
        model.spec,
        forms=forms,
        phase_law=model.phase_law,
        theta_l_deg=model.theta_l_deg,
    )
    named = [effect.id for effect in model.chosen if effect not in problem.always]
    found, settled = fit_known(problem, [*named, *(form.id for form in forms)], progress=progress)
    return _result(problem, found, converged=settled)


def _result(problem: ActuatorProblem, found: Explanation, *, converged: bool) -> FitResult:
    fit, drive = found.fit, problem.drive
    model = problem.model(fit.effects)
    spread = covariance(found)
    sigma = np.sqrt(np.diag(spread))
    values = {**model.nominal(), **fit.values}
    simulation = problem.simulate(fit.values, fit.effects)
    counted = drive.measured
    residual = np.where(counted, drive.angle_rad - simulation.angle_rad, np.nan)
    variance = found.likelihood.variance(found.residual)
    row_sigma = np.interp(drive.time_s, problem.time_s, np.sqrt(variance)) * DEG
    silent_about = quiet(fit.parameters, fit.values, sigma)
    rows = correlation_time([(residual / row_sigma)[counted]])
    # The variance contains the fitted discrepancy: the residual is compared with the inputs' noise alone.
    count = found.likelihood.count
    noise = float(count @ found.likelihood.noise**2)
    ratio = float(count @ found.residual**2) / max(noise, 1e-30)
    rmse_deg = rms(residual[counted]) / DEG
    floor_deg = float(np.sqrt(noise / count.sum()))
    pulled = contradiction(characterised(problem.spec, pulls_of(problem, found)))
    doubts = (
        misfit(drive, rmse_deg, found.likelihood.over_floor(found.residual), floor_deg),
        pulled,
        *notes_of_drive(drive),
    )
    attention = tuple(words for words in doubts if words)
    return FitResult(
        model=model,
        values=values,
        estimates=estimates(found) | _derived(model, found) | fixed_values(problem),
        free=tuple(p.name for p in fit.parameters),
        covariance=spread,
        simulation=simulation,
        residual_rad=residual,
        sigma_rad=row_sigma,
        correlation_rows=rows,
        variance_ratio=ratio,
        rmse_deg=rmse_deg,
        r2=share_explained(drive.angle_rad[counted], simulation.angle_rad[counted]),
        cycle=fitted_cycle(drive, simulation, values),
        converged=converged,
        silent_about=silent_about,
        notes=(*attention, *notes_of_fit(model, silent_about)),
        attention=attention,
        reading_deg=single_reading_deg(problem, found, Stretches.of(problem)),
    )


def _derived(model: ActuatorModel, found: Explanation) -> dict[str, Estimate]:
    """Return the derived values (for display) that follow from the parameters of the model's effects."""
    return {
        name: estimate
        for effect in model.chosen
        if effect.derived
        for name, estimate in own_parameters(effect, effect.parameters, found, seed=0).items()
    }
