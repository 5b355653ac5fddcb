"""Preparation of the search: start values of its fits, and the values that only one block determines.

A fit that starts far from the optimum may end in another local minimum. The plain model is fitted from several points
within its bounds. For every candidate, points are laid out within its bounds; the search starts also from those points
whose residual, after a linear re-fit of the base parameters, is smaller than at the declared start. That costs one call
of the model per point, where a fit costs tens.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from torsight.core.parallel.threads import in_parallel
from torsight.core.parameter import Parameter
from torsight.core.units import Floats
from torsight.core.words.wording import number
from torsight.discovery.inference.fitting import EffectSet, Fit, Fitter, space_of
from torsight.discovery.inference.laplace import residual_of
from torsight.discovery.inference.noise import Stretches, first_scales, information
from torsight.discovery.inference.solver import STEP_SHARE, linear_change
from torsight.discovery.inference.validate import block_labels
from torsight.discovery.interface import Candidate
from torsight.discovery.own.answer.laws import usual_forms, with_nodes
from torsight.discovery.own.follow import Stretched, begun_anew, follows, kept_s, led_on, over_stretches, span_s
from torsight.discovery.own.model.problem import ModelProblem
from torsight.discovery.own.reading_error import without_readings
from torsight.discovery.weight import NOTHING

_POINTS: Final = 12
"""Number of points within the bounds at which the plain model, or a candidate, is evaluated ..."""
_STARTS: Final = 2
"""... and number of the best ones from which a fit starts beside the declared start."""
_BETTER: Final = 0.95
"""Share of the cost from the declared start below which another point is worth a fit."""
MUCH_BETTER: Final = 0.8
"""Share of the cost below which a fit from another start has found another minimum, which is reported."""
_ONE_BLOCK: Final = 0.99
"""Share of a record's information about a value above which a single block determines the value."""


def prepare(problem: ModelProblem) -> tuple[ModelProblem, tuple[str, ...]]:
    """Return a problem with good starts, and warnings; values that only one block determines are initial states."""
    stretches = Stretches.of(problem)
    fitter = Fitter(problem, information(stretches, first_scales(problem, stretches), _floor(problem)))
    base, warnings, stretched = _base(problem, fitter)
    if stretched is not None and not follows(problem, fitter, base):
        length_s = kept_s(problem, stretched)
        if math.isfinite(length_s):
            again, said = prepare(begun_anew(problem, stretched, length_s))
            note = (
                "small errors grow in this model, so that it cannot follow the whole record: the states that are "
                f"measured begin anew every {length_s:.3g} s, and the model is compared with the record in between; "
                "ode(…, solver=Solver(restart_s=…)) sets another time"
            )
            # A longer time only gives the fit the stretches' estimates as starts.
            restarts = length_s < span_s(problem)
            return again, ((note, *said) if restarts else said)
    problem, left_out = without_readings(problem, base)
    problem, notes = _once(problem, fitter, base)
    notes += left_out
    notes += _apart(problem, fitter, base)
    each_its_own = _each_its_own(problem, fitter, base)
    notes += each_its_own
    started = _started(problem, base)
    candidates = tuple(_with_starts(problem, one, fitter, base) for one in problem.candidates)
    if problem.ports:
        problem = with_nodes(problem, base.values)
    candidates = usual_forms(problem, base, candidates)
    # A missing effect may have biased the fitted values: laws are measured from the declared values, too.
    elsewhere = ({p.name: p.value for p in problem.parameters if p.sigma is None},)
    problem = replace(problem, parameters=started, candidates=candidates, elsewhere=elsewhere, alike=not each_its_own)
    return problem, (*warnings, *notes)


def _floor(problem: ModelProblem) -> Floats:
    """Return the noise (n,) for the first fits: the given one, else the resolution."""
    return problem.sigma if problem.sigma[problem.valid].any() else np.full(len(problem.observed), problem.resolution)


