"""The findings in words: for a terminal, for a notebook, for ``discovery.json``."""

from __future__ import annotations

import math
from dataclasses import asdict
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from torsight.core.parameter import estimates_to_json
from torsight.core.series import rms
from torsight.core.words.wording import estimate, number
from torsight.discovery.inference.engine import law_shares
from torsight.discovery.inference.fitting import less
from torsight.discovery.own.answer.pictures import as_image, overview
from torsight.discovery.own.model.ode import Ode
from torsight.discovery.own.model.problem import ModelProblem

if TYPE_CHECKING:
    from torsight.discovery.own.answer.findings import Errors, Findings, FittedSet


def verdict_words(found: Findings) -> str:
    """Return the verdict as a sentence."""
    named = " and ".join(found.effects) or " and ".join(found.decision.chosen.members)
    if found.verdict == "none":
        return "nothing is missing that this record can show"
    if found.verdict == "identified":
        return f"{named} {'is' if len(found.effects) == 1 else 'are'} missing{_alike(found)}"
    if found.verdict == "ambiguous":
        others = " or ".join(" and ".join(one) for one in found.alternatives)
        return f"{named} or {others}: this record cannot tell them apart"
    missing = f"{named} {'is' if len(found.effects) == 1 else 'are'} missing{_alike(found)}"
    beside = f"{missing}, and " if found.effects else ""
    if found.effects and not found.decision.unnamed:
        # With a residual so far above the noise, a name only says which of the offers helps most.
        most = f"of what was offered, {named} {'explains' if len(found.effects) == 1 else 'explain'} most"
        left = number(found.decision.over_floor)
        return f"a residual of {left} times the noise is left that nothing offered explains; {most}"
    declared = {port.name for port in found.ports}
    laws = [name for name in found.decision.unnamed if name in declared]
    if laws and len(laws) == len(found.decision.unnamed):
        what = f"{' and '.join(laws)} {'is' if len(laws) == 1 else 'are'} missing, in a form that no candidate has"
        return f"{beside}{what}{_depends(found)}"
    return f"{beside}something is missing that none of the candidates explains{_depends(found)}"


def _alike(found: Findings) -> str:
    """Return a caveat where the form that won was not compared with a free law."""
    taken = found.forms_taken
    if not taken:
        return ""
    return ", or what acts alike" if len(found.effects) == 1 else f" ({' and '.join(taken)}, or what acts alike)"


def _depends(found: Findings) -> str:
    if not found.drivers:
        return ""
    return "; it depends on " + ", ".join(f"{name} ({100.0 * share:.0f} %)" for name, share in found.drivers)


def lines(found: Findings) -> list[tuple[str, str]]:
    """Return title and text of every line of the summary."""
    rows = [("Missing", verdict_words(found))]
    for name, (before, after) in found.errors.items():
        rows.append((f"Error of {name}", _errors(before, after)))
    rows += [("", text) for text in (*not_predicted(found), *_noise(found))]
    for name in found.effects:
        own = found.field.base.fitter.candidates[name].parameters
        rows += [(name, f"{p.name} {estimate(found.parameters[p.name].to_json())}") for p in own]
    rows += [(curve.id, curve.sentence) for curve in found.laws if curve.chosen]
    if found.verdict == "unknown":
        rows.append(("Laws offered over", ", ".join(found.drivers_offered) or "nothing"))
    if found.verdict == "unknown" or found.predicts_better:
        unit = " (errors of all outputs together, each in its resolution)" if len(found.errors) > 1 else ""
        rows.append(("Best fits", f"error on all samples, on held-out blocks, gain in log evidence{unit}"))
        rows += [("", fitted_words(one)) for one in found.best_fits]
    rows += [("Larger", larger_words(one)) for one in found.predicts_better[:1]]
    rows += [("What to do", text) for text in what_next(found)]
    rows += [("Note", text) for text in found.warnings]
    return rows


def facts(found: Findings) -> dict[str, str]:
    """Return the lines of the answer by their titles; lines under one title are joined."""
    by_title: dict[str, str] = {}
    title = ""
    for own, text in lines(found):
        title = own or title
        by_title[title] = f"{by_title[title]}; {text}" if title in by_title else text
    return by_title


def _errors(before: Errors, after: Errors) -> str:
    if math.isnan(before.rmse_held_out):
        return f"{number(before.rmse_train)} → {number(after.rmse_train)} rms on the samples that were fitted"
    return f"{number(before.rmse_held_out)} → {number(after.rmse_held_out)} rms on held-out blocks"


def not_predicted(found: Findings) -> list[str]:
    """Return a caveat for every output whose held-out blocks the answer predicts no better than the plain model.

    Also for every law over time without which the answer predicts these blocks equally well. Such an answer can still
    be the more probable one where its own uncertainty on these blocks is large.
    """
    chosen = found.decision.chosen
    if not chosen.members:
        return []
    notes = [
        f"of {name}, {' and '.join(chosen.members)} describes what was recorded, but predicts held-out "
        "blocks no better: something changes there, and the cause of the change is not known"
        for name, (before, after) in found.errors.items()
        if after.rmse_held_out >= before.rmse_held_out
    ]
    if notes or found.before is None:
        return notes
    beside = [item.law.id for item in chosen.laws if item.law.time_like and len(chosen.members) > 1]
    parts = {name: found.field.explanations.get(less(chosen.members, name)) for name in beside}
    return [
        f"{name} describes what was recorded, but held-out blocks are predicted no better with it: something changes "
        "there, and the cause of the change is not known"
        for name, part in parts.items()
        if part is not None and part.held_out.rms <= chosen.held_out.rms
    ]


