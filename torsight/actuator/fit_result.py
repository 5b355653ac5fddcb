"""The result of a fit of the actuator to a record, the requirements on a record, and the notes on a fit.

The fit itself, :func:`torsight.actuator.fit_model`, is part of discovery (:mod:`torsight.discovery.model_fit`).

An angle–temperature curve determines only the ratios E : τ_c : C. Where moduli have an uncertainty and C has none, the
exact C fixes the scale; where all are uncertain the priors do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from torsight.actuator.doubt import Doubt
from torsight.actuator.drive import Drive
from torsight.actuator.model import ActuatorModel
from torsight.actuator.simulation import Simulation
from torsight.actuator.stepping.cycle import Cycle
from torsight.core.errors import InputError, NoResultError
from torsight.core.frozen import Frozen
from torsight.core.parameter import Estimate, Parameter, estimates_to_json
from torsight.core.series import APART, extent
from torsight.core.units import DEG, Floats
from torsight.core.words.plausible import require_turns
from torsight.core.words.shown import Shown, draw_series
from torsight.core.words.wording import counted, number, unexplained
from torsight.core.words.wording import estimate as estimate_words

_SILENT: Final = 0.9
"""Ratio of posterior to prior standard deviation above which the record contains no information on a value: it is less
than a fifth of all information (1 − 0.9² = 0.19)."""
_SIMILAR: Final = 2.0
"""Factor within which two ranges of the angle count as equal; a choice: degrees and radians differ by 57."""
_SCALE_NOTE: Final = (
    "only the ratios of moduli, friction torque and stress coefficients show in an angle-temperature record: "
    "the torque's absolute size rests on the characterised values"
)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FitResult(Frozen, Shown):
    """A fitted model.

    Attributes
    ----------
    model : ActuatorModel
        The fitted model.
    values : mapping of str to float
        All parameters, including the exact ones, public names and units.
    estimates : mapping of str to Estimate
        The parameters and derived values of effects, with standard deviations and intervals.
    free : tuple of str
        Names of the free parameters, in the order of ``covariance``.
    covariance : (p, p) float64
        Covariance of the free parameters.
    simulation : Simulation
        The fitted angles.
    residual_rad : (n,) float64
        Measured minus fitted angle; NaN where not measured or excluded.
    sigma_rad : (n,) float64
        Standard deviation of every row.
    correlation_rows : float
        Correlation time of the whitened residual.
    variance_ratio : float
        Mean square residual divided by the mean square that the noise of readings and temperatures accounts for, each
        independent reading counted once (1: the noise explains the residual); its root is the residual in noise floors.
    rmse_deg, r2 : float
        Root mean square error and share of the variance explained, over the fitted rows.
    cycle : Cycle
        θ_1, θ_2, θ_3, case and critical angle.
    converged : bool
        Whether the last round ended at a minimum.
    silent_about : tuple of str
        Parameters about which the record contains no new information.
    notes : tuple of str
        Sentences for the reader.
    attention : tuple of str
        The first of the notes: those that state a problem of the fit.
    reading_deg : float
        Standard deviation of a single reading of the angle.
    """

    model: ActuatorModel
    values: Mapping[str, float]
    estimates: Mapping[str, Estimate]
    free: tuple[str, ...]
    covariance: Floats
    simulation: Simulation
    residual_rad: Floats
    sigma_rad: Floats
    correlation_rows: float
    variance_ratio: float
    rmse_deg: float
    r2: float
    cycle: Cycle
    converged: bool
    silent_about: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    attention: tuple[str, ...] = ()
    reading_deg: float = 0.0

    @property
    def explains_nothing(self) -> bool:
        """Whether the model is no better than a constant angle."""
        return not self.r2 > 0.0

    @property
    def doubt(self) -> Doubt:
        """The model's uncertainty from this fit alone; passed to ``fitted_model``, it gives predictions an interval."""
        return Doubt(self.free, self.covariance, self.rmse_deg, reading_deg=self.reading_deg)

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
            "parameters": estimates_to_json(self.estimates),
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
            "attention": list(self.attention),
        }