def _base(problem: ModelProblem, fitter: Fitter) -> tuple[Fit, list[str], Stretched | None]:
    """Fit the plain model from its start, from the best of several points, and from the fit of its stretches."""
    own = fitter.base()
    free = [p for p in problem.parameters if p.sigma is None and (math.isfinite(p.upper - p.lower) or p.value != 0.0)]
    if not free:
        return own, [], None
    start = {p.name: p.value for p in problem.parameters}
    points = [{**start, **point} for point in _spread(free, _POINTS)]
    left = [residual_of(fitter.problem, at) for at in problem.predict_many(points, ())]
    looked = np.argsort([fitter.weight.square(one) for one in left], kind="stable")[:_STARTS]
    begins = [*(points[i] for i in looked.tolist()), *_elsewhere(problem, fitter, own, free)]
    others = in_parallel(begins, lambda point: fitter.fit((), [point], keep=1))
    stretched = over_stretches(problem, fitter, own)
    led = [] if stretched is None else [led_on(problem, fitter, stretched)]
    best = min([own, *others, *led], key=lambda fit: fit.cost)
    if best.cost >= MUCH_BETTER * own.cost:
        return min([own, best], key=lambda fit: fit.cost), [], stretched
    away = [p for p in free if abs(best.values[p.name] - own.values[p.name]) > 0.5 * _scale(p)]
    listed = ", ".join(f"{p.name} {own.values[p.name]:.4g} → {best.values[p.name]:.4g}" for p in away)
    root = math.sqrt(own.cost / best.cost)
    note = (
        f"the fit of the model from its start has a residual {root:.3g} times as large as one from elsewhere"
        f"{f' ({listed})' if listed else ''}: the better fit is used; starts nearer to it make the answer surer"
    )
    return best, [note], stretched


def _elsewhere(problem: ModelProblem, fitter: Fitter, own: Fit, free: list[Parameter]) -> list[dict[str, float]]:
    """Return the best points that differ from the declared start in one parameter and cost less than a fit.

    The cost of a point is that after a linear re-fit of the parameters and of the prediction's size. The points lie
    around the declared start, because the other parameters' values at a wrong minimum would hide the right one.
    """
    start, costs = {p.name: p.value for p in problem.parameters}, []
    for p in free:
        points, found = _along(problem, fitter, own, start, _spread([p], _POINTS), ())
        each = (_relaxed_cost(fitter, own, residual_of(fitter.problem, at), at[:, None]) for at in found)
        costs += [(cost, p.name, point[p.name]) for cost, point in zip(each, points, strict=True)]
    better = sorted(one for one in costs if one[0] < _BETTER * own.cost)[:_STARTS]
    return [{**start, name: value} for _, name, value in better]


def _along(
    problem: ModelProblem,
    fitter: Fitter,
    base: Fit,
    around: Mapping[str, float],
    points: list[dict[str, float]],
    effects: EffectSet,
) -> tuple[list[dict[str, float]], list[Floats]]:
    """Return points along one parameter, and further ones half-way between them, with their predictions.

    A minimum may lie between two neighbours where more than half of one prediction (root mean square) cannot be
    expressed by the other one's size and by the base parameters. For a delay, every rise and fall of the input makes
    such a minimum. At most 48 points are returned.
    """
    ((name, _),) = points[0].items()
    found: list[Floats] = []
    while True:
        found = [*found, *problem.predict_many([{**around, **one} for one in points[len(found) :]], effects)]
        order = np.argsort([point[name] for point in points], kind="stable").tolist()
        apart = [
            (points[k][name] - points[i][name], i, k)
            for i, k in itertools.pairwise(order)
            if _relaxed_cost(fitter, base, found[k], found[i][:, None]) > 0.25 * _relaxed_cost(fitter, base, found[k])
        ]
        widest = sorted((one for one in apart if one[0] > 0.0), reverse=True)[: 48 - len(points)]
        if not widest:
            return points, found
        points = [*points, *({name: 0.5 * (points[i][name] + points[k][name])} for _, i, k in widest)]


def _spread(parameters: list[Parameter], count: int) -> list[dict[str, float]]:
    """Return points that fill the parameters' ranges evenly (Halton's sequence, without its first point, a corner)."""
    # Imported where it is needed: it takes half a second, which every fit would pay.
    from scipy.stats import qmc

    unit = qmc.Halton(len(parameters), scramble=False).random(count + 1)[1:]
    return [{p.name: _place(p, float(u)) for p, u in zip(parameters, row, strict=True)} for row in unit]


