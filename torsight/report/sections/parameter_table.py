"""The table of parameters and the plain model's fit in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from torsight.actuator.quantities import quantity
from torsight.core.files.results import RunResults
from torsight.core.words.wording import case_words, estimate, fixed, number
from torsight.report.plots.formulas import symbol, titled
from torsight.report.sections.page_content import score
from torsight.report.sections.prior_pulls import Prior, contradicted, priors


def parameter_table(results: RunResults) -> dict[str, Any]:
    """Return the table of parameters: characterised value, plain fit, extended fit, and the pull of each."""
    discovery = results.discovery or {}
    plain = dict(discovery.get("plain_parameters") or (results.fit or {}).get("parameters") or {})
    extended = dict(discovery.get("parameters") or {})
    known = priors(results)
    own = {
        name: value
        for effect in (results.discovery or {}).get("effects") or []
        for name, value in (effect.get("parameters") or {}).items()
    }
    # A law is shown as a curve: its coefficients on functions of its own mean nothing beside it.
    names = [name for name in dict.fromkeys([*plain, *extended, *own]) if "@" not in name]
    both = {name: (plain.get(name), extended.get(name, own.get(name))) for name in names}
    free = {name: pair for name, pair in both.items() if not (pair[1] or pair[0] or {}).get("fixed")}
    rows = [_row(name, known.get(name), *pair) for name, pair in free.items()]
    exact = [_exact(name, pair[1] or pair[0] or {}) for name, pair in both.items() if name not in free]
    return {"rows": rows, "exact": exact, "pulled": any(row["prior"] for row in rows), "extended": bool(extended)}


def _exact(name: str, value: Mapping[str, Any]) -> Markup:
    words = f"{value.get('value') or 0.0:g} {value.get('unit') or ''}".strip()
    return Markup("{} {}").format(titled(name), words)


def _row(
    name: str, prior: Prior | None, plain: Mapping[str, Any] | None, after: Mapping[str, Any] | None
) -> dict[str, Any]:
    shown = after or plain or {}
    pulls = [None if prior is None else prior.pull(item) for item in (plain, after)]
    return {
        "name": symbol(name),
        "title": quantity(name).title,
        "unit": shown.get("unit") or "",
        "prior": "" if prior is None else prior.words(),
        "plain": "" if plain is None else _interval(plain),
        "after": "" if after is None else _interval(after),
        "pulls": ["" if pull is None else f"{pull:+.1f}".replace("-", "−") for pull in pulls],
        "far": [contradicted(pull) for pull in pulls],
    }


def _interval(value: Mapping[str, Any]) -> str:
    """Return a value with its interval; the head of the table says that it is one of 95 %, and the unit."""
    return estimate({**value, "unit": ""}).replace("95 %: ", "")


def fit_lines(results: RunResults) -> list[tuple[str | Markup, str]]:
    """Return the plain model's fit in numbers."""
    fit = results.fit
    if fit is None:
        return []
    lines: list[tuple[str | Markup, str]] = [
        ("rms of the plain model", f"{number(fit.get('rmse_deg'))}°"),
        ("R²", score(fit.get("r2"))),
        ("while the driven spring cools", case_words(str(fit.get("case")))),
    ]
    angles = ("theta_1_deg", "theta_2_deg", "theta_3_deg", "beta_cr_deg")
    return lines + [(titled(name), f"{fixed(fit.get(name), 1)}°") for name in angles]
