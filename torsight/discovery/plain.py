"""The plain model of a record: what the discovery starts from, as a fit of its own.

``torsight fit`` and ``torsight discover`` show the same values, torque and error of the plain model, because both are
made here.
"""

from __future__ import annotations

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.fit import FitResult, notes_of_fit, require_motion
from torsight.actuator.fitting.estimates import quiet, share_explained
from torsight.actuator.record.weights import correlation_rows
from torsight.actuator.spec import ActuatorSpec
from torsight.actuator.stepping.cycle import fitted_cycle
from torsight.core.progress import Progress, silent
from torsight.core.threads import one_thread
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.discover import errors_of, fixed_values
from torsight.discovery.inference.explanation import Explanation, covariance
from torsight.discovery.inference.search import Search
from torsight.discovery.report import estimates_of
from torsight.discovery.settings import Settings


@one_thread()
def fit_plain(drive: Drive, spec: ActuatorSpec, *, progress: Progress = silent, where: str = "record") -> FitResult:
    """Fit the plain model to a record as the discovery does.

    Parameters
    ----------
    drive : Drive
        The prepared record.
    spec : ActuatorSpec
        Characterised values with their uncertainties.
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
    problem = ActuatorProblem(drive, spec)
    search = Search(problem, settings=Settings(), progress=progress)
    return _result(problem, search.plain(), search)


def _result(problem: ActuatorProblem, base: Explanation, search: Search) -> FitResult:
    model, drive, fit = problem.model(), problem.drive, base.fit
    spread = covariance(base)
    sigma = np.sqrt(np.diag(spread))
    errors = errors_of(problem, base, None)
    values = {**model.nominal(), **fit.values}
    simulation = problem.simulate(fit.values)
    counted = np.isfinite(drive.angle_rad) & drive.known
    residual = np.where(counted, drive.angle_rad - simulation.angle_rad, np.nan)
    variance = search.likelihood.variance(base.residual)
    row_sigma = np.interp(drive.time_s, problem.time_s, np.sqrt(variance)) * DEG
    white = (residual / row_sigma)[counted]
    silent_about = quiet(fit.parameters, sigma)
    ratio, rows = float(np.mean(white**2)), correlation_rows(white)
    return FitResult(
        model=model,
        values=values,
        estimates=estimates_of(fit.parameters, fit.solution.x, sigma) | fixed_values(problem),
        free=tuple(p.name for p in fit.parameters),
        covariance=spread,
        simulation=simulation,
        residual_rad=residual,
        sigma_rad=row_sigma,
        correlation_rows=rows,
        variance_ratio=ratio,
        rmse_deg=errors.rmse_train_deg,
        r2=share_explained(drive.angle_rad[counted], simulation.angle_rad[counted]),
        cycle=fitted_cycle(drive, simulation, values),
        converged=search.has_settled(base),
        silent_about=silent_about,
        notes=notes_of_fit(model, silent_about, ratio, rows),
    )
