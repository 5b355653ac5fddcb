"""The uncertainty of a fitted model, as stored in its file: the basis of the standard deviations of predictions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from torsight.actuator.laws import laws_from
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_names, get_number, get_table
from torsight.core.frozen import Frozen
from torsight.core.law import LawForm
from torsight.core.units import Floats
from torsight.core.words.plausible import MOST_TURNED_DEG


@dataclass(frozen=True, slots=True)
class Alternative(Frozen):
    """Another explanation of the same record: its effects, all its values in public units, and its laws.

    ``share`` is its share of the probability, which the model and all alternatives divide among them.
    """

    effects: tuple[str, ...]
    values: Mapping[str, float]
    laws: tuple[LawForm, ...] = ()
    share: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """The uncertainty of a fitted model."""

    names: tuple[str, ...]
    """The fitted values."""
    covariance: Floats
    """(m, m): Covariance of the fitted values, public units."""
    residual_deg: float
    """Root mean square residual in motion on held-out half-cycles (of the fit, where none was held out), minus the
    share that errors of readings, temperatures and values account for."""
    alternatives: tuple[Alternative, ...] = ()
    """Other explanations that have a share of the probability."""
    rest_residual_deg: float | None = None
    """The same residual at rest; None: as in motion."""
    reading_deg: float = 0.0
    """Standard deviation of a single reading in the record of the fit; the start angle of a prediction is such a
    reading."""

    @property
    def left_deg(self) -> tuple[float, float]:
        """The residuals in motion and at rest, root mean square."""
        return self.residual_deg, self.residual_deg if self.rest_residual_deg is None else self.rest_residual_deg

    def steps(self) -> Iterator[dict[str, float]]:
        """Yield the change of the values (by name) by one standard deviation along each principal axis."""
        size, share, axes = principal_axes(self.covariance)
        # Smaller eigenvalues of a correlation matrix are rounding errors.
        rounded = len(share) * np.finfo(np.float64).eps
        for variance, axis in zip(share, axes.T, strict=True):
            if variance > rounded:
                change = np.sqrt(variance) * axis * size
                yield dict(zip(self.names, change.tolist(), strict=True))

    def to_json(self) -> dict[str, Any]:
        """Return the part of ``model.json``."""
        return {
            "names": list(self.names),
            "covariance": self.covariance.tolist(),
            "residual_deg": self.residual_deg,
            "rest_residual_deg": self.left_deg[1],
            "reading_deg": self.reading_deg,
            "alternatives": [
                {
                    "effects": list(a.effects),
                    "values": dict(a.values),
                    "laws": [form.to_json() for form in a.laws],
                    "share": a.share,
                }
                for a in self.alternatives
            ],
        }


def principal_axes(covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Return standard deviations (m,), and eigenvalues (m,) and axes (m, m; columns) of the correlation matrix.

    The correlation matrix is used because the values differ by many orders of magnitude.
    """
    size = np.sqrt(np.diag(covariance))
    unit = np.where(size > 0.0, size, 1.0)
    share, axes = np.linalg.eigh(covariance / np.outer(unit, unit))
    return size, share, axes


def doubt_from(table: Mapping[str, Any], *, free: Sequence[str]) -> Doubt:
    """Read the uncertainty in ``model.json``; ``free`` are the names of the model's free parameters.

    Raises ConfigError when the table is damaged. Effects and values of the alternatives are not checked here.
    """
    where = "doubt"
    names, rows, others = table.get("names"), table.get("covariance"), table.get("alternatives")
    if not isinstance(names, list) or len(set(map(str, names))) != len(names) or not set(map(str, names)) <= set(free):
        raise ConfigError("'names' are not the model's free values", where=where, value=repr(names))
    try:
        covariance = np.array(rows, np.float64).reshape(len(names), len(names))
    except (TypeError, ValueError) as error:
        raise ConfigError("'covariance' is no square of numbers", where=where) from error
    size = np.sqrt(np.abs(np.diag(covariance)))
    if not np.isfinite(covariance).all() or np.any(np.abs(covariance) > 1.001 * np.outer(size, size)):
        raise ConfigError("'covariance' is no covariance matrix", where=where)
    if not isinstance(others, list) or not all(isinstance(other, Mapping) for other in others):
        raise ConfigError("'alternatives' is no list of tables", where=where, value=repr(others))
    residual_deg, rest_deg, reading_deg = (
        get_number(table, name, where=where, lower=0.0, upper=MOST_TURNED_DEG)
        for name in ("residual_deg", "rest_residual_deg", "reading_deg")
    )
    return Doubt(
        names=tuple(names),
        covariance=0.5 * (covariance + covariance.T),
        residual_deg=residual_deg,
        rest_residual_deg=rest_deg,
        reading_deg=reading_deg,
        alternatives=tuple(_alternative(other) for other in others),
    )


def _alternative(table: Mapping[str, Any]) -> Alternative:
    where = "doubt, alternatives"
    effects = get_names(table, "effects", where=where)
    values = get_table(table, "values", where=where, required=True)
    laws = laws_from(table.get("laws"), where=f"{where}, laws")
    share = get_number(table, "share", where=where, lower=0.0, upper=1.0)
    return Alternative(effects, {name: get_number(values, name, where=where) for name in values}, laws, share)
