"""Results in plain words, shared by the report, the viewer and the terminal."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

VARIABLES: Final = {
    "angle_deg": "the angle",
    "angle_rate_deg_s": "the rate of the angle",
    "temp_active_c": "the driven spring's temperature",
    "temp_passive_c": "the other spring's temperature",
    "temp_rate_c_s": "the rate of the temperature",
    "time_s": "time",
    "cycle": "the number of the cycle",
    "dwell_s": "the time at rest",
    "direction": "the direction",
    "winding_deg": "the winding of the spring",
    "spring": "the spring",
}
"""Drivers on which a missing effect can depend, in words."""


_NAMES: Final = {"r_phase": "R-phase", "end_stop": "one end stop", "end_stops": "two end stops"}
"""Names of effects whose id does not read as words."""


def variable_name(identifier: str) -> str:
    """Return a driver of ``discovery.json`` as words."""
    return VARIABLES.get(identifier, effect_name(identifier))


def effect_name(identifier: str) -> str:
    """Return an effect's or a law's id as words: ``sensor lag``, or ``friction over the angle``.

    A law of a model of one's own, such as ``drag_n(speed)``, keeps the names of that model.
    """
    if "(" in identifier:
        return identifier
    for driver, words in VARIABLES.items():
        if identifier.endswith(f"_{driver}"):
            return f"{identifier.removesuffix(f'_{driver}').replace('_', ' ')} over {words}"
    return _NAMES.get(identifier, identifier.replace("_", " "))


def case_words(case: str) -> str:
    """Return the actuator's behaviour in the paper's case of a cooling, ``a`` or ``b``, in words."""
    return {"a": "the actuator moves back while it cools", "b": "the actuator stands still while it cools"}.get(
        case, "–"
    )


def capital(words: str) -> str:
    """Return words with a capital first letter."""
    return f"{words[:1].upper()}{words[1:]}"


def counted(count: int, name: str) -> str:
    """Return ``1 half-cycle`` or ``3 half-cycles``."""
    return f"{count} {name}{'' if count == 1 else 's'}"


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with ``digits`` significant digits, a true minus sign, and – where it is not known."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude < -4 or magnitude > 5:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    return f"{value:.{max(0, digits - 1 - magnitude)}f}".replace("-", "−")


def decimals_for(sigma: float | None) -> int | None:
    """Return the number of decimals that show two digits of an uncertainty; None without an uncertainty."""
    if sigma is None or not math.isfinite(sigma) or sigma <= 0.0:
        return None
    return min(max(0, 1 - math.floor(math.log10(sigma))), 6)


def estimate(parameter: Mapping[str, Any]) -> str:
    """Return ``0.793 mN·m (95 %: 0.772 to 0.814)`` for a parameter of the JSON outputs."""
    unit = f" {parameter['unit']}" if parameter.get("unit") else ""
    decimals = decimals_for(parameter.get("sigma"))
    value = fixed(parameter.get("value"), decimals)
    low, high = parameter.get("ci95") or (None, None)
    if low is None or high is None:
        return f"{value}{unit}"
    return f"{value}{unit} (95 %: {fixed(low, decimals)} to {fixed(high, decimals)})"


def fixed(value: float | None, decimals: int | None) -> str:
    """Return a number with the given number of decimals, or with three digits where ``decimals`` is None."""
    if decimals is None or value is None or not math.isfinite(value):
        return number(value)
    return f"{value:.{decimals}f}".replace("-", "−")


def explanations(discovery: Mapping[str, Any]) -> list[str]:
    """Return the explanations of an ambiguous answer in words, the accepted one first, without duplicates.

    An explanation that is a subset of another one is marked with "alone".
    """
    sets = _explanations(discovery)

    def words(one: Sequence[str]) -> str:
        alone = " alone" if any(set(one) < set(other) for other in sets) else ""
        return " with ".join(effect_name(item) for item in one) + alone

    return list(dict.fromkeys(words(one) for one in sets if one))


def _explanations(discovery: Mapping[str, Any]) -> list[Sequence[str]]:
    """Return the explanations of an ambiguous answer as ids of effects and laws, the accepted one first."""
    accepted = [str(effect["id"]) for effect in discovery.get("effects") or []]
    accepted += [str(law["law"]) for law in discovery.get("laws") or [] if law.get("law") and law["effect"] is None]
    sets: list[Sequence[str]] = [accepted] if accepted else []
    return sets + [[one] if isinstance(one, str) else list(one) for one in discovery.get("alternatives") or []]


def _cannot_tell(discovery: Mapping[str, Any]) -> str:
    """Return the explanations of an ambiguous answer as a clause; what all of them contain is named once."""
    sets = _explanations(discovery)
    common = [one for one in sets[0] if all(one in other for other in sets)] if len(sets) > 1 else []
    rest = [[one for one in members if one not in common] for members in sets]
    if not common or not all(rest):
        return listed(explanations(discovery), last="or")
    options = dict.fromkeys(" with ".join(map(effect_name, members)) for members in rest)
    return f"{listed(list(options), last='or')}, each with {listed([effect_name(one) for one in common])}"


def error_words(value_deg: float | None) -> str:
    """Return an error of the angle with three digits, or two below one degree: ``6.00°``, ``0.087°``, ``< 0.001°``."""
    if value_deg is not None and 0.0 < value_deg < 5e-4:
        return "< 0.001°"
    return f"{number(value_deg, 2 if value_deg is None or value_deg < 1.0 else 3)}°"


RESOLUTION_DEG: Final = 0.1
"""A difference that does not matter: 0.02 % of the stroke."""
EXPLAINED: Final = 2.0
"""Residual in noise floors up to which a record is explained: noise and the uncertainty of the fit make that much."""


def held_out_errors(discovery: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Return the errors on held-out half-cycles of the plain and of the extended model, degrees rms.

    None where nothing could be held out: JSON has no NaN.
    """
    found = ((discovery.get(name) or {}).get("rmse_held_out_deg") for name in ("before", "after"))
    before, after = (None if left is None or math.isnan(left) else float(left) for left in found)
    return before, after


