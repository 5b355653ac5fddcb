"""Estimation of a spring's values, with intervals, from four tests; the paper's section 4.1.

1. Free recovery (torque-free): θ = θ_d ξ(T), A_s and A_f of both phase laws.
2. Force against angle at room temperature: slopes E_M and E_S; their lines meet in the critical angle.
3. Block test, heating: F = C1 θ_0 E(ξ) (1 − ξ) / (C2 L_l), ξ by (13) at the stress that F itself causes: E_A and C_A.
   The parameter of the fit is 1/C, in kelvin per megapascal.
4. Block test, cooling: the same with (14): M_s, M_f and C_M.

Each step uses the values of the steps before it as priors, with their uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from torsight.actuator.characterising.characterised import Characterisation, Step
from torsight.actuator.characterising.curve_fit import CurveFit, fit_curve
from torsight.actuator.characterising.spring_tests import SpringTests
from torsight.actuator.record.conditioning import condition
from torsight.actuator.spec import KEYS, ActuatorSpec, keys_of
from torsight.actuator.stepping.phase import SHARE_DONE
from torsight.core.errors import InputError
from torsight.core.parallel.threads import one_thread
from torsight.core.parameter import Estimate, Parameter
from torsight.core.progress import Progress, silent
from torsight.core.series import share_explained
from torsight.core.units import MPA, Floats
from torsight.core.words.plausible import HEATED_C

_STEP: Final = "spring tests"
_K_RANGE: Final = (1.0 / KEYS["C_A_mpa_per_k"].upper, 1.0 / KEYS["C_A_mpa_per_k"].lower)


@one_thread()
def characterise(
    tests: SpringTests, *, source: str = "characterisation", progress: Progress = silent
) -> Characterisation:
    """Fit all four steps.

    Raises
    ------
    InputError
        When a test lacks the data that its step needs.
    """
    recovery = {}
    for number, law in enumerate(SHARE_DONE):
        progress(_STEP, number, 4)
        recovery[law] = free_recovery(tests, law=law)
    better = min(SHARE_DONE, key=lambda law: recovery[law].rmse)
    lines = force_angle(tests)
    _require_plausible(lines.estimates, where=source)
    known = {**recovery["liang_rogers"].estimates, **lines.estimates}
    progress(_STEP, 2, 4)
    heating = block_heating(tests, known)
    known |= heating.estimates
    progress(_STEP, 3, 4)
    cooling = block_cooling(tests, known)
    progress(_STEP, 4, 4)
    known |= cooling.estimates
    estimates = {name: known[name] for name in keys_of("material")}
    _require_plausible(estimates, where=source)
    values = {
        **tests.geometry,
        **{name: item.value for name, item in estimates.items()},
        **tests.assembly,
        **tests.friction,
    }
    spec = ActuatorSpec(values, {name: item.sigma for name, item in estimates.items()}, source=source)
    steps = {
        "free_recovery": recovery["liang_rogers"], "free_recovery_tanaka": recovery["tanaka"], "force_angle": lines,
        "block_heating": heating, "block_cooling": cooling,
    }  # fmt: skip
    return Characterisation(steps, better, estimates, spec)


def _require_plausible(estimates: Mapping[str, Estimate], *, where: str) -> None:
    """Refuse values that no spring has, which indicate a log in another unit than its column name states."""
    for name, item in estimates.items():
        key = KEYS[name]
        if not key.lower <= item.value <= key.upper:
            raise InputError(
                f"the tests give a '{name}' that no spring has",
                where=where,
                value=f"{item.value:.4g} {key.unit}",
                limit=f"{key.lower:g} to {key.upper:g}",
                do="check the units of the logs (°C, degrees, newtons), lever_mm and pre_deformation_deg",
            )


def free_recovery(tests: SpringTests, *, law: str) -> Step:
    """Return step 1 for one phase law: A_s, A_f from all free recoveries together."""
    temps = [_smooth(item.temp_c) for item in tests.recoveries]
    parts = _parts(item.angle_deg for item in tests.recoveries)
    measured = np.concatenate([item.angle_deg for item in tests.recoveries])
    for item in tests.recoveries:
        if np.ptp(item.temp_c) < HEATED_C:
            raise InputError(
                "is not heated",
                where=item.source,
                value=f"{np.ptp(item.temp_c):.1f} °C",
                limit=f"{HEATED_C:g} °C or more",
                do="heat it through its transformation",
            )
        if np.ptp(item.angle_deg) < 0.3 * item.pre_deformation_deg:
            raise InputError(
                "does not recover",
                where=item.source,
                value=f"{np.ptp(item.angle_deg):.1f}°",
                limit=f"30 % of {item.pre_deformation_deg:g}° or more",
                do="heat it through its transformation",
            )

    def model(values: Mapping[str, float]) -> Floats:
        return np.concatenate([
            item.pre_deformation_deg * (1.0 - SHARE_DONE[law]((temp - values["A_s_c"]) / values["width_c"]))
            for item, temp in zip(tests.recoveries, temps, strict=True)
        ])  # fmt: skip

    start, finish = _crossing(tests, temps)
    guess = (
        Parameter("A_s_c", start, "°C", lower=-150.0, upper=200.0),
        Parameter("width_c", max(finish - start, 2.0), "°C", lower=0.5, upper=150.0),
    )
    found = fit_curve(model, guess, measured, parts=parts, what=f"free recovery, {law}")
    return Step(
        estimates=_window(found, "A_s_c", "A_f_c"),
        rmse=found.rmse,
        r2={
            _label(item.pre_deformation_deg): share_explained(measured[part], found.fitted[part])
            for item, part in zip(tests.recoveries, parts, strict=True)
        },
        curves={
            _label(item.pre_deformation_deg): (temp, measured[part], found.fitted[part])
            for item, temp, part in zip(tests.recoveries, temps, parts, strict=True)
        },
    )


def _crossing(tests: SpringTests, temps: list[Floats]) -> tuple[float, float]:
    """Return the temperatures at which 90 % and 10 % of the first recovery remain: start values of the fit."""
    item, temp = tests.recoveries[0], temps[0]
    width = max(3, len(temp) // 40)
    angle = np.convolve(np.pad(item.angle_deg, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), "valid")
    return _falls(angle / item.pre_deformation_deg, temp)


def _falls(share: Floats, temp: Floats) -> tuple[float, float]:
    """Return the temperatures at which a share falls below 90 % and 10 %; if never, the median and the last one."""
    start, finish = (
        temp[int(np.argmax(share < level))] if (share < level).any() else otherwise
        for level, otherwise in ((0.9, np.median(temp)), (0.1, temp[-1]))
    )
    return float(start), float(finish)


def _parts(logs: Iterable[Floats]) -> list[slice]:
    """Return the slice of each log in the concatenation of all logs."""
    ends = np.cumsum([0, *(len(log) for log in logs)])
    return [slice(a, b) for a, b in pairwise(ends.tolist())]


def _window(found: CurveFit, start: str, finish: str) -> dict[str, Estimate]:
    """Return both ends of a window that was fitted as its start and width."""
    first = found.estimates[start]
    a, b = found.names.index(start), found.names.index("width_c")
    c = found.covariance
    sigma = float(np.sqrt(max(0.0, c[a, a] + c[b, b] + 2.0 * c[a, b])))
    value = found.values[start] + found.values["width_c"]
    return {start: first, finish: Estimate.normal(value, sigma, "°C")}


def force_angle(tests: SpringTests) -> Step:
    """Return step 2: both slopes, and the angle at which their lines meet.

    One broken line through both ranges: F = F_0 + c E_M θ up to the critical angle, and c E_S beyond it.
    """
    scale = tests.force_per_deg_gpa
    picked = [(item.angle_deg[item.inside], item.force_n[item.inside], item) for item in tests.forces]
    angle, force = (np.concatenate([entry[i] for entry in picked]) for i in (0, 1))
    large = np.concatenate([np.full(len(entry[0]), entry[2].large) for entry in picked])
    parts = _parts(entry[0] for entry in picked)

    def model(values: Mapping[str, float]) -> Floats:
        e_m, e_s, critical = values["E_M_gpa"], values["E_S_gpa"], values["theta_cr_deg"]
        return values["force_0_n"] + scale * np.where(large, e_m * critical + e_s * (angle - critical), e_m * angle)

    first, second = (np.polyfit(angle[large == flag], force[large == flag], 1) for flag in (False, True))
    if not 0.0 < second[0] < first[0]:
        raise InputError(
            "the slopes of force against angle are out of order", where="step 2",
            value=f"{first[0]:.3g} N/° (small range), {second[0]:.3g} N/° (large)", limit="0 < large < small",
            do="check 'range', 'from_deg' and 'to_deg' of [[force_angle]]",
        )  # fmt: skip
    meet = float((first[1] - second[1]) / (second[0] - first[0]))
    guess = (
        Parameter("E_M_gpa", float(first[0]) / scale, "GPa", lower=1e-3),
        Parameter("E_S_gpa", float(second[0]) / scale, "GPa", lower=1e-3),
        Parameter("theta_cr_deg", meet, "°", lower=0.0),
        Parameter("force_0_n", float(first[1]), "N"),
    )
    found = fit_curve(model, guess, force, parts=parts, what="force against angle")
    names = _experiments(tests)
    return Step(
        estimates={name: found.estimates[name] for name in ("E_M_gpa", "E_S_gpa", "theta_cr_deg")},
        rmse=found.rmse,
        r2={name: share_explained(force[part], found.fitted[part]) for name, part in zip(names, parts, strict=True)},
        curves={name: (angle[part], force[part], found.fitted[part]) for name, part in zip(names, parts, strict=True)},
        beyond={
            name: (item.angle_deg[~item.inside], item.force_n[~item.inside])
            for name, item in zip(names, tests.forces, strict=True)
        },
    )


def _experiments(tests: SpringTests) -> list[str]:
    """Return a name for every log of force against angle: its range, and its number among the logs of this range."""
    names: list[str] = []
    for item in tests.forces:
        kind = "large" if item.large else "small"
        names.append(f"{kind}, experiment {1 + sum(name.startswith(kind) for name in names)}")
    return names


def block_heating(tests: SpringTests, known: Mapping[str, Estimate]) -> Step:
    """Return step 3: E_A and C_A from the heating of the block test."""
    temp, force = _block_half(tests, cooling=False)
    top = float(np.quantile(force, 0.98))
    stiffness = tests.force_per_deg_gpa * tests.block.pre_deformation_deg
    key = KEYS["E_A_gpa"]
    if not key.lower <= top / stiffness <= key.upper:
        raise InputError(
            "the blocked spring's force is that of no spring",
            where=tests.block.source,
            value=f"{top:.4g} N, so E_A = {top / stiffness:.4g} GPa",
            limit=f"{key.lower:g} to {key.upper:g} GPa",
            do="give forces in newtons, and check lever_mm and pre_deformation_deg",
        )
    guess = (
        Parameter("E_A_gpa", top / stiffness, "GPa", lower=0.5, upper=1000.0),
        Parameter("k_per_mpa", 0.05, "K/MPa", lower=_K_RANGE[0], upper=_K_RANGE[1]),
        _carried(known, "A_s_c"), _carried(known, "A_f_c"), _carried(known, "E_M_gpa"),
    )  # fmt: skip

    def model(values: Mapping[str, float]) -> Floats:
        return stiffness * blocked_force(tests, values, temp, cooling=False)

    found = fit_curve(model, guess, force, what="block test, heating")
    estimates = {name: found.estimates[name] for name in ("E_A_gpa", "A_s_c", "A_f_c", "E_M_gpa")}
    estimates["C_A_mpa_per_k"] = _influence(found.estimates["k_per_mpa"])
    return Step(estimates, found.rmse, {"heating": found.r2}, {"heating": (temp, force, found.fitted)})


def block_cooling(tests: SpringTests, known: Mapping[str, Estimate]) -> Step:
    """Return step 4: M_s, M_f and C_M from the cooling of the block test."""
    temp, force = _block_half(tests, cooling=True)
    stiffness = tests.force_per_deg_gpa * tests.block.pre_deformation_deg
    influence = known["C_A_mpa_per_k"].value
    top = float(np.quantile(force, 0.98))
    start, finish = _falls(force / max(top, 1e-9), temp)
    start -= top * tests.stress_per_force / (influence * MPA)
    width = Parameter("width_c", max(start - finish, 3.0), "°C", lower=0.5, upper=150.0)
    others = (
        # One block test determines C_M poorly; in NiTi C_A and C_M are similar: a prior at C_A, as wide as its value.
        Parameter("k_per_mpa", 1.0 / influence, "K/MPa", lower=_K_RANGE[0], upper=_K_RANGE[1], sigma=1.0 / influence),
        _carried(known, "E_A_gpa"),
        _carried(known, "E_M_gpa"),
    )

    def model(values: Mapping[str, float]) -> Floats:
        low = values["M_f_c"] if "M_f_c" in values else values["M_s_c"] - values["width_c"]
        window = {**values, "M_f_c": low, "M_s_c": low + values["width_c"]}
        return stiffness * blocked_force(tests, window, temp, cooling=True)

    # In one block test M_s, M_f and C_M are strongly and nonlinearly correlated. So each end of the window is fitted in
    # turn as a parameter, with the other given by the width, and the intervals come from profile likelihoods.
    def fitted(name: str, value: float, profiled: tuple[str, ...]) -> CurveFit:
        end = Parameter(name, value, "°C", lower=-150.0, upper=200.0)
        return fit_curve(model, (end, width, *others), force, profiled=profiled, what="block test, cooling")

    found = fitted("M_f_c", finish, ("M_f_c", "k_per_mpa"))
    upper = fitted("M_s_c", found.values["M_f_c"] + found.values["width_c"], ("M_s_c",))
    estimates = {"M_s_c": upper.estimates["M_s_c"], "M_f_c": found.estimates["M_f_c"]}
    estimates["C_M_mpa_per_k"] = _influence(found.estimates["k_per_mpa"])
    return Step(estimates, found.rmse, {"cooling": found.r2}, {"cooling": (temp, force, found.fitted)})


def blocked_force(tests: SpringTests, values: Mapping[str, float], temp_c: Floats, *, cooling: bool) -> Floats:
    """Return E(ξ) (1 − ξ) in GPa of the blocked spring, ξ by (13) or (14) at the stress that this force causes.

    From full martensite (13) and from full austenite (14) are the same cosine over their windows, so the temperature at
    a place in the window, shifted by the stress there, is explicit. It is inverted: from a table, then by Newton's
    steps. More martensite means less force and less stress, so the temperature grows with the place.
    """
    low, high = ("M_f_c", "M_s_c") if cooling else ("A_s_c", "A_f_c")
    stress_per_gpa = tests.force_per_deg_gpa * tests.block.pre_deformation_deg * tests.stress_per_force
    width_c = max(values[high] - values[low], 1e-3)
    shift = stress_per_gpa / MPA * max(values["k_per_mpa"], 1e-6)
    austenite, rise = values["E_A_gpa"], values["E_M_gpa"] - values["E_A_gpa"]

    def at(place: Floats) -> tuple[Floats, Floats, Floats]:
        xi = 0.5 + 0.5 * np.cos(np.pi * place)
        modulus = (austenite + xi * rise) * (1.0 - xi)
        slope = (austenite + (2.0 * xi - 1.0) * rise) * 0.5 * np.pi * np.sin(np.pi * place)
        return modulus, values[low] + width_c * place + shift * modulus, width_c + shift * slope

    table = np.linspace(0.0, 1.0, 257)
    place = np.interp(temp_c, at(table)[1], table)
    for _ in range(3):
        _, reached_c, slope = at(place)
        place = np.clip(place - (reached_c - temp_c) / slope, 0.0, 1.0)
    return at(place)[0]


def _block_half(tests: SpringTests, *, cooling: bool) -> tuple[Floats, Floats]:
    temp = _smooth(tests.block.temp_c)
    top = int(np.argmax(temp))
    half = slice(top, None) if cooling else slice(None, top + 1)
    name = "cooling" if cooling else "heating"
    if len(temp[half]) < 20 or np.ptp(temp[half]) < HEATED_C:
        raise InputError(
            f"has no {name}",
            where=tests.block.source,
            value=f"{np.ptp(temp[half]):.1f} °C of {name}",
            limit=f"{HEATED_C:g} °C or more, 20 rows or more",
            do="log the block test until it is cold again",
        )
    return temp[half], tests.block.force_n[half]


def _influence(kelvin: Estimate) -> Estimate:
    """Return C from 1/C, in which the curve is nearly linear: the interval's ends are the inverses of those of 1/C.

    The standard deviation is limited to the value: a larger one carries no further information.
    """
    least, most = _K_RANGE
    inverse = min(max(kelvin.value, least), most)
    low, high = (1.0 / min(max(end, least), most) for end in reversed(kelvin.ci95))
    sigma = min(kelvin.sigma / inverse**2, 1.0 / inverse)
    return Estimate(1.0 / inverse, sigma, (low, high), "MPa/K")


def _carried(known: Mapping[str, Estimate], name: str) -> Parameter:
    """Return a parameter whose prior is the estimate of an earlier step."""
    item = known[name]
    return Parameter(name, item.value, item.unit, sigma=max(item.sigma, 1e-9))


def _smooth(temp_c: Floats) -> Floats:
    return condition(np.arange(len(temp_c), dtype=np.float64), temp_c).temp_c


def _label(angle_deg: float) -> str:
    return f"{angle_deg:g}°"
