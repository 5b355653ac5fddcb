"""The report's words and tables, from the JSON results; where one is absent the answer is empty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from torsight.core.results import RunResults
from torsight.core.wording import effect_name, estimate, explanations, fixed, number, variable_name
from torsight.report.priors import Prior, common_reach, priors

FILES: Final = {
    "angle.csv": "angle of every frame",
    "markers.csv": "positions of the four markers",
    "merged.csv": "angle and temperatures on one clock",
    "curves.csv": "the curves and residuals of this page",
    "track.json": "account of the tracking",
    "sync.json": "the two clocks",
    "fit.json": "the plain model's fit",
    "discovery.json": "what was missing",
    "model.json": "the model, for torsight predict",
    "recording.rrd": "the run to look at, for torsight view",
    "provenance.json": "versions, inputs, configuration",
}


class Tile(NamedTuple):
    """A big number with its unit and a line about it."""

    label: str
    value: str
    unit: str
    note: str


def lead(results: RunResults) -> str:
    """Return the sentence under the headline: what the extension did to the error."""
    discovery = results.discovery or {}
    before = (discovery.get("before") or {}).get("rmse_held_out_deg")
    after = (discovery.get("after") or {}).get("rmse_held_out_deg")
    floor = discovery.get("noise_floor_deg")
    ends = f" The noise floor of the record is {number(floor, 2)}°." if floor is not None else ""
    if before is None:
        return ends.strip()
    if not discovery.get("effects") and discovery.get("verdict") == "none":
        return f"The plain model misses half-cycles that it has not seen by {error(before)} rms.{ends}"
    if after is None:
        return f"The plain model misses half-cycles that it has not seen by {error(before)} rms.{ends}"
    means = "The learned closure takes" if discovery.get("verdict") == "unknown" else "The extended model takes"
    return (
        f"{means} the error on half-cycles that the fit did not see from {error(before)} to {error(after)} rms.{ends}"
    )


def error(value_deg: float) -> str:
    """Return an error with three digits, or two below one degree."""
    return f"{number(value_deg, 3 if value_deg >= 1.0 else 2)}°"


def tiles(results: RunResults) -> list[Tile]:
    """Return the big numbers at the head of the page."""
    found: list[Tile] = []
    angle = measured_angle(results)
    if len(angle):
        found.append(
            Tile("Range of motion", f"{np.ptp(angle):.1f}", "°", f"{_deg(angle.min())} to {_deg(angle.max())}")
        )
    friction = best_parameters(results).get("tau_c_mnm")
    if friction is not None:
        words, _, interval = estimate(friction).partition(" (")
        value, _, unit = words.partition(" ")
        found.append(Tile("Friction torque", value, unit, interval.rstrip(")") or "no interval"))
    discovery = results.discovery
    if discovery is not None:
        found.append(_missing_tile(discovery))
        found += _error_tiles(discovery)
    if results.angle is not None:
        valid = results.angle["valid"].to_numpy(dtype=float) > 0.5
        found.append(Tile("Frames measured", f"{100.0 * valid.mean():.1f}", "%", f"{int(valid.sum())} of {len(valid)}"))
    return found


def _missing_tile(discovery: Mapping[str, Any]) -> Tile:
    effects = discovery.get("effects") or []
    verdict = str(discovery.get("verdict"))
    if verdict == "none" or (not effects and verdict not in {"unknown", "ambiguous"}):
        return Tile("Missing effect", "none", "", "that this record can show")
    if verdict == "ambiguous":
        return Tile("Missing effect", f"1 of {max(2, len(explanations(discovery)))}", "", "explanations fit alike")
    if verdict == "unknown":
        return Tile("Missing effect", "unnamed", "", "a learned closure stands in")
    names = ", ".join(effect_name(str(effect["id"])) for effect in effects)
    chance = effects[0].get("probability")
    return Tile("Missing effect", names, "", "" if chance is None else f"probability {float(chance):.3f}")


def _error_tiles(discovery: Mapping[str, Any]) -> list[Tile]:
    before, after = (discovery.get(name) or {} for name in ("before", "after"))
    floor = discovery.get("noise_floor_deg")
    seen = "rmse_held_out_deg"
    note = "rms on half-cycles that the fit did not see"
    if before.get(seen) is None:
        seen, note = "rmse_train_deg", "rms on the half-cycles that were fitted; none could be held out"
    found = []
    if before.get(seen) is not None:
        value = error(before[seen])[:-1]
        if after.get(seen) is not None and discovery.get("verdict") != "none":
            value = f"{value} → {error(after[seen])[:-1]}"
        found.append(Tile("Error", value, "°", note))
    if floor is not None:
        found.append(Tile("Noise floor", number(floor, 2), "°", "no model can do better on this record"))
    return found


def measured_angle(results: RunResults) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the measured angles that are known, deg."""
    for table in (results.angle, results.merged, results.curves):
        if table is not None:
            values = table["angle_deg"].to_numpy(dtype=np.float64)
            if "valid" in table.columns:
                values = values[table["valid"].to_numpy(dtype=np.float64) > 0.5]
            return np.asarray(values[np.isfinite(values)])
    return np.empty(0)