def clock_words(sync: Mapping[str, Any], *, unknown: str) -> list[tuple[str, str]]:
    """Return offset and drift of a ``sync.json`` with their intervals; ``unknown`` replaces a missing interval."""
    lines = []
    for name, label, unit in (("offset_s", "offset", "s"), ("drift_ppm", "drift", "ppm")):
        part = sync.get(name) or {}
        low, high = part.get("ci95") or (None, None)
        decimals, interval = None, unknown
        if low is not None and high is not None:
            # Two digits of the standard deviation, a quarter of the interval, also for seconds of the calendar.
            decimals = decimals_for((high - low) / 4.0)
            interval = f"95 %: {fixed(low, decimals)} to {fixed(high, decimals)}"
        lines.append((label, f"{fixed(part.get('value'), decimals)} {unit} ({interval})"))
    return lines


def error_left(discovery: Mapping[str, Any]) -> float | None:
    """Return the residual of the model of a ``discovery.json``, deg rms, on held-out half-cycles if there are any."""
    after = discovery.get("after") or {}
    left = after.get("rmse_held_out_deg")
    found = after.get("rmse_train_deg") if left is None else left
    return None if found is None or not math.isfinite(found) else float(found)


def times_floor(discovery: Mapping[str, Any]) -> float | None:
    """Return the residual of the answer in noise floors, the only measure of whether a record is explained.

    It is the engine's own (``over_floor_after``): a rest counts as one reading, correlated neighbours as one, and the
    temperature at which an incomplete heating ends is as uncertain as its readings. The error on held-out half-cycles
    also contains the uncertainty of the values; it is used only where a file has no other measure.
    """
    times = (discovery.get("evidence") or {}).get("over_floor_after")
    if times is not None:
        return float(times)
    left, floor = error_left(discovery), discovery.get("noise_floor_deg")
    return None if left is None or not floor else left / float(floor)


def unexplained(times: float, *, records: int = 1) -> str:
    """Return the sentence on a residual of more than twice the noise floor; else an empty string."""
    if times <= EXPLAINED:
        return ""
    residual = f"the residual is {number(times)} times the noise floor."
    if records == 1:
        return f"This record is not explained: {residual}"
    return (
        f"The {records} records are not explained together: {residual} If each of them is explained alone, they are "
        "not of one rig, or the rig was changed between them."
    )


def not_explained(discovery: Mapping[str, Any]) -> str:
    """Return :func:`unexplained` of a ``discovery.json``."""
    times = times_floor(discovery)
    return "" if times is None else unexplained(times, records=max(len(discovery.get("records") or ()), 1))


def not_fixed(discovery: Mapping[str, Any]) -> str:
    """Return the sentence on an explained record whose parts do not predict each other; else an empty string.

    The error on held-out half-cycles contains the uncertainty of the values from the other half-cycles, which does not
    show that the model lacks anything.
    """
    left, floor = held_out_errors(discovery)[1], discovery.get("noise_floor_deg")
    if not_explained(discovery) or left is None or not floor or left <= max(EXPLAINED * float(floor), RESOLUTION_DEG):
        return ""
    return (
        f"This record does not determine the model's values: held-out half-cycles are missed by "
        f"{error_words(left)}, {number(left / float(floor), 2)} times the noise floor."
    )


