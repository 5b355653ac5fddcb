r"""A marker shifts on its stick, or the camera is bumped.

.. math:: φ_{read} = φ + s \, H(t − t_s)

s step of the reading (°), t_s its time on the film's clock (s). A row is a mean over half a second, or over the
distance to its nearer neighbour where that is longer. A row within which the step occurs has a share of the step, which
determines the step's time. Predicted residual: a permanent jump, at no particular angle or temperature. The start angle
of a later record includes the step, which remains. Source: change-point in a measured level, e.g. Basseville and
Nikiforov, Detection of Abrupt Changes (1993), ch. 2.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from torsight.actuator.drive import Drive
from torsight.actuator.effects import Effect, Parameter, Ports, Values
from torsight.core.series import usual_step
from torsight.core.units import DEG, Floats

_BESIDE: Final = 6
"""Rows on either side of a step that are fitted: a parabola and a step leave eight of twelve degrees of freedom for the
noise."""
_LASTS_S: Final = (0.0, 5.0, 20.0)
"""Durations for which a marker may slide."""
_LEAST_STEP_RAD: Final = 0.1 * DEG
"""A difference of no importance: least standard deviation of a step."""


def step(time_s: Floats, *, at_s: float) -> Floats:
    """Return the share, 0 to 1, of a step at ``at_s`` that each row (n,), averaged over 0.5 s or more, contains."""
    half_s = np.full(len(time_s), 0.25)
    if len(time_s) > 1:
        half_gap_s = 0.5 * (time_s[1:] - time_s[:-1])
        half_s[1:-1] = np.maximum(np.minimum(half_gap_s[:-1], half_gap_s[1:]), 0.25)
        half_s[[0, -1]] = np.maximum(half_gap_s[[0, -1]], 0.25)
    return np.clip((time_s - at_s) / (2.0 * half_s) + 0.5, 0.0, 1.0)


def seen(drive: Drive, fitted_s: Floats, values: Values) -> float:
    r"""Return the log-likelihood ratio of a step, at most zero, from the single rows around the step.

    A fit uses means over many rows; the single rows show whether there is a step from one to the next. A least-squares
    fit of a parabola and a step ŝ of variance v to the rows on either side gives
    :math:`\ln Λ = (ŝ^2 - (ŝ - s)^2) / 2 v`. The fit determines the time of the step to the neighbouring fitted rows,
    and a marker may slide for a while: the largest Λ over times and durations counts. Where rows are missing around one
    of these times, a step cannot be excluded, and the result is zero.
    """
    time_s, angle_rad = drive.time_s, drive.angle_rad
    usual_s = usual_step(time_s)
    k = int(np.searchsorted(fitted_s, values["slip_time_s"]))
    first, last = fitted_s[max(k - 2, 0)], fitted_s[min(k + 1, len(fitted_s) - 1)]
    reach_s = _BESIDE * usual_s + 1.5 * _LASTS_S[-1]
    good = np.isfinite(angle_rad) & (time_s > first - reach_s) & (time_s < last + reach_s)
    t, angle = time_s[good], angle_rad[good]
    height, most = values["slip_deg"] * DEG, -np.inf
    for lasts_s in _LASTS_S:
        beside_s = max(_BESIDE * usual_s, lasts_s)
        for at_s in np.arange(first, last, max(usual_s, 0.25 * lasts_s)):
            off_s = np.abs(t - at_s) - 0.5 * lasts_s
            around = (off_s > 0.0) & (off_s <= beside_s)
            before = around & (t < at_s)
            if min(np.count_nonzero(before), np.count_nonzero(around & ~before)) < _BESIDE - 1:
                return 0.0
            found, variance = _step_beside(t[around] - at_s, angle[around])
            most = max(most, (found**2 - (found - height) ** 2) / (2.0 * variance))
            if most >= 0.0:
                return 0.0
    return most if np.isfinite(most) else 0.0


def _step_beside(time_s: Floats, angle_rad: Floats) -> tuple[float, float]:
    """Return a step at time zero, fitted together with a parabola to a few rows, and the step's variance."""
    x = time_s / float(np.max(np.abs(time_s)))
    columns = np.column_stack([np.ones_like(x), x, x**2, x > 0.0])
    inverse = np.linalg.inv(columns.T @ columns)
    fitted = inverse @ columns.T @ angle_rad
    residual = angle_rad - columns @ fitted
    # The parabola's misfit is correlated over the rows on one side: they count as one error, not as many.
    noise = float(residual @ residual) / (len(x) - columns.shape[1])
    return float(fitted[-1]), max(1.0, float(inverse[-1, -1])) * noise + _LEAST_STEP_RAD**2


def apply(ports: Ports, values: Values) -> Ports:
    """Add the step to the camera's reading; in later records it is present from the start."""
    height = values["slip_deg"] * DEG
    at_s = -np.inf if ports.history.after_record else values["slip_time_s"]
    return ports.with_reading(lambda phi_rad, time_s: phi_rad + height * step(time_s, at_s=at_s))


EFFECT = Effect(
    id="marker_slip",
    family="camera",
    acts_on="reading",
    title="a marker slipped, or the camera was bumped",
    parameters=(
        Parameter("slip_deg", 1.0, "°", -180.0, 180.0, null=0.0, symbol="s", title="step of the reading"),
        Parameter("slip_time_s", 0.0, "s", -1e7, 1e7, symbol="t_s", title="time of the step"),
    ),
    apply=apply,
    event="slip_time_s",
    seen=seen,
    laws=("reading_time_s",),
)