def _place(p: Parameter, u: float) -> float:
    """Return the value at a share ``u`` (0 to 1) of a parameter's range.

    With a null value, distances from it are spaced logarithmically, from a tenth of the start's distance to the bound,
    or to ten times that distance without a bound. Without a null value, the range between the bounds is divided evenly;
    where a bound is missing, values are spaced logarithmically from a tenth to ten times the start.
    """
    if p.null is not None:
        distance = abs(p.value - p.null) or _scale(p)
        below, above = p.null - p.lower, p.upper - p.null
        both = min(below, above) > 0.0
        down = (u < 0.5) if both else below > 0.0
        share = (2.0 * u) % 1.0 if both else u
        bound = below if down else above
        far = min(bound, 10.0 * distance) if not math.isfinite(bound) else bound
        near = min(0.1 * distance, 0.1 * far)
        size = near * (far / near) ** share
        return float(p.null - size if down else p.null + size)
    if math.isfinite(p.upper - p.lower):
        return p.lower + u * (p.upper - p.lower)
    ratio = 10.0 ** (2.0 * u - 1.0)
    return float(np.clip(p.value * ratio if p.value else _scale(p) * (2.0 * u - 1.0), p.lower, p.upper))


def _scale(p: Parameter) -> float:
    return float(space_of([p]).scale[0])


def _once(problem: ModelProblem, fitter: Fitter, base: Fit) -> tuple[ModelProblem, list[str]]:
    """Mark the values that only one block determines: while it is held out, they stay as fitted to the whole record."""
    labels = block_labels(problem)
    if len(labels) < 3:
        return problem, []
    squares = base.solution.jacobian**2 * fitter.weight.each[:, None]
    shares = np.array([squares[problem.block == label].sum(axis=0) for label in labels])
    total = shares.sum(axis=0)
    notes, found = [], list(problem.once)
    for j, p in enumerate(base.parameters):
        if p.name in found or p.sigma is not None or total[j] <= 0.0:
            continue
        if shares[:, j].max() > _ONE_BLOCK * total[j]:
            found.append(p.name)
            notes.append(
                f"only block {labels[shares[:, j].argmax()]} determines '{p.name}': it is taken as an initial state, "
                "whose value the other blocks need not predict; declare it with initial=… (one for each record), or "
                "fix it"
            )
    return replace(problem, once=tuple(found)), notes


def _apart(problem: ModelProblem, fitter: Fitter, base: Fit) -> list[str]:
    """Return a warning where parameters without a prior can change together without changing the prediction."""
    free = [j for j, p in enumerate(base.parameters) if p.sigma is None]
    if len(free) < 2:
        return []
    step = STEP_SHARE * space_of(base.parameters).scale
    points = [base.solution.x + side * step * (np.arange(len(step)) == j) for j in free for side in (1.0, -1.0)]
    names = [p.name for p in base.parameters]
    found = problem.predict_many([dict(zip(names, x.tolist(), strict=True)) for x in points], ())
    if any(np.array_equal(one, problem.far) for one in found):
        return []
    root = np.sqrt(fitter.weight.each)
    columns = np.column_stack([root * (up - down) for up, down in zip(found[::2], found[1::2], strict=True)])
    size = np.linalg.norm(columns, axis=0)
    if not (size > 0.0).all():
        return []
    left, directions = np.linalg.svd(columns / size, full_matrices=False)[1:]
    # A solver's tolerance of 1e-6 changes central differences over ``STEP_SHARE`` of a scale by 5e-5 of themselves.
    if left[-1] ** 2 > NOTHING:
        return []
    part = np.abs(directions[-1])
    alike = [names[j] for j, share in zip(free, part, strict=True) if share > 0.1 * part.max()]
    note = (
        f"the record determines only combinations of {', '.join(alike)}: they can change together without changing the "
        "prediction, which hides what is missing; give one of them fixed=True, or a sigma if it was measured"
    )
    return [note]


