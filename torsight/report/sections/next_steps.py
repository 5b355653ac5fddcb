"""Advice on a result: its limitation, the measurement that would halve its intervals, its use in a controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from torsight.actuator.fitted import FittedModel, read_model
from torsight.core.errors import TorsightError
from torsight.core.files.results import RunResults, column
from torsight.core.records import TemperatureLog
from torsight.core.series import rms
from torsight.core.units import DEG
from torsight.core.words.wording import (
    EXPLAINED,
    decides,
    error_left,
    has_unnamed_law,
    held_out_errors,
    not_explained,
    not_fixed,
    number,
    times_floor,
)
from torsight.discovery.prediction import predict_with_sigma
from torsight.report.plots.formulas import symbol, titled, with_symbols
from torsight.report.sections.information import Measure, best_measures
from torsight.report.sections.limitations import as_sentence
from torsight.report.sections.parameter_table import priors

_HONEST: Final = 0.90
"""Least share of the samples within two predicted sigmas: 0.95 for normal noise, less those of half a half-cycle."""


class Step(NamedTuple):
    """A question and its answer; ``good`` where the answer is no reason for concern."""

    question: str
    answer: Markup
    good: bool | None = None


def next_steps(results: RunResults) -> list[Step]:
    """Return the recommended next steps; empty where no discovery was made."""
    if results.discovery is None or error_left(results.discovery) is None:
        return []
    model = _model(results)
    return [
        Step("What limits the result now?", with_symbols(_limit(results))),
        *_halving(results, model),
        _control(results, model),
    ]


def _model(results: RunResults) -> FittedModel | None:
    if results.model is None:
        return None
    try:
        return read_model(results.folder / "model.json")
    except TorsightError:
        # The model has effects that are not installed here: advice that needs the model is left out.
        return None


def _limit(results: RunResults) -> str:
    discovery = results.discovery or {}
    left, floor = error_left(discovery), discovery.get("noise_floor_deg")
    if left is None or not floor:
        return "The record's noise floor is not known, so its limit cannot be named."
    if not_explained(discovery):
        return (
            f"The model, not the measurement: the residual is {number(times_floor(discovery))} times the noise floor. "
            "A longer record narrows the intervals honestly only once the residual is explained."
        )
    if discovery.get("verdict") == "ambiguous":
        same = "The programme: the actuator moves in the same way under all explanations."
        if decides(discovery.get("next_experiment")):
            return f"{same} Run the one proposed below."
        return f"{same} No other programme that was tried separates them: measure directly in what they differ."
    if not_fixed(discovery):
        return (
            "How well this record determines the values: the residual of the fit is noise, but held-out half-cycles "
            f"are off by {number(left, 2)}° rms, {number(left / floor, 2)} times the noise floor. More half-cycles "
            "help, and complete heatings: where one ends too early, its temperature's error stays in the angle."
        )
    return (
        f"Noise, not the model: the residual is {number(left, 2)}° rms, and no model's can be less than about "
        + _noise(results, float(floor))
    )


def _noise(results: RunResults, floor: float) -> str:
    """Return sentences on the angle readings' share of the noise floor, with advice on the larger part."""
    table = results.first_of("merged", "curves", "angle")
    sigma = np.empty(0) if table is None else column(table, "angle_sigma_deg")
    sigma = sigma[np.isfinite(sigma)]
    if not len(sigma):
        return f"{number(floor, 2)}°."
    angle = rms(sigma)
    begin = f"{number(floor, 2)}°. The share of the angle's readings is {number(min(angle, floor), 2)}°"
    if angle**2 < 0.5 * floor**2:
        return (
            f"{begin}; the rest comes from the temperatures' readings. Log them more often, or with less noise: "
            "four times as many readings halve their part."
        )
    advice = (results.track or {}).get("advice") or []
    first = advice if isinstance(advice, str) else str(advice[0]) if advice else ""
    return (
        f"{begin}, the greater part. {as_sentence(first) if first.strip() else 'Larger markers in the film reduce it.'}"
    )


def _halving(results: RunResults, model: FittedModel | None) -> list[Step]:
    """Return the measurements that would halve the intervals of the friction torque and the named effects."""
    if model is None or model.doubt is None or not np.isfinite(model.doubt.covariance).all():
        return []
    names, covariance = model.doubt.names, model.doubt.covariance
    sigma = {parameter.name: parameter.sigma for parameter in model.model.parameters}
    of_effects = [
        next((name for name in effect.get("parameters") or {} if name in names), None)
        for effect in (results.discovery or {}).get("effects") or []
    ]
    targets = [name for name in dict.fromkeys(["tau_c_mnm", *of_effects]) if name in names]
    lines = []
    for target in targets:
        longer, sharper = best_measures(target, names, covariance, [sigma.get(name) for name in names])
        lines.append(Markup("<b>{}</b>: {}").format(titled(target), _halved(results, longer, sharper)))
    if not lines:
        return []
    if not_explained(results.discovery or {}):
        lines.append(Markup("All this holds once the residual has been explained."))
    return [Step("Which measurement would halve the intervals?", Markup("<br>").join(lines))]