def predicts_worse(discovery: Mapping[str, Any]) -> str:
    """Return the sentence on an extended model with a larger error on held-out half-cycles; else an empty string."""
    had, left = held_out_errors(discovery)
    if had is None or left is None or is_plain_answer(discovery) or not left > had:
        return ""
    before, after = error_words(had), error_words(left)
    if before == after:
        return ""
    return (
        f"The extended model predicts held-out half-cycles worse than the plain model ({after} instead of {before} "
        "rms): it describes this record only."
    )


def decides(programme: Any) -> bool:
    """Return whether a proposed programme separates the explanations, as far as the ``discovery.json`` states that."""
    stated = programme if isinstance(programme, Mapping) else {}
    gain, needed = stated.get("separation_gain"), stated.get("needed_gain")
    return gain is None or needed is None or float(gain) >= float(needed)


CONTRADICTED_SIGMAS: Final = 4.0
"""Standard deviations by which an estimate must differ from a characterised value to be named (in the report, too):
chance reaches this for one value in 16,000, so for one actuator of ten values in 1,600; three standard deviations for
one in 37."""


def contradicted(pulls: Iterable[Mapping[str, Any]]) -> str:
    """Return the sentence on characterised values that the record contradicts; else an empty string.

    ``pulls`` are those of a ``discovery.json``.
    """
    far = [pull for pull in pulls if abs(pull["sigmas"]) > CONTRADICTED_SIGMAS]
    if not far:
        return ""
    values = ", ".join(f"{one['name']} {one['nominal']:g} → {one['value']:.4g} ({one['sigmas']:+.1f} σ)" for one in far)
    return f"The record contradicts characterised values: {values}; check the actuator file."


def is_plain_answer(discovery: Mapping[str, Any]) -> bool:
    """Return whether the model of a ``discovery.json`` is the plain one, without an effect or a law."""
    return not (discovery.get("effects") or discovery.get("drivers"))


def has_unnamed_law(discovery: Mapping[str, Any]) -> bool:
    """Return whether the answer of a ``discovery.json`` contains a measured law without a name."""
    return discovery.get("verdict") == "unknown" and bool(discovery.get("drivers"))


def doubt_of(discovery: Mapping[str, Any]) -> str:
    """Return the sentences that qualify an answer and precede it.

    They state that the record is not explained or its values not determined, and that it contradicts the actuator file.
    """
    explained = not_explained(discovery) or not_fixed(discovery)
    return f"{explained} {contradicted(discovery.get('pulls') or [])}".strip()


def verdict_sentence(discovery: Mapping[str, Any]) -> str:
    """Return the verdict of ``discovery.json`` in plain words: one sentence, preceded by those of :func:`doubt_of`."""
    return f"{doubt_of(discovery)} {named(discovery)}".strip()


def named(discovery: Mapping[str, Any]) -> str:
    """Return the finding of a ``discovery.json`` as one sentence, whether it explains the record or not."""
    verdict = discovery.get("verdict")
    names = [effect_name(str(effect["id"])) for effect in discovery.get("effects") or []]
    if verdict == "none":
        return "This record shows nothing that the model lacks."
    if verdict == "identified" and names:
        count = "an effect" if len(names) == 1 else f"{len(names)} effects"
        return f"The model lacks {count}: {listed(names)}."
    if verdict == "ambiguous":
        return f"Something is missing, and this record cannot tell which: {_cannot_tell(discovery)}."
    drivers = [variable_name(str(item["variable"])) for item in (discovery.get("drivers") or [])[:3]]
    depends = f" It depends on {listed(drivers)}." if drivers else ""
    return f"Something real is missing that no known effect explains.{depends}"


def meant(name: str, known: Iterable[str]) -> str:
    """Return the question whether a name that is not known means the most similar known one; empty without one."""
    spelled = {one.lower(): one for one in known}
    begun = [one for lower, one in spelled.items() if lower.startswith(name.lower())]
    near = begun or [spelled[one] for one in difflib.get_close_matches(name.lower(), spelled, n=1, cutoff=0.5)]
    return f"did you mean '{near[0]}'?" if near else ""


def listed(words: Sequence[str], *, last: str = "and") -> str:
    """Return ``a, b and c``."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"
