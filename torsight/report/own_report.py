"""``report.html`` of a model of one's own: the verdict, pictures, parameters, and what was compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Any

from torsight.core.words.wording import estimate, number
from torsight.discovery.own.answer import words
from torsight.discovery.own.answer.findings import Findings
from torsight.report.figures.own import figures_of, is_ours
from torsight.report.write import write_page


def write_own_report(found: Findings, folder: Path, *, model: Path, records: Sequence[Path]) -> Path:
    """Write ``report.html``, one page that needs no other file and no network, and its figures in ``figures/``."""
    shown = {"name": model.stem, "records": [path.name for path in records], **contents(found)}
    return write_page(folder, shown | {"figures": figures_of(found)}, template="own_report.html", ours=is_ours)


def contents(found: Findings) -> dict[str, Any]:
    """Return the content of the page, by the names that its template uses."""
    candidates = found.field.base.fitter.candidates
    plain = {name: estimate(one.to_json()) for name, one in found.plain_parameters.items()}
    return {
        "verdict": found.verdict,
        "headline": words.verdict_words(found),
        "errors": [
            (name, *(number(value) for both in zip(astuple(before), astuple(after), strict=True) for value in both))
            for name, (before, after) in found.errors.items()
        ],
        "not_predicted": words.not_predicted(found),
        "effects": [
            (name, [(p.name, estimate(found.parameters[p.name].to_json())) for p in candidates[name].parameters])
            for name in found.effects
        ],
        "parameters": [(name, estimate(one.to_json()), plain.get(name, "–")) for name, one in found.parameters.items()],
        "fits": [
            (" + ".join(one.effects) or "plain model", *map(number, (one.rmse_train, one.rmse_held_out, one.gain)))
            for one in found.best_fits
        ],
        "larger": [words.larger_words(one) for one in found.predicts_better[:1]],
        "notes": found.warnings,
        "failures": found.failures,
        "next": words.what_next(found),
    }