def _halved(results: RunResults, longer: Measure, sharper: Measure | None) -> Markup:
    """Return the least measurement that halves an interval, or the ratio that the strongest single one reaches."""
    record = escape(f"{longer.factor:g} times as many half-cycles{_instead(results, longer.factor)}")
    ways = [(record, longer), *([] if sharper is None else [(_characterised(results, sharper), sharper)])]
    enough = [words for words, measure in ways if measure.halves]
    if enough:
        return Markup("{}.").format(Markup(", or ").join(enough))
    # Four times the information from every source gives a quarter of the variance, whatever the correlations.
    words, strongest = min(ways, key=lambda one: one[1].ratio)
    return Markup(
        "nothing alone; four times as many half-cycles and every characterised value twice as well together do. The "
        "strongest single measurement is {}: it leaves {:.0f} % of the interval."
    ).format(words, 100.0 * strongest.ratio)


def _instead(results: RunResults, factor: float) -> str:
    curves = results.curves
    if curves is None or "half_cycle" not in curves.columns:
        return ""
    count = int(curves["half_cycle"].nunique())
    return f" ({factor * count:.0f} instead of {count})"


def _characterised(results: RunResults, measure: Measure) -> Markup:
    prior = priors(results).get(measure.name)
    if prior is None or not prior.sigma:
        return Markup("{} known {} times as well from elsewhere").format(symbol(measure.name), f"{measure.factor:g}")
    return Markup("{} characterised to ±{} instead of ±{}").format(
        symbol(measure.name), number(prior.sigma / measure.factor, 2), number(prior.sigma, 2)
    )


def _control(results: RunResults, model: FittedModel | None) -> Step:
    """Return whether the model may be trusted for control, from held-out error, predicted sigma and range."""
    discovery = results.discovery or {}
    question = "Can the model be trusted for control?"
    left = error_left(discovery) or 0.0
    angle = results.measured_angle_deg()
    range_deg = float(np.ptp(angle)) if len(angle) else 0.0
    if range_deg <= 0.0:
        return Step(question, Markup("The range of motion is not known here."))
    held_out = held_out_errors(discovery)[1] is not None
    seen = "on held-out half-cycles" if held_out else "on the half-cycles that were fitted"
    numbers = [
        f"{number(left, 2)}° rms error {seen}, {number(100.0 * left / range_deg, 2)} % of the {range_deg:.0f}° range"
    ]
    sigma, share = _predicted(results, model)
    if sigma is not None:
        numbers.append(
            f"{number(sigma, 2)}° predicted sigma ({number(100.0 * sigma / range_deg, 2)} % of the range), and "
            f"{100.0 * share:.0f} % of the measured angles lie within two of it"
        )
    against = [
        *(["no half-cycle could be held out"] if not held_out else []),
        *(["the record is not explained"] if not_explained(discovery) else []),
        *(["a measured law stands in for a cause that is not known"] if has_unnamed_law(discovery) else []),
        *(["it is not known which explanation is right"] if discovery.get("verdict") == "ambiguous" else []),
        *(["the predicted sigma is too small"] if sigma is not None and share < _HONEST else []),
    ]
    ends = f" {'; '.join(numbers)}."
    if against:
        return Step(question, escape(f"Not yet, because {', and '.join(against)}.{ends}"), good=False)
    within = f"within about ±{number(2.0 * (left if sigma is None else max(sigma, left)), 2)}° (two sigmas)"
    if sigma is not None and sigma > EXPLAINED * left:
        words = f"Only {within}, because the record does not determine the values better; more half-cycles would."
        return Step(question, escape(f"{words}{ends}"))
    return Step(question, escape(f"Yes, {within}, for temperatures and rates like this record's.{ends}"), good=True)


def _predicted(results: RunResults, model: FittedModel | None) -> tuple[float | None, float]:
    """Return the median predicted sigma over the record (°), and the share of the samples within two sigmas.

    The residual is that of the fitted model on the record's own clock; a prediction for a log is on that log's clock.
    """
    table, curves = results.merged, results.curves
    if model is None or model.doubt is None or table is None or curves is None:
        return None, 0.0
    angle = column(table, "angle_deg")
    known = np.flatnonzero(np.isfinite(angle))
    if not len(known):
        return None, 0.0
    first = int(known[0])
    columns: Mapping[str, Any] = {name: column(table, name)[first:] for name in ("time_s", "temp_a_c", "temp_b_c")}
    try:
        said = predict_with_sigma(model, TemperatureLog(**columns), start_angle_rad=float(angle[first]) * DEG)
    except TorsightError:
        # A record that cannot drive a model, such as one that was cut by hand.
        return None, 0.0
    sigma = np.interp(column(curves, "time_s"), columns["time_s"], said.sigma_rad / DEG)
    off = np.abs(column(curves, "residual_after_deg"))
    both = np.isfinite(sigma) & np.isfinite(off)
    if not both.any():
        return None, 0.0
    return float(np.median(sigma[both])), float(np.mean(off[both] <= 2.0 * sigma[both]))
