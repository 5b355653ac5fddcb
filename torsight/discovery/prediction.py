"""Predictions of a discovered model with their standard deviations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtr

from torsight.actuator.drive import Drive
from torsight.actuator.fitted import FittedModel
from torsight.actuator.simulation import Prediction
from torsight.core.errors import require_kind
from torsight.core.parameter import REACH
from torsight.core.progress import Progress, silent
from torsight.core.records import TemperatureLog
from torsight.core.units import DEG, Floats
from torsight.core.words.shown import span
from torsight.discovery.actuator.kept_rows import rest_mask
from torsight.discovery.actuator.temperature_errors import lasting_sums, smooth_errors, with_errors


@dataclass(frozen=True, eq=False, repr=False)
class PredictedAngle(Prediction):
    """Angles for the instants of a temperature log, with their standard deviations.

    Attributes
    ----------
    angle_rad, drive, simulation, rows
        See :class:`torsight.actuator.simulation.Prediction`.
    sigma_rad : (n,) float64
        Standard deviation of the angle; NaN where the model holds no uncertainty.
    """

    sigma_rad: Floats

    def facts(self) -> dict[str, str]:
        """Return rows, time, angle and its standard deviation."""
        known = np.isfinite(self.sigma_rad).any() or not np.isfinite(self.angle_rad).any()
        note = span(self.sigma_rad / DEG, "°") if known else "not known: give fitted_model doubt=fit.doubt"
        return {**super().facts(), "standard deviation": note}

    def _columns(self) -> dict[str, Any]:
        return {**super()._columns(), "angle_sigma_deg": self.sigma_rad / DEG}

    def _draw(self, axes: Any) -> None:
        angle_deg, reach_deg = self.angle_rad / DEG, REACH * self.sigma_rad / DEG
        axes.fill_between(
            self.simulation.time_s, angle_deg - reach_deg, angle_deg + reach_deg, alpha=0.25, label="95 %"
        )
        super()._draw(axes)


def predict_angle(model: FittedModel, log: TemperatureLog, *, start_angle_rad: float) -> Floats:
    """Return the angle (n,) in radians at the instants of a later temperature log, as a camera would read it."""
    return model.predict(log, start_angle_rad=start_angle_rad).angle_rad


def predict_with_sigma(
    model: FittedModel, log: TemperatureLog, *, start_angle_rad: float, where: str = "log", progress: Progress = silent
) -> PredictedAngle:
    """Predict the angle for a later temperature log, with its standard deviation at every instant.

    The variance is the sum of seven parts:

    - the noise of the reading from which the prediction starts, as large as in the record of the fit (the log is
      simulated from one standard deviation to either side: a motion may forget its start);
    - the springs' state at the start, by its prior, where the log starts neither as the record did nor where it ended;
    - the discrepancy of the model on held-out half-cycles, in motion and at rest;
    - the uncertainty of the values (the log is simulated one standard deviation to either side along every principal
      axis of their covariance);
    - the differences to other credible explanations of the record, weighted by their probabilities;
    - the noise of the log's temperatures: an error at the end of an incomplete heating stays in the angle;
    - in the rows beside a jump of a disk that breaks loose after a rest, the unknown instant of the jump.

    Where explanations predict different angles, the distribution is not normal: ±1.96 sigma then hold at least 95 % of
    it, and reach the prediction of each explanation.

    Parameters
    ----------
    model : FittedModel
        Model of ``fit`` or ``discover``.
    log : TemperatureLog
        Times and temperatures on the log's own clock.
    start_angle_rad : float
        Angle as read at the first row.
    where : str
        Name of the log in messages.
    progress : Progress
        Called after every simulation.

    Raises
    ------
    InputError, ConfigError
        When the log cannot drive the model.
    """
    require_kind(model, FittedModel, where="predict_with_sigma, model", do="read_model(path) gives one")
    prediction = model.predict(log, start_angle_rad=start_angle_rad, where=where)
    drive, simulation, rows = prediction.drive, prediction.simulation, prediction.rows
    angle = prediction.angle_rad
    if model.doubt is None:
        return PredictedAngle(angle, drive, simulation, rows, np.full(len(angle), np.nan))
    own, known = simulation.angle_rad, np.isfinite(angle)
    rest = rest_mask(simulation.time_s, angle / DEG, known) if known.any() else known
    motion_deg, rest_deg = model.doubt.left_deg
    square, others = (np.where(rest, rest_deg, motion_deg) * DEG) ** 2, list(_others(model, drive))
    square += model.jumps_rad(drive)[rows] ** 2
    alternatives = list(model.alternatives())
    whole = len(others) + len(alternatives)
    for done, (other, its_drive, weight) in enumerate(others):
        progress("uncertainty", done, whole)
        square += weight * (other.simulate(its_drive).angle_rad[rows] - own) ** 2
    apart = np.zeros((len(alternatives), len(own)))
    for done, (other, _) in enumerate(alternatives):
        progress("uncertainty", len(others) + done, whole)
        apart[done] = other.simulate(drive).angle_rad[rows] - own
    progress("uncertainty", whole, whole)
    sigma = _with_alternatives(np.sqrt(square), apart, np.array([share for _, share in alternatives]))
    return PredictedAngle(angle, drive, simulation, rows, np.where(known, sigma, np.nan))


def _with_alternatives(sigma: Floats, apart: Floats, share: Floats) -> Floats:
    """Return the standard deviation (n,) of a mixture of explanations that differ by ``apart`` (k, n).

    Each explanation has the standard deviation ``sigma`` (n,) and a share (k,) of the probability. The result is at
    least so large that the interval of 95 % holds 95 % of the mixture and reaches the prediction of each explanation.
    """
    if not len(share):
        return sigma
    furthest = np.max(np.abs(apart), axis=0)
    # The model's own prediction is one of the mixture, with no difference and the rest of the probability.
    middles, parts = np.vstack([np.zeros(len(sigma)), apart]), np.array([1.0 - share.sum(), *share])
    low, high = np.zeros(len(sigma)), furthest + 2.0 * REACH * sigma
    wanted = 2.0 * ndtr(REACH) - 1.0
    # Each bisection adds a bit to the half-width.
    for _ in range(np.finfo(np.float64).nmant):
        half = 0.5 * (low + high)
        held = parts @ (ndtr((half - middles) / sigma) - ndtr((-half - middles) / sigma))
        low, high = np.where(held < wanted, half, low), np.where(held < wanted, high, half)
    spread = np.maximum(share @ apart**2, (furthest / REACH) ** 2)
    return np.asarray(np.maximum(np.sqrt(sigma**2 + spread), high / REACH))


def _others(model: FittedModel, drive: Drive) -> Iterator[tuple[FittedModel, Drive, float]]:
    """Yield variants of values, start and temperatures: a model, a drive, and the weight of the squared difference."""
    for sides in model.neighbours():
        yield from ((side, drive, 0.5) for side in sides)
    if model.doubt is not None and model.doubt.reading_deg > 0.0:
        for off_rad in (DEG * model.doubt.reading_deg, -DEG * model.doubt.reading_deg):
            yield model, replace(drive, start_angle_rad=drive.start_angle_rad + off_rad), 0.5
    yield from ((other, drive, 0.5) for other in model.other_starts(drive.start_angle_rad))
    for errors in (smooth_errors(drive, seed=0), lasting_sums(drive)):
        yield from ((model, with_errors(drive, error), 1.0 / len(errors)) for error in errors)
