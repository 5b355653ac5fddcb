"""Doubts about a run's results, in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from torsight.core.files.results import RunResults
from torsight.core.words.wording import effect_name, explanations, has_unnamed_law
from torsight.discovery.settings import Settings
from torsight.report.plots.formulas import with_symbols
from torsight.report.sections.page_content import in_words
from torsight.report.sections.parameter_table import Prior, contradicted, priors


def doubts(results: RunResults) -> list[Markup]:
    """Return every doubt once: about the film, the clocks, the fit and the discovery, and the notes of the stages."""
    found = _of_angle(results) + _of_clocks(results.sync or {})
    if results.fit is not None and results.fit.get("converged") is False:
        found.append("The fit of the plain model did not converge.")
    if results.discovery is not None:
        found += _of_discovery(results.discovery)
        found += _of_parameters(results.discovery.get("parameters") or {}, priors(results))
    for document in (results.track, results.sync, results.fit, results.discovery):
        for key in ("notes", "warnings", "not_sure"):
            extra = (document or {}).get(key) or []
            found += [extra] if isinstance(extra, str) else [in_words(one) for one in extra]
    # A discovery reports the residual of its own model.
    settled = (results.fit or {}).get("attention") or () if results.discovery is not None else ()
    sentences = (as_sentence(one) for one in found if one.strip() and one not in settled)
    return [with_symbols(one) for one in dict.fromkeys(sentences)]


def as_sentence(words: str) -> str:
    """Return words with an initial capital and a full stop; a name with an underscore keeps its letters."""
    words = words.strip()
    first = words.split()[0]
    start = words if "_" in first else words[0].upper() + words[1:]
    return start if start[-1] in ".!?" else f"{start}."


def _of_angle(results: RunResults) -> list[str]:
    table = results.angle
    if table is None:
        return []
    found = []
    valid = results.measured_frames()
    if not valid.all():
        found.append(f"The angle is not known in {int((~valid).sum())} of {len(valid)} frames.")
    if "branch_certain" in table.columns:
        certain = table["branch_certain"].to_numpy(dtype=float) > 0.5
        if not certain.all():
            found.append(f"In {int((~certain).sum())} frames after a gap the number of whole turns is a guess.")
    return found


def _of_clocks(sync: Mapping[str, Any]) -> list[str]:
    return [
        f"This record does not determine the clocks' {name}."
        for name in ("offset_s", "drift_ppm")
        if name in sync and None in ((sync[name] or {}).get("ci95") or [None])
    ]


def _of_discovery(discovery: Mapping[str, Any]) -> list[str]:
    found = []
    if discovery.get("verdict") == "ambiguous":
        found.append(f"This record cannot distinguish: {'; '.join(explanations(discovery))}.")
    if has_unnamed_law(discovery):
        found.append("A measured law is known where this record covered its variable; beyond that it is a guess.")
    if not discovery.get("held_out"):
        found.append("No half-cycle could be held out, so the errors are those of the fit itself.")
    for effect in discovery.get("effects") or []:
        chance = effect.get("probability")
        # discovery.json does not record whether the engine used another level.
        if chance is not None and chance < Settings().credible:
            found.append(f"The effect '{effect_name(str(effect['id']))}' is named with probability {chance:.2f} only.")
    return found


def _of_parameters(parameters: Mapping[str, Any], known: Mapping[str, Prior]) -> list[str]:
    found = []
    for name, value in parameters.items():
        if not value.get("fixed") and None in (value.get("ci95") or [None]):
            found.append(f"The record says nothing about {name}.")
        pull = known[name].pull(value) if name in known else None
        # The friction's characterised value is only a start for the fit.
        if pull is not None and contradicted(pull) and name != "tau_c_mnm":
            found.append(f"The record contradicts the characterised {name} by {abs(pull):.1f} standard deviations.")
    return found
