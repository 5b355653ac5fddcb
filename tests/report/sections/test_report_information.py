"""What a further measurement makes of an interval, against fits that have really been made with it."""

from __future__ import annotations

import numpy as np
import pytest

from torsight.report.sections.information import best_measures

NAMES = ("stiffness", "friction", "offset")


def covariance(design: np.ndarray, prior: list[float | None], *, copies: int = 1) -> np.ndarray:
    """Return the covariance of a linear fit with unit noise by stacked least squares: rows of priors below the data."""
    rows = [np.eye(3)[k] / sigma for k, sigma in enumerate(prior) if sigma is not None]
    stacked = np.vstack([*[design] * copies, *rows])
    _, upper = np.linalg.qr(stacked)
    inverse = np.linalg.inv(upper)
    return inverse @ inverse.T


@pytest.fixture
def design() -> np.ndarray:
    """Give a record in which friction shows only as a share of stiffness: their sum, and a little of either."""
    random = np.random.default_rng(11)
    rows = random.normal(size=(60, 3))
    rows[:, 1] = rows[:, 0] + 0.02 * rows[:, 1]
    return rows * np.array([1.0, 1.0, 3.0])


@pytest.mark.parametrize("target", NAMES)
def test_the_promised_interval_is_the_one_of_the_longer_record_or_the_better_value(
    design: np.ndarray, target: str
) -> None:
    prior: list[float | None] = [0.2, 0.5, None]
    before = covariance(design, prior)
    longer, sharper = best_measures(target, NAMES, before, prior)
    place = NAMES.index(target)
    after = covariance(design, prior, copies=int(longer.factor))
    assert longer.ratio == pytest.approx(np.sqrt(after[place, place] / before[place, place]), rel=1e-6)
    assert sharper is not None
    better = [s if s is None or n != sharper.name else s / sharper.factor for n, s in zip(NAMES, prior, strict=True)]
    after = covariance(design, better)
    assert sharper.ratio == pytest.approx(np.sqrt(after[place, place] / before[place, place]), rel=1e-6)


def test_where_the_record_tells_everything_four_of_them_halve(design: np.ndarray) -> None:
    longer, sharper = best_measures("offset", NAMES, covariance(design, [None] * 3), [None] * 3)
    assert longer.factor == 4.0
    assert longer.ratio == pytest.approx(0.5, rel=1e-6)
    assert sharper is None


def test_where_only_the_characterisation_tells_no_record_helps_and_twice_as_well_does(design: np.ndarray) -> None:
    blind = design * np.array([0.0, 1.0, 1.0])
    prior: list[float | None] = [0.2, 0.5, None]
    longer, sharper = best_measures("stiffness", NAMES, covariance(blind, prior), prior)
    assert longer.ratio == pytest.approx(1.0, rel=1e-6)
    assert sharper is not None
    assert (sharper.name, sharper.factor) == ("stiffness", 2.0)
    assert sharper.halves