def best_parameters(results: RunResults) -> dict[str, Any]:
    """Return the parameters of the extended model, or of the plain one where there is no other."""
    for document in (results.discovery, results.fit):
        if document is not None and document.get("parameters"):
            return dict(document["parameters"])
    return {}


def missing(results: RunResults) -> dict[str, Any]:
    """Return what the section on the missing effect shows."""
    discovery = results.discovery
    if discovery is None:
        return {}
    effects = [
        {
            "name": effect_name(str(effect["id"])),
            "id": effect["id"],
            "family": effect_name(str(effect.get("family", ""))),
            "title": str(effect.get("title") or ""),
            "probability": effect.get("probability"),
            "parameters": [(name, estimate(value)) for name, value in (effect.get("parameters") or {}).items()],
        }
        for effect in discovery.get("effects") or []
    ]
    largest = max((float(item["share"]) for item in discovery.get("drivers") or []), default=0.0)
    drivers = [
        {
            "name": variable_name(str(item["variable"])),
            "variable": item["variable"],
            "percent": 100.0 * float(item["share"]),
            "length": 100.0 * float(item["share"]) / largest if largest > 0 else 0.0,
        }
        for item in discovery.get("drivers") or []
    ]
    scores = [
        (label, [(discovery.get(name) or {}).get(key) for name in ("before", "after")])
        for label, key in (
            ("rms on the half-cycles that were fitted (°)", "rmse_train_deg"),
            ("rms on half-cycles that were not seen (°)", "rmse_held_out_deg"),
            ("R² on half-cycles that were not seen", "r2_held_out"),
        )
    ]
    return {
        "verdict": discovery.get("verdict"),
        "effects": effects,
        "drivers": drivers,
        "explanations": explanations(discovery) if discovery.get("verdict") == "ambiguous" else [],
        "next": plain_items(discovery.get("next_experiment")),
        "scores": [(label, *(_score(value) for value in values)) for label, values in scores],
        "held_out": _held_out(results),
    }


def _held_out(results: RunResults) -> str:
    numbers = [int(one) + 1 for one in (results.discovery or {}).get("held_out") or []]
    if not numbers:
        return ""
    curves = results.curves
    if curves is not None and "held_out" in curves.columns and (curves["held_out"].to_numpy() > 0.5).all():
        return "Each half-cycle was left out of the fit once, and predicted by it."
    return f"Not seen by the fit: half-cycle {', '.join(str(one) for one in numbers)}."


def _score(value: float | None) -> str:
    if value is None:
        return "–"
    if not 0.9 < value < 1.0:
        return number(value)
    # As many nines as there are, and two digits more.
    return f"{value:.{min(9, 2 - math.floor(math.log10(1.0 - value)))}f}"


def plain_items(value: Any) -> list[tuple[str, str]]:
    """Return a JSON value as rows of name and words, nested names joined by a dot."""
    if value is None or value in ({}, []):
        return []
    if isinstance(value, Mapping):
        rows: list[tuple[str, str]] = []
        for name, item in value.items():
            if isinstance(item, Mapping):
                rows += [(f"{name}.{inner}", words) for inner, words in plain_items(item)]
            else:
                rows.append((str(name), in_words(item)))
        return rows
    return [("", in_words(value))]