def require_motion(model: ActuatorModel, drive: Drive, *, where: str) -> None:
    """Refuse a record in which the actuator does not move, or moves as no such actuator can."""
    angle = drive.angle_rad[drive.measured]
    # A row whose whole turn is uncertain has a large sigma, which is no noise of the reading.
    certain = drive.angle_sigma_rad < np.pi
    read = drive.angle_sigma_rad[certain]
    noise = float(np.median(read)) if len(read) else 0.0
    low, high = np.quantile(angle, [0.002, 0.998]) if len(angle) else (0.0, 0.0)
    least = max(APART * noise, 0.5 * DEG)
    if high - low < least:
        warmest = max(float(drive.temp_a_c.max()), float(drive.temp_b_c.max()))
        raise NoResultError(
            "the actuator does not move",
            where=where,
            value=f"a range of {(high - low) / DEG:.2f}°, springs up to {warmest:.1f} °C",
            limit=f"{least / DEG:.2f}° or more",
            do="heat a spring through its transformation, and check that the markers of the moving stick are tracked",
        )
    require_turns(np.where(certain, drive.angle_rad, np.nan), drive.time_s, where=where)
    moved, against = _moved_and_against(drive)
    if against > moved:
        raise InputError(
            "the actuator turns against the spring that is heated",
            where=f"{where}, columns angle_deg, temp_a_c, temp_b_c",
            value=f"{against / DEG:.0f}° against it, {moved / DEG:.0f}° with it",
            limit="heating A turns the angle down, heating B up",
            do="exchange the columns of A and B, or change the sign of the angle",
        )
    plain = float(np.ptp(model.angle_rad(drive, model.nominal())))
    if plain < _SIMILAR * (high - low) / DEG < _SIMILAR**2 * plain:
        raise InputError(
            "the angle seems to be in radians",
            where=f"{where}, column angle_deg",
            value=f"a range of {(high - low) / DEG:.1f}",
            limit=f"about {plain / DEG:.0f}° by the characterised values",
            do="give the angle in degrees",
        )


def _moved_and_against(drive: Drive) -> tuple[float, float]:
    """Return the motion, rad, in the driven spring's direction while it was heated, and the motion against it."""
    drives_up = drive.cycles.active[1:] == 1
    warmer = np.where(drives_up, np.diff(drive.temp_b_c), np.diff(drive.temp_a_c)) > 0.0
    motion = np.where(warmer, np.nan_to_num(np.diff(drive.angle_rad)), 0.0) * np.where(drives_up, 1.0, -1.0)
    strokes = np.bincount(drive.cycles.half[1:], weights=motion)
    return float(np.sum(np.maximum(strokes, 0.0))), float(np.sum(np.maximum(-strokes, 0.0)))


def middle_deg(drive: Drive) -> float:
    """Return the middle of the range of the readings, degrees: the zero, if both springs' strokes are equal."""
    return sum(extent(drive.angle_rad)) / (2.0 * DEG)


def quiet(parameters: Sequence[Parameter], values: Mapping[str, float], sigma: Floats) -> tuple[str, ...]:
    """Return the names of the parameters about which the record contains no new information.

    ``sigma`` (p,) holds their standard deviations, NaN where neither record nor prior determines them. A value that
    moved by more than its prior's standard deviation counts as informed by the record, however uncertain it remains.
    """
    return tuple(
        parameter.name
        for parameter, own in zip(parameters, sigma.tolist(), strict=True)
        if np.isnan(own)
        or (
            parameter.sigma is not None
            and own > _SILENT * parameter.sigma
            and abs(values[parameter.name] - parameter.value) <= parameter.sigma
        )
    )


