"""The report's text and tables, from the JSON results; empty where a result is absent."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from torsight.actuator.quantities import for_people
from torsight.core.errors import InputError
from torsight.core.files.results import RunResults
from torsight.core.files.small_pictures import encoded, shrunk
from torsight.core.words.wording import (
    clock_words,
    decides,
    effect_name,
    error_words,
    estimate,
    explanations,
    fixed,
    held_out_errors,
    is_plain_answer,
    listed,
    not_explained,
    not_fixed,
    number,
    predicts_worse,
    times_floor,
    variable_name,
)
from torsight.report.figures.planned import segments, worth
from torsight.report.plots.formulas import equation_pictures, symbol, titled

FILES: Final = {
    "angle.csv": "angle of every frame",
    "markers.csv": "positions of the four markers",
    "merged.csv": "angle and temperatures on one clock",
    "curves.csv": "the curves and residuals of this page",
    "track.json": "how well the film was tracked",
    "track.png": "frames of the film with the tracked markers",
    "sync.json": "the two clocks",
    "fit.json": "the plain model's fit",
    "discovery.json": "what was missing",
    "model.json": "the model, for torsight predict",
    "next_experiment.csv": "the programme that would distinguish the explanations",
    "recording.rrd": "the film and all curves, for torsight view",
    "provenance.json": "versions, inputs, configuration",
}


class Tile(NamedTuple):
    """A big number with its unit and a line about it; symbols in both carry their own markup."""

    label: str
    value: str
    unit: str
    note: str


def lead(results: RunResults) -> str:
    """Return the sentence under the headline: the error before and after the extension."""
    discovery = results.discovery or {}
    before, after = held_out_errors(discovery)
    floor = discovery.get("noise_floor_deg")
    ends = f" The noise floor of the record is {number(floor, 2)}°." if floor is not None else ""
    if before is None:
        return ends.strip()
    if not_fixed(discovery):
        fitted = (discovery.get("after") or {}).get("rmse_train_deg")
        ends += f" {_why_open(discovery)}"
        if fitted is not None:
            ends += f" The fit to all half-cycles leaves {error_words(float(fitted))} rms."
    if after is None or is_plain_answer(discovery):
        return f"The plain model misses held-out half-cycles by {error_words(before)} rms.{ends}"
    if not_explained(discovery):
        # The headline's ratio is not that of these two figures.
        ends += (
            f" The residual is {number(times_floor(discovery))} times that, each independent reading counted once: "
            "a rest is one reading, however long."
        )
    if worse := predicts_worse(discovery):
        return f"{worse}{ends}"
    took = f"from {error_words(before)} to {error_words(after)} rms"
    return f"The extended model takes the error on held-out half-cycles {took}.{ends}"


def _why_open(discovery: Mapping[str, Any]) -> str:
    """Return a sentence on why the error on held-out half-cycles is large although the fit to all explains them."""
    count = len(discovery.get("held_out") or [])
    others = f"the other {count - 1}" if count > 2 else "the other one"
    return (
        "The error on held-out half-cycles is no sign of a further effect: each half-cycle is predicted by a fit to "
        f"{others} alone, which does not determine the model's values. More half-cycles, and complete heatings, would."
    )


def tiles(results: RunResults) -> list[Tile]:
    """Return the three big numbers at the head of the page."""
    discovery = results.discovery
    if discovery is None:
        return [*_range_tile(results), *_friction_tile(results), *_frames_tile(results)]
    return [*_error_tile(discovery), _missing_tile(discovery), *_friction_tile(results)]


def facts(results: RunResults) -> list[Tile]:
    """Return the smaller numbers that follow the big ones."""
    if results.discovery is None:
        return []
    found = _range_tile(results)
    floor = results.discovery.get("noise_floor_deg")
    if floor is not None:
        found.append(Tile("Noise floor", number(floor, 2), "°", "no model can do better on this record"))
    return [*found, *_frames_tile(results)]


def _range_tile(results: RunResults) -> list[Tile]:
    angle = results.measured_angle_deg()
    if not len(angle):
        return []
    low, high = (fixed(float(end), 1) for end in (angle.min(), angle.max()))
    return [Tile("Range of motion", f"{np.ptp(angle):.1f}", "°", f"{low}° to {high}°")]


def _frames_tile(results: RunResults) -> list[Tile]:
    valid = results.measured_frames()
    if not len(valid):
        return []
    return [Tile("Frames measured", f"{100.0 * valid.mean():.1f}", "%", f"{int(valid.sum())} of {len(valid)}")]


def _friction_tile(results: RunResults) -> list[Tile]:
    friction = results.parameters().get("tau_c_mnm")
    if friction is None:
        return []
    words, _, interval = estimate(friction).partition(" (")
    value, _, unit = words.partition(" ")
    note = interval.rstrip(")") or "no interval"
    discovery = results.discovery or {}
    plain = (discovery.get("plain_parameters") or {}).get("tau_c_mnm")
    if plain is not None and number(plain.get("value"), 2) != number(friction.get("value"), 2):
        note += f"; the plain model said {number(plain.get('value'))}"
    return [Tile(Markup("Friction torque {}").format(symbol("tau_c_mnm")), value, unit, note)]


def _missing_tile(discovery: Mapping[str, Any]) -> Tile:
    effects = discovery.get("effects") or []
    verdict = str(discovery.get("verdict"))
    if verdict == "none" or (not effects and verdict not in {"unknown", "ambiguous"}):
        return Tile("Missing effect", "none", "", "that this record can show")
    if verdict == "ambiguous":
        options = explanations(discovery)
        return Tile("Missing effect", f"1 of {max(2, len(options))}", "", listed(options, last="or"))
    if verdict == "unknown":
        drivers = [variable_name(str(one["variable"])) for one in (discovery.get("drivers") or [])[:2]]
        note = f"a measured law stands in; it depends on {listed(drivers)}" if drivers else "and no law of one variable"
        return Tile("Missing effect", "no known one", "", note)
    names = listed([effect_name(str(effect["id"])) for effect in effects])
    values = [_telling(effect) for effect in effects]
    label = "Missing effect" if len(effects) == 1 else "Missing effects"
    return Tile(label, names, "", Markup("<br>").join(value for value in values if value))


def _telling(effect: Mapping[str, Any]) -> Markup:
    """Return the most meaningful value of an effect: one computed from the fitted values, else the first of these."""
    made = list(for_people(effect).items())[:1]
    values = [Markup("{} {}").format(titled(name), value_words(value)) for name, value in made]
    title = str(effect.get("title") or "")
    return Markup(": ").join([*([escape(title)] if title else []), *values])


def value_words(value: Mapping[str, Any]) -> str:
    """Return an estimate in words; angles in radians also in degrees."""
    words = estimate(value)
    if value.get("unit") != "rad" or value.get("value") is None:
        return words
    return f"{words}, {fixed(math.degrees(float(value['value'])), 1)}°"


def _error_tile(discovery: Mapping[str, Any]) -> list[Tile]:
    before, after = (discovery.get(name) or {} for name in ("before", "after"))
    seen = "rmse_held_out_deg"
    note = "rms on held-out half-cycles, each predicted by a fit without it"
    if before.get(seen) is None:
        seen, note = "rmse_train_deg", "rms on the half-cycles that were fitted; none could be held out"
    if before.get(seen) is None:
        return []
    value = error_words(before[seen])[:-1]
    if after.get(seen) is not None and not is_plain_answer(discovery):
        value = f"{value} → {error_words(after[seen])[:-1]}"
    return [Tile("Error", value, "°", note)]


def missing(results: RunResults) -> dict[str, Any]:
    """Return the content of the section on the missing effect."""
    discovery = results.discovery
    if discovery is None:
        return {}
    shares = _shares(discovery)
    effects = [
        {
            "name": effect_name(str(effect["id"])),
            "share": shares.get(str(effect["id"])),
            "equation": equation_pictures(str(effect["id"])),
            "family": effect_name(str(effect.get("family", ""))),
            "title": str(effect.get("title") or ""),
            "probability": effect.get("probability"),
            "parameters": [
                (titled(name), value_words(value)) for name, value in (effect.get("parameters") or {}).items()
            ],
        }
        for effect in discovery.get("effects") or []
    ]
    largest = max((float(item["share"]) for item in discovery.get("drivers") or []), default=0.0)
    drivers = [
        {
            "name": variable_name(str(item["variable"])),
            "percent": 100.0 * float(item["share"]),
            "length": 100.0 * float(item["share"]) / largest if largest > 0 else 0.0,
        }
        for item in discovery.get("drivers") or []
    ]
    scores = [
        (label, [(discovery.get(name) or {}).get(key) for name in ("before", "after")])
        for label, key in (
            ("rms on the half-cycles that were fitted (°)", "rmse_train_deg"),
            ("rms on held-out half-cycles (°)", "rmse_held_out_deg"),
            ("R² on held-out half-cycles", "r2_held_out"),
        )
    ]
    return {
        "verdict": discovery.get("verdict"),
        "searched": bool((discovery.get("evidence") or {}).get("gains")),
        "unexplained": bool(not_explained(discovery)),
        "effects": effects,
        "drivers": drivers,
        "explanations": explanations(discovery) if discovery.get("verdict") == "ambiguous" else [],
        "next": planned(discovery.get("next_experiment")),
        "scores": [(label, *(score(value) for value in values)) for label, values in scores],
        "held_out": _held_out(results),
    }


def _shares(discovery: Mapping[str, Any]) -> dict[str, float]:
    """Return the share of the plain model's squared error that each effect explains, percent.

    The share of the whole set is divided in proportion to the loss without each member.
    """
    gains = {str(effect["id"]): effect.get("gain") for effect in discovery.get("effects") or []}
    if len(gains) == 1:
        gains = dict.fromkeys(gains, 1.0)
    before, after = held_out_errors(discovery)
    if any(gain is None or gain <= 0.0 for gain in gains.values()) or after is None or not before:
        return {}
    explained = 100.0 * max(0.0, 1.0 - (after / before) ** 2)
    total = sum(gains.values())
    return {name: explained * gain / total for name, gain in gains.items()}


def _held_out(results: RunResults) -> str:
    numbers = [int(one) + 1 for one in (results.discovery or {}).get("held_out") or []]
    if not numbers:
        return ""
    curves = results.curves
    if curves is not None and "held_out" in curves.columns and (curves["held_out"].to_numpy() > 0.5).all():
        return "Each half-cycle was held out of the fit once, and predicted by it."
    return f"Held out of the fit: half-cycle {', '.join(str(one) for one in numbers)}."


def score(value: float | None) -> str:
    """Return an error or a share of variance in words; a share keeps its leading nines and two digits more."""
    if value is None:
        return "–"
    if not 0.9 < value < 1.0:
        return number(value)
    return f"{value:.{min(9, 2 - math.floor(math.log10(1.0 - value)))}f}"


def planned(content: Any) -> dict[str, Any]:
    """Return the content on the next experiment: its sentence, its worth, its segments."""
    if not isinstance(content, Mapping):
        return {"other": plain_items(content)} if content else {}
    known = {"text", "segments", "duration_s", "pairs", "file", "needed_gain"}
    other = {key: value for key, value in content.items() if key not in known and "separation" not in key}
    return {
        "text": content.get("text"),
        "decides": decides(content),
        "worth": worth(content),
        "segments": segments(content),
        "other": plain_items(other),
    }


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


def tracking(results: RunResults) -> dict[str, Any]:
    """Return the content of the section on the tracking."""
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


def track_picture(results: RunResults) -> str | None:
    """Return ``track.png`` as a data URL; None where no film was tracked.

    In the page the picture is a WebP, a fifth as large; the file beside the page has every pixel.
    """
    import cv2

    path = results.folder / "track.png"
    if results.track is None or not path.is_file():
        return None
    picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError("is not a picture", where=str(path), do="delete it, or track the film again")
    # Twice as wide as the widest column; at OpenCV's own middle of qualities letters of ten pixels are clean.
    content = encoded(shrunk(np.asarray(picture, np.uint8), 2240), ".webp", quality=80)
    return f"data:image/webp;base64,{base64.b64encode(content).decode('ascii')}"


def clocks(results: RunResults) -> list[tuple[str, str]]:
    """Return the lines on the two clocks."""
    sync = results.sync
    if sync is None:
        return []
    lines = clock_words(sync, unknown="interval unknown")
    lines.append(("found from", str(sync.get("method", "not said"))))
    lines.append(("meaning", "temperature time = film time × (1 + drift) + offset"))
    return lines


def origin(results: RunResults) -> dict[str, Any]:
    """Return the content of the section on the provenance."""
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
    """Return the result files beside the page."""
    return [(name, words) for name, words in FILES.items() if (folder / name).exists()]