def _each_its_own(problem: ModelProblem, fitter: Fitter, base: Fit) -> list[str]:
    """Return a warning where a value of its own for every record (an initial state, say) would improve the fit greatly.

    Greatly: to less than half the sum of squares, with the model linear in the value.
    """
    count = len(problem.model.records)
    free = [j for j, p in enumerate(base.parameters) if p.sigma is None and p.name not in problem.once]
    if count < 2 or not free:
        return []
    left, columns = residual_of(fitter.problem, base.solution.prediction), base.solution.jacobian
    own = np.zeros((len(left), count))
    for record, _, place in problem.layout.places:
        own[place, record] = 1.0
    costs = [_relaxed_cost(fitter, base, left, columns[:, [j]] * own[:, 1:]) for j in free]
    best, before = int(np.argmin(costs)), fitter.weight.square(left)
    if costs[best] >= 0.5 * before:
        return []
    name = base.parameters[free[best]].name
    note = (
        f"with a value of '{name}' for each record the residual would be {number(math.sqrt(costs[best] / before))} "
        f"times that with one value for all: if it says how a record begins, declare it with initial='{name}'; "
        "else the records differ in something that the model lacks (check that they are of one rig, in the same units)"
    )
    return [note]


def _started(problem: ModelProblem, base: Fit) -> tuple[Parameter, ...]:
    """Return the base parameters with the fitted values as starts, where nothing was measured beforehand.

    A value near 0 has no scale and does not become a start.
    """
    made = []
    for p in problem.parameters:
        moved = p.at(base.values[p.name])
        usable = p.sigma is None and _scale(moved) >= 0.2 * _scale(p)
        made.append(moved if usable else p)
    return tuple(made)


def _with_starts(problem: ModelProblem, one: Candidate, fitter: Fitter, base: Fit) -> Candidate:
    """Return a candidate with further starts that promise a better fit than its own, and with the scales of these.

    A missing effect may have biased the base parameters to where the candidate does nothing. The candidate is therefore
    fitted from the declared base parameters, too; a start from that fit holds the base parameters as well.
    """
    if one.event is not None:
        return one
    points = [{p.name: p.value for p in one.parameters}, *_spread(list(one.parameters), _POINTS)]
    if len(one.parameters) == 1:
        points, found = _along(problem, fitter, base, base.values, points, (one.id,))
    else:
        found = problem.predict_many([{**base.values, **point} for point in points], (one.id,))
    own, *costs = [_relaxed_cost(fitter, base, residual_of(fitter.problem, at)) for at in found]
    better = sorted((cost, i) for i, cost in enumerate(costs, start=1) if cost < _BETTER * own)[:_STARTS]
    starts: list[Mapping[str, float]] = [points[i] for _, i in better]
    if not follows(problem, fitter, base):
        least, declared = min([own, *costs, base.cost]), {p.name: p.value for p in problem.parameters}
        scouts = [{**declared, **point} for point in (points[0], *starts)]
        afar = fitter.fit((one.id,), scouts, keep=1, follow=lambda scout: scout.ahead < _BETTER * least)
        starts = [afar.values] * (afar.cost < _BETTER * least) + starts
    first = starts[0] if starts else points[0]
    # A value that is nearer to its null than one step of the declared scale cannot be distinguished from it.
    scales = {
        p.name: float(np.clip(_scale(p.at(first[p.name])), STEP_SHARE * _scale(p), _scale(p)))
        for p in one.parameters
        if p.name not in one.scales
    }
    return replace(one, starts=(*starts, *one.starts), scales={**one.scales, **scales})


def _relaxed_cost(fitter: Fitter, base: Fit, left: Floats, further: Floats | None = None) -> float:
    """Return the cost of a residual ``left`` (n,) after a linear re-fit of the base parameters.

    ``further`` (n, k) are the columns of additional coefficients, which have no prior.
    """
    weight, space = fitter.weight, space_of(base.parameters)
    columns, information = base.solution.jacobian, space.prior_information + space.least_information
    back = space.to_means(base.solution.x)
    if further is not None:
        size = np.maximum(np.sqrt(np.sum(further**2, axis=0)), 1e-30)
        columns = np.hstack([columns, further / size])
        information = np.concatenate([information, np.full(len(size), 1e-9 * float(np.mean(weight.each)))])
        back = np.concatenate([back, np.zeros(len(size))])
    moved = linear_change(columns, left, weight=weight, information=information, centre=back)
    return weight.square(left - columns @ moved)
