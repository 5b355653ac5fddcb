"""The columns of ``curves.csv``: measurements, both models, residuals, half-cycle and phase of each row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from torsight.actuator.fitted import FittedModel
from torsight.actuator.record.log_noise import NEGLIGIBLE_C
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.fitting import Fit


def curve_columns(
    problem: ActuatorProblem, plain: Fit, extended: FittedModel, held_out: Sequence[int]
) -> dict[str, NDArray[np.generic]]:
    """Return the columns, one row per row of the drive; angles in degrees as read, NaN where not measured."""
    drive = problem.drive
    before = problem.simulate(plain.values, plain.effects)
    after = extended.model.simulate(drive, extended.values, history=problem.history)
    observed = drive.angle_rad / DEG
    ahead_deg = 360.0 * drive.turns
    rate, _ = drive.rates_by_role()
    # A temperature that advances by no more than negligible noise a second stands.
    direction = np.where(np.abs(rate) < NEGLIGIBLE_C, "rest", np.where(rate > 0.0, "heating", "cooling"))
    return {
        "time_s": drive.time_s,
        "angle_deg": observed + ahead_deg,
        "angle_sigma_deg": drive.angle_sigma_rad / DEG,
        "plain_deg": before.angle_rad / DEG + ahead_deg,
        "extended_deg": after.angle_rad / DEG + ahead_deg,
        "residual_before_deg": observed - before.angle_rad / DEG,
        "residual_after_deg": observed - after.angle_rad / DEG,
        "temp_a_c": drive.temp_a_c,
        "temp_b_c": drive.temp_b_c,
        "half_cycle": np.asarray(drive.cycles.half, np.int64),
        "active": np.where(drive.cycles.active == 0, "a", "b"),
        "direction": direction,
        "held_out": np.isin(drive.cycles.half, np.asarray(held_out, np.int64)).astype(np.int8),
        "xi_a": after.xi_a,
        "xi_b": after.xi_b,
    }