def _noise(found: Findings) -> list[str]:
    """Return the ratio of the residual to the noise of one reading, in words."""
    ratio = found.decision.over_floor
    whose = (
        "the noise that was given"
        if found.problem.sigma_known
        else "the noise of a reading, measured from the scatter of neighbours"
    )
    # A record that is free of noise has no floor.
    return [] if math.isinf(ratio) else [f"the residual is {number(ratio)} times {whose}"]


def fitted_words(one: FittedSet) -> str:
    """Return, in words, one of the sets that were compared."""
    name = " + ".join(one.effects) or "plain model"
    return f"{name}: {number(one.rmse_train)}, {number(one.rmse_held_out)}, {number(one.gain)}"


def larger_words(one: FittedSet) -> str:
    """Return a remark on a larger set that predicts held-out blocks better."""
    return (
        f"{' + '.join(one.effects)} predicts held-out blocks better ({number(one.rmse_held_out)}), but not all of its "
        "members were accepted: a record that moves more, or more blocks, would decide"
    )


def what_next(found: Findings) -> list[str]:
    """Return advice on what to do after an answer that is ``ambiguous`` or ``unknown``."""
    if found.verdict == "ambiguous":
        explanations = (found.decision.chosen.members, *found.alternatives)
        sets = " from ".join(" and ".join(one) for one in explanations)
        note = (
            f"This record cannot tell {sets}. Predict planned records with each of them; make the one in which they "
            "differ most: other speeds, holds between moves, the other direction. Or offer only what the rig can have."
        )
        return [note]
    if found.verdict == "unknown":
        note = (
            "Look at the measured law over the variable on which it depends, and offer a candidate that has such a "
            "form, or a law at the place where it acts; the best fits are listed."
            if found.drivers
            else "Offer more: candidates, laws at the places where something may act, drivers on which it may depend."
        )
        ode = found.problem.model.predict if isinstance(found.problem, ModelProblem) else None
        far = found.decision.over_floor > found.problem.over_floor
        if far and isinstance(ode, Ode) and not ode.measured:
            note += (
                " If small errors grow over a record, name a state that is measured itself as the output: the state "
                "can then begin anew from its readings on the way."
            )
        return [note]
    return []


def summary(found: Findings) -> str:
    """Return the findings for a terminal; titles take 18 characters, as in the other commands' summaries."""
    return "\n".join(f"{title:17s} {text}".rstrip() for title, text in lines(found))


def html(found: Findings) -> str:
    """Return the findings for a notebook: the summary, the parameters and a picture."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(title)}</th><td style='text-align:left'>{escape(text)}</td></tr>"
        for title, text in lines(found)
    )
    values = "".join(
        f"<tr><td style='text-align:left'>{escape(name)}</td><td style='text-align:left'>"
        f"{escape(estimate(one.to_json()))}</td></tr>"
        for name, one in found.parameters.items()
    )
    image = as_image(overview(found))
    return (
        f"<table>{rows}</table><details><summary>Parameters</summary><table>{values}</table></details>"
        f"<img alt='measured, models and residuals' src='{image}'>"
    )


def to_json(found: Findings) -> dict[str, Any]:
    """Return the content of ``discovery.json``: the contract's keys, errors by output and in its unit.

    ``before`` and ``after`` are those of the first output.
    """
    problem, base = found.problem, found.field.base.log_evidence
    blocks = np.unique(problem.block[problem.valid])
    outputs = {
        name: {"before": asdict(before), "after": asdict(after)} for name, (before, after) in found.errors.items()
    }
    shares = law_shares(found.field, found.decision.chosen)
    floor = rms(found.field.likelihood.floor[problem.valid])
    units = {name: found.rows_of(k)[1] for k, name in enumerate(found.outputs)}
    return {
        "verdict": found.verdict,
        "effects": [_effect(found, name) for name in found.effects],
        "alternatives": [list(names) for names in found.alternatives],
        "drivers": [{"variable": name, "share": share} for name, share in found.drivers],
        "drivers_offered": list(found.drivers_offered),
        **next(iter(outputs.values())),
        "held_out": blocks.tolist(),
        "outputs": outputs,
        "laws": [{**law.to_json(), "share": shares[law.id]} for law in found.laws if law.chosen],
        "noise_floor": {name: floor * unit for name, unit in units.items()},
        "resolution": {name: float(problem.resolution) * unit for name, unit in units.items()},
        "blocks": len(blocks),
        "parameters": estimates_to_json(found.parameters),
        "plain_parameters": estimates_to_json(found.plain_parameters),
        "best_fits": [asdict(one) for one in found.best_fits],
        "predicts_better": [list(one.effects) for one in found.predicts_better],
        "evidence": {
            "price": found.price,
            "probability_missing": found.decision.missing,
            "over_floor_before": found.decision.over_floor_before,
            "over_floor_after": found.decision.over_floor,
            "best_set": list(found.decision.chosen.members),
            "gains": {one.members[0]: one.log_evidence - base for one in found.ranked(1)},
        },
        "notes": list(found.warnings),
        "calls": found.calls,
        "failed_calls": found.failed,
    }


def _effect(found: Findings, name: str) -> dict[str, Any]:
    candidate = found.field.base.fitter.candidates[name]
    member = next(member for member, (own, _) in found.decision.named.items() if own == name)
    sets = found.decision.probability
    return {
        "id": name,
        "family": candidate.family,
        "parameters": {p.name: found.parameters[p.name].to_json() for p in candidate.parameters},
        "probability": sum(weight for held, weight in sets.items() if {member, name} & set(held)),
        "gain": found.gain_of(member),
        "form_compared": name not in found.forms_taken,
    }
