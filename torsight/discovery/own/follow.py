"""Differential equations in which small errors grow: how a fit follows a record, and where it cannot.

Over a whole record the sum of squares may have many local minima; over short stretches that start from measured values
it has few (multiple shooting: Bock, Numerical treatment of inverse problems in chemical reaction kinetics, 1981). A fit
to the beginning of a record is then a good enough start for a beginning twice as long. Where small errors grow, a model
that lacks an effect cannot be extended in this way: the missing effect acts on the states, which after some time have
nothing to do with the record's. Such a record is informative only over times in which a reading error does not grow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from torsight.core.series import scatter
from torsight.core.units import Floats
from torsight.discovery.inference.fitting import AtPoint, Fit, Fitter
from torsight.discovery.inference.solver import STEP_SHARE, Solution, Space, solve
from torsight.discovery.interface import OVER_GIVEN
from torsight.discovery.own.model.evaluate import Evaluator, Model, call
from torsight.discovery.own.model.layout import noise_of
from torsight.discovery.own.model.ode import Ode
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.model.values import Values
from torsight.discovery.own.own_records import Record
from torsight.discovery.weight import Weight

_BEGINNINGS: Final = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Shares of a record, from its beginning, over which differential equations are fitted after its stretches
(benchmarks/discovery/valleys.py: of 16 pairs of records of a tumbling pendulum 13 are fitted in this way, none without;
15 where measured states begin anew)."""
_GROWN: Final = math.sqrt(2.0)
"""Largest growth of a reading error, root mean square over stretches that start with the error: it then adds to the
residual's variance no more than twice that of the readings themselves."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretched:
    """The plain model fitted over stretches: measured states begin anew in each, others continue."""

    ode: Ode
    solution: Solution


def follows(problem: ModelProblem, fitter: Fitter, fit: Fit) -> bool:
    """Return whether a fit's residual is little more than noise."""
    left = fitter.residual(fit)
    pieces = [left[place][np.isfinite(left[place])] for *_, place in problem.layout.places]
    return float(np.sqrt(np.nanmean(left**2))) <= OVER_GIVEN * scatter(*pieces)


def over_stretches(problem: ModelProblem, fitter: Fitter, own: Fit) -> Stretched | None:
    """Return the fit over stretches; None without measured states, with a given ``restart_s``, or if ``own`` fits."""
    ode = problem.model.predict
    if not isinstance(ode, Ode) or not ode.measured or math.isfinite(ode.solver.restart_s):
        return None
    if follows(problem, fitter, own):
        return None
    over = replace(problem, model=anew(problem.model, shortest_s(problem)))
    over = replace(over, evaluator=Evaluator(over.model))
    starts = (np.array(list(own.values.values())), np.array([p.value for p in problem.parameters]))
    space = fitter.space(())
    found = min((_solved(over, x, fitter.weight, space) for x in starts), key=lambda one: one.cost)
    problem.evaluator.calls += over.evaluator.calls
    return Stretched(ode, found)


def led_on(problem: ModelProblem, fitter: Fitter, stretched: Stretched) -> Fit:
    """Return the fit over the whole record, reached by fits to longer and longer beginnings of it."""
    times, space, found = problem.times(), fitter.space(()), stretched.solution
    since = problem.layout.spread([one - one[0] for one in times])

    def left_open(at: Solution, weight: Weight) -> Floats:
        known = weight.normal(at.jacobian) + np.diag(space.scale**-2.0)
        return np.sqrt(np.diag(np.linalg.inv(known)))

    unsure = left_open(found, fitter.weight)
    # Three times as wide as the stretches' estimates: stretches start from noisy readings.
    over = replace(space, prior_mean=found.x, prior_sigma=3.0 * unsure)
    for share in _BEGINNINGS:
        # Steps of the differences are at most the uncertainty of the fit before: over a longer time slopes are steeper.
        weight = fitter.weight.only(since <= share * span_s(problem))
        finer = np.minimum(space.scale, unsure / STEP_SHARE)
        found = _solved(problem, found.x, weight, replace(over if share < 1.0 else space, scale=finer))
        unsure = np.minimum(unsure, left_open(found, weight))
    return Fit((), problem.parameters, found)


