"""The uncertainty of a fitted model as its file keeps it: predictions take their standard deviations from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from torsight.actuator.laws import laws_from
from torsight.core.errors import ConfigError
from torsight.core.files.config import get_names, get_number, get_table
from torsight.core.frozen import Frozen
from torsight.core.law import LawForm
from torsight.core.units import Floats
from torsight.core.words.plausible import MOST_TURNED_DEG

_NO_SHARE: Final = 1e-9
"""Variance, of one per value, below which an axis is nothing but rounding (1e-16 times the number of values): a
prediction moves by 1/30,000 of a standard deviation along it."""


@dataclass(frozen=True, slots=True)
class Alternative(Frozen):
    """Another explanation of the same record: its effects, all its values in public units, and its laws.

    ``share`` is which part of the probability it holds, beside the model's own and the other ones.
    """

    effects: tuple[str, ...]
    values: Mapping[str, float]
    laws: tuple[LawForm, ...] = ()
    share: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """What a fitted model does not know.

    Attributes
    ----------
    names : tuple of str
        The values that were fitted.
    covariance : (m, m) float64
        Of these, public units.
    residual_deg : float
        What is left in motion on held-out half-cycles (of the fit, where none was left out), root mean
        square, less what errors of readings, temperatures and values account for.
    alternatives : tuple of Alternative
        The explanations that hold a part of the probability.
    rest_residual_deg : float or None
        The same at rest; None: as in motion.
    reading_deg : float
        Standard deviation of a single reading in the record of the fit: the angle at which a prediction starts is one.
    """

    names: tuple[str, ...]
    covariance: Floats
    residual_deg: float
    alternatives: tuple[Alternative, ...] = ()
    rest_residual_deg: float | None = None
    reading_deg: float = 0.0

    @property
    def left_deg(self) -> tuple[float, float]:
        """What is left in motion and at rest."""
        return self.residual_deg, self.residual_deg if self.rest_residual_deg is None else self.rest_residual_deg

    def steps(self) -> Iterator[dict[str, float]]:
        """Give one standard deviation along each principal axis of the values' uncertainty (name to change)."""
        size, share, axes = principal_axes(self.covariance)
        for variance, axis in zip(share, axes.T, strict=True):
            if variance > _NO_SHARE:
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
    """Return standard deviations (m,), and variances (m,) and axes (m, m; columns) in units of these.

    The axes are those of the correlation matrix: values differ in size by many orders.
    """
    size = np.sqrt(np.diag(covariance))
    unit = np.where(size > 0.0, size, 1.0)
    share, axes = np.linalg.eigh(covariance / np.outer(unit, unit))
    return size, share, axes


def doubt_from(table: Mapping[str, Any], *, free: Sequence[str]) -> Doubt:
    """Read the part of ``model.json``; ``free`` are the names that a model of this kind can fit.

    Raises
    ------
    ConfigError
        When it is damaged. What the alternatives name is not looked at here.
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
        raise ConfigError("'covariance' is that of no values", where=where)
    if not isinstance(others, list) or not all(isinstance(other, Mapping) for other in others):
        raise ConfigError("'alternatives' is no list of tables", where=where, value=repr(others))
    left_deg = get_number(table, "residual_deg", where=where, lower=0.0, upper=MOST_TURNED_DEG)
    return Doubt(
        names=tuple(names),
        covariance=0.5 * (covariance + covariance.T),
        residual_deg=left_deg,
        # Earlier files do not tell rest from motion.
        rest_residual_deg=get_number(
            table, "rest_residual_deg", where=where, lower=0.0, upper=MOST_TURNED_DEG, default=left_deg
        ),
        # Earlier files take the start for exact.
        reading_deg=get_number(table, "reading_deg", where=where, lower=0.0, upper=MOST_TURNED_DEG, default=0.0),
        # Earlier files hold all of them as likely as the model's own.
        alternatives=tuple(_alternative(other, share=1.0 / (1 + len(others))) for other in others),
    )


def _alternative(table: Mapping[str, Any], *, share: float) -> Alternative:
    where = "doubt, alternatives"
    effects = get_names(table, "effects", where=where)
    values = get_table(table, "values", where=where, required=True)
    laws = laws_from(table.get("laws", []), where=f"{where}, laws")
    share = get_number(table, "share", where=where, lower=0.0, upper=1.0, default=share)
    return Alternative(effects, {name: get_number(values, name, where=where) for name in values}, laws, share)