def in_words(value: Any) -> str:
    """Return a JSON value as words on one line."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {in_words(item)}" for name, item in value.items())
    if isinstance(value, (list, tuple)):
        separator = "; " if any(isinstance(item, (Mapping, list)) for item in value) else ", "
        return separator.join(in_words(item) for item in value)
    if isinstance(value, float):
        return f"{value:g}"
    return "–" if value is None else str(value)


def parameter_table(results: RunResults) -> dict[str, Any]:
    """Return the table of parameters: characterised, plain fit, extended fit, and how far each was pulled."""
    discovery = results.discovery or {}
    plain = dict(discovery.get("plain_parameters") or (results.fit or {}).get("parameters") or {})
    extended = dict(discovery.get("parameters") or {})
    known = priors(results)
    own = {
        name: value
        for effect in (results.discovery or {}).get("effects") or []
        for name, value in (effect.get("parameters") or {}).items()
    }
    both = {
        name: (plain.get(name), extended.get(name, own.get(name))) for name in dict.fromkeys([*plain, *extended, *own])
    }
    free = {name: pair for name, pair in both.items() if not (pair[1] or pair[0] or {}).get("fixed")}
    reach = common_reach(known[name].pull(fitted) for name, pair in free.items() if name in known for fitted in pair)
    rows = [_row(name, known.get(name), *pair, reach=reach) for name, pair in free.items()]
    exact = [_exact(name, pair[1] or pair[0] or {}) for name, pair in both.items() if name not in free]
    return {"rows": rows, "exact": exact, "pulled": any(row["prior"] for row in rows)}


def _exact(name: str, value: Mapping[str, Any]) -> str:
    return f"{name} {value.get('value') or 0.0:g} {value.get('unit') or ''}".strip()


def _row(
    name: str, prior: Prior | None, plain: Mapping[str, Any] | None, after: Mapping[str, Any] | None, *, reach: float
) -> dict[str, Any]:
    shown = after or plain or {}
    pulls = [None if prior is None else prior.pull(item) for item in (plain, after)]
    return {
        "name": name,
        "unit": shown.get("unit") or "",
        "prior": "" if prior is None else prior.words(),
        "plain": "" if plain is None else estimate({**plain, "unit": ""}),
        "after": "" if after is None else estimate({**after, "unit": ""}),
        "pulls": ["" if pull is None else f"{pull:+.1f}".replace("-", "−") for pull in pulls],
        "far": [pull is not None and abs(pull) > 3.0 for pull in pulls],
        "picture": "" if prior is None else prior.picture(plain, after, reach=reach),
    }


def fit_lines(results: RunResults) -> list[tuple[str, str]]:
    """Return the plain fit's own account."""
    fit = results.fit
    if fit is None:
        return []
    lines = [
        ("rms of the plain fit", f"{number(fit.get('rmse_deg'))}°"),
        ("R²", _score(fit.get("r2"))),
        ("case of the cooling", f"({fit.get('case')})"),
    ]
    angles = ("theta_1_deg", "theta_2_deg", "theta_3_deg", "beta_cr_deg")
    return lines + [(name, f"{fixed(fit.get(name), 1)}°") for name in angles]


def tracking(results: RunResults) -> dict[str, Any]:
    """Return what the section on the tracking shows."""
    track = results.track or {}
    events = [
        (
            number(event.get("time_s"), 5),
            str(event.get("frame", "")),
            str(event.get("kind", "")),
            str(event.get("text")),
        )
        for event in track.get("events") or []
    ]
    advice = track.get("advice") or []
    left_out = {"events", "advice", "schema"}
    return {
        "events": events[:200],
        "more_events": max(0, len(events) - 200),
        "advice": [advice] if isinstance(advice, str) else [in_words(one) for one in advice],
        "account": plain_items({name: value for name, value in track.items() if name not in left_out})[:40],
    }


def clocks(results: RunResults) -> list[tuple[str, str]]:
    """Return the lines on the two clocks."""
    sync = results.sync
    if sync is None:
        return []
    lines = []
    for name, label, unit in (("offset_s", "offset", "s"), ("drift_ppm", "drift", "ppm")):
        part = sync.get(name) or {}
        low, high = part.get("ci95") or (None, None)
        interval = "interval unknown" if low is None or high is None else f"95 %: {number(low)} to {number(high)}"
        lines.append((label, f"{number(part.get('value'), 4)} {unit} ({interval})"))
    lines.append(("evidence", str(sync.get("method", "not said"))))
    lines.append(("meaning", "temperature time = film time × (1 + drift) + offset"))
    return lines


def origin(results: RunResults) -> dict[str, Any]:
    """Return what the section on the provenance shows."""
    content = results.provenance
    if content is None:
        return {}
    return {
        "command": content.get("command"),
        "seed": content.get("seed"),
        "versions": list((content.get("versions") or {}).items()),
        "inputs": [(name, str(value)) for name, value in (content.get("inputs") or {}).items()],
        "configuration": plain_items(content.get("configuration")),
    }


def files(folder: Path) -> list[tuple[str, str]]:
    """Return the result files that lie beside the page."""
    return [(name, words) for name, words in FILES.items() if (folder / name).exists()]


def _deg(value: float) -> str:
    return f"{value:.1f}°".replace("-", "−")