def misfit(drive: Drive, rmse_deg: float, times: float, floor_deg: float) -> str:
    """Return the note on a fit whose residual is far above the noise; else an empty string.

    ``times`` is the residual in noise floors, ``floor_deg`` the root mean square of the noise of readings and
    temperatures.
    """
    doubt = unexplained(times)
    if not doubt:
        return ""
    low, high = extent(drive.angle_rad[drive.measured])
    share = 100.0 * rmse_deg * DEG / (high - low)
    return (
        f"{doubt} A rest counts there as one reading, however long; the error of all rows is {number(rmse_deg)}° rms, "
        f"{number(share, 2)} % of the range of motion, and the noise of angle and temperatures accounts for "
        f"{number(floor_deg, 2)}°. 'torsight discover' names what the model lacks; "
        "where the error is a large part of that range, check the actuator file first"
    )


def taken_as_exact(names: Sequence[str]) -> str:
    """Return the note on characterised values without an uncertainty."""
    return f"{', '.join(names)} have no uncertainty and are taken as exact: their errors would look like an effect"


def notes_of_drive(drive: Drive) -> list[str]:
    """Return the notes on parts of a record that are left out or that the model cannot follow."""
    return [*_left_out(drive), *_begun_within(drive)]


def _left_out(drive: Drive) -> list[str]:
    """Return the notes on measured angles and temperatures that are left out, if there are any."""
    angles, readings = counted(drive.wrong_angles, "measured angle"), counted(drive.wrong_readings, "temperature")
    notes = {
        f"{angles}, further off the motion of the neighbouring frames than noise explains": drive.wrong_angles,
        f"{readings}, which jump and jump back as no wire does": drive.wrong_readings,
    }
    return [f"Left out as wrong: {note}" for note, count in notes.items() if count]


def _begun_within(drive: Drive) -> list[str]:
    """Return the note on a record that begins within a transformation, if this one does."""
    if drive.left_out_s is None:
        return []
    rest = f"its first {drive.left_out_s:.0f} s, until both springs are cold, are left out"
    if drive.left_out_s == 0.0:
        rest = "as no spring is heated once both are cold, the angle may have any error; start before the heating"
    return [f"The record begins when a spring is already hot, and does not show how far it had transformed: {rest}"]


def nothing_explained(what: str, r2: float, *, where: str, more: str = "") -> NoResultError:
    """Return the error for a model that explains nothing of the record named by ``where``."""
    return NoResultError(
        what,
        where=where,
        value=f"R² {number(r2, 2)}{more}",
        limit="R² above 0",
        do="check values and units in the actuator file (tau_c_mnm in mN·m, C_A_mpa_per_k and C_M_mpa_per_k in MPa/K, "
        "moduli in GPa), and give those that are not well known an [uncertainty]: without one they are exact",
    )


def turns(result: FitResult) -> str:
    """Return a clause with the ranges of the fitted model and of the actuator."""
    fitted_rad = result.simulation.angle_rad
    read_rad = fitted_rad + result.residual_rad
    turned_deg, read_deg = (float(np.ptp(one[np.isfinite(one)])) / DEG for one in (fitted_rad, read_rad))
    return f"the model turns by {turned_deg:.0f}°, the actuator by {read_deg:.0f}°"


def notes_of_fit(model: ActuatorModel, quiet: tuple[str, ...]) -> tuple[str, ...]:
    """Return the further notes on a fit; ``quiet`` are parameters about which the record says nothing new."""
    notes = [_SCALE_NOTE]
    scale = {"E_A_gpa", "E_M_gpa", "E_S_gpa", "C_A_mpa_per_k", "C_M_mpa_per_k"}
    if scale <= set(model.spec.uncertainty):
        notes.append(
            "moduli and stress coefficients are all uncertain: their common scale is fixed by the priors alone"
        )
    # Only characterised values: the others that are always fitted had no value to confirm.
    characterised = [name for name in quiet if name in model.spec.uncertainty]
    if characterised:
        notes.append(f"the record says nothing new about {', '.join(characterised)}")
    return tuple(notes)