def kept_s(problem: ModelProblem, stretched: Stretched) -> float:
    """Return the longest time (s) over which a reading error does not grow, at least that of the shortest stretch.

    Infinite where the prediction is linear in such errors: the record can then be followed as a whole, once the missing
    effect is in the model.
    """
    measured, least = problem.measured(), problem.resolution * problem.layout.scale
    noise = np.array([max(noise_of(measured, k), float(least[k])) for k in range(len(least))])
    values = dict(zip([p.name for p in problem.parameters], stretched.solution.x.tolist(), strict=True))
    length_s, least_s = 2.0 * span_s(problem), shortest_s(problem)
    bent, grown = _of_an_error(problem, stretched.ode, values, noise=noise, length_s=length_s)
    if bent <= 1.0:
        return math.inf
    while grown > _GROWN and length_s > least_s:
        length_s = max(length_s / 2.0, least_s)
        grown = _of_an_error(problem, stretched.ode, values, noise=noise, length_s=length_s)[1]
    return length_s


def begun_anew(problem: ModelProblem, stretched: Stretched, length_s: float) -> ModelProblem:
    """Return a problem whose measured states begin anew every ``length_s``, with the stretches' estimates as starts."""
    names = [p.name for p in problem.parameters]
    found = dict(zip(names, stretched.solution.x.tolist(), strict=True))
    parameters = tuple(p if p.sigma is not None else p.at(found[p.name]) for p in problem.parameters)
    model = anew(problem.model, length_s)
    problem.evaluator.change(model)
    return replace(problem, model=model, parameters=parameters)


def _of_an_error(
    problem: ModelProblem, ode: Ode, values: dict[str, float], *, noise: Floats, length_s: float
) -> tuple[float, float]:
    """Return the effect of an error of the noise's size in every reading on stretches, in units of the noise.

    The two values are root mean squares: of the part that is not linear in the error, and of the linear part. Both are
    infinite where the model gives no numbers.
    """
    bent, grown, ode = [], [], ode.begun_anew(length_s)
    outputs = problem.model.outputs
    for record, given in zip(problem.model.records, problem.given(values, ()), strict=True):
        sides = []
        for side in (-1.0, 0.0, 1.0):
            off = {name: side * own for name, own in zip(outputs, noise, strict=True)}
            begun = dict(zip(ode.states, ode.start(Values(given), record).tolist(), strict=True))
            begun |= {name: begun[name] + off[name] for name in ode.measured}
            read = Record({**record, **{name: record[name] + own for name, own in off.items()}}, record.label_)
            sides.append(
                call(replace(problem.model, predict=replace(ode, initial=begun), records=(read,)), 0, given, {})
            )
        below, middle, above = (one.outputs for one in sides)
        if below is None or middle is None or above is None:
            return math.inf, math.inf
        bent.append(np.mean(((above + below - 2.0 * middle) / 2.0 / noise) ** 2))
        grown.append(np.mean(((above - below) / 2.0 / noise) ** 2))
    return math.sqrt(np.mean(bent)), math.sqrt(np.mean(grown))


def anew(model: Model, length_s: float) -> Model:
    """Return a model whose measured states begin anew every ``length_s``; a model without such states unchanged."""
    ode = model.predict
    return replace(model, predict=ode.begun_anew(length_s)) if isinstance(ode, Ode) and ode.measured else model


def span_s(problem: ModelProblem) -> float:
    """Return the duration of the longest record, s."""
    return max(float(np.ptp(one)) for one in problem.times())


def shortest_s(problem: ModelProblem) -> float:
    """Return the duration of the shortest stretches, s: of 64 in a record, or of four rows, which show the states."""
    row = max(float(np.median(np.diff(one))) for one in problem.times())
    return max(span_s(problem) / 64, 4 * row)


def _solved(over: ModelProblem, x: Floats, weight: Weight, within: Space) -> Solution:
    at = AtPoint(over, [p.name for p in over.parameters], ())
    return solve(at, x, observed=over.observed, weight=weight, space=within, max_iterations=20)
