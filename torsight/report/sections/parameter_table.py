"""The table of parameters, their pulls (distances of fitted from characterised values), the plain fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from torsight.actuator.quantities import quantity
from torsight.core.errors import TorsightError
from torsight.core.files.results import RunResults
from torsight.core.files.storage import read_toml
from torsight.core.words.wording import CONTRADICTED_SIGMAS, case_words, decimals_for, estimate, fixed, number
from torsight.report.plots.formulas import symbol, titled
from torsight.report.sections.page_content import score


@dataclass(frozen=True, slots=True)
class Prior:
    """A characterised value and its standard deviation, in the parameter's own unit."""

    value: float
    sigma: float | None

    def words(self) -> str:
        """Return ``60.0 ± 1.8``."""
        if self.sigma is None:
            return f"{self.value:g}, taken as exact"
        decimals = decimals_for(self.sigma)
        return f"{fixed(self.value, decimals)} ± {fixed(self.sigma, decimals)}"

    def pull(self, fitted: Mapping[str, Any] | None) -> float | None:
        """Return how many standard deviations the fit lies from the characterised value."""
        value = None if fitted is None else fitted.get("value")
        if value is None or self.sigma is None or self.sigma <= 0.0:
            return None
        return (float(value) - self.value) / self.sigma

    def interval(self, fitted: Mapping[str, Any]) -> tuple[float, float] | None:
        """Return the 95 % interval of a fit in the same unit; None where there is none."""
        low, high = fitted.get("ci95") or (None, None)
        if low is None or high is None or fitted.get("fixed") or not self.sigma:
            return None
        return (float(low) - self.value) / self.sigma, (float(high) - self.value) / self.sigma


def contradicted(pull: float | None) -> bool:
    """Return whether a fit lies further from a characterised value than chance explains."""
    return pull is not None and abs(pull) > CONTRADICTED_SIGMAS


def common_reach(pulls: Iterable[float | None]) -> float:
    """Return the half-width, in standard deviations, at which pulls can be compared by eye: chance lies within."""
    return max([CONTRADICTED_SIGMAS, *(1.1 * abs(pull) for pull in pulls if pull is not None)])


def priors(results: RunResults) -> dict[str, Prior]:
    """Return the characterised values: those that the model file carries, else those of the actuator file used."""
    content = (results.model or {}).get("actuator")
    if not isinstance(content, Mapping):
        content = _actuator_file(results)
    sigmas = content.get("uncertainty") or {}
    values = {
        key: value
        for table, keys in content.items()
        if table != "uncertainty" and isinstance(keys, Mapping)
        for key, value in keys.items()
    }
    return {
        key: Prior(float(value), _positive(sigmas.get(key)))
        for key, value in values.items()
        if isinstance(value, (int, float)) and math.isfinite(value)
    }


def _actuator_file(results: RunResults) -> Mapping[str, Any]:
    configuration = (results.provenance or {}).get("configuration") or {}
    name = (configuration.get("actuator") or {}).get("file")
    if not isinstance(name, str):
        return {}
    try:
        return read_toml(results.folder / name)
    except TorsightError:
        # The report may be made again where the actuator file is no longer at hand.
        return {}


def _positive(sigma: Any) -> float | None:
    return float(sigma) if isinstance(sigma, (int, float)) and sigma > 0 else None


def parameter_table(results: RunResults) -> dict[str, Any]:
    """Return the table of parameters: characterised value, plain fit, extended fit, and the pull of each."""
    discovery = results.discovery or {}
    plain = dict(discovery.get("plain_parameters") or (results.fit or {}).get("parameters") or {})
    extended = dict(discovery.get("parameters") or {})
    known = priors(results)
    own = {
        name: value
        for effect in discovery.get("effects") or []
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
