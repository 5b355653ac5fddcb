"""The end of a run in plain words, read from the files that it left."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from torsight.core.storage import read_json
from torsight.core.tables import read_angles
from torsight.core.units import DEG


def summary(folder: Path) -> list[str]:
    """Return the lines that end ``torsight run``: motion, friction, what was missing, error before and after."""
    angles = read_angles(folder / "angle.csv")
    known = angles.angle_rad[angles.valid] / DEG
    discovery = read_json(folder / "discovery.json")
    lines = [
        (
            f"Range of motion   {np.ptp(known):.1f}° (from {known.min():.1f}° to {known.max():.1f}°), "
            f"{100.0 * angles.valid.mean():.1f} % of {len(angles)} frames measured"
        ),
        f"Friction torque   {_interval(discovery['parameters']['tau_c_mnm'])}",
        f"Missing effect    {verdict_words(discovery)}",
    ]
    before, after = discovery["before"]["rmse_held_out_deg"], discovery["after"]["rmse_held_out_deg"]
    if before is not None and after is not None:
        floor = discovery.get("noise_floor_deg")
        lines.append(
            f"Error             {before:.2f}° rms before, {after:.2f}° after, on half-cycles that the fit did not see"
            + (f" (noise floor {floor:.2f}°)" if floor is not None else "")
        )
    lines += [f"Report            {folder / 'report.html'}", f"Recording         {folder / 'recording.rrd'}"]
    return lines


def verdict_words(discovery: dict[str, Any]) -> str:
    """Return the verdict of ``discovery.json`` as a sentence."""
    names = [str(effect["id"]).replace("_", " ") for effect in discovery["effects"]]
    verdict = discovery["verdict"]
    if verdict == "none":
        return "none that this record can show"
    if verdict == "identified":
        return " and ".join(names)
    if verdict == "ambiguous":
        sets = [" + ".join(one) if isinstance(one, list) else str(one) for one in discovery.get("alternatives", [])]
        return "ambiguous, one of: " + ", ".join(dict.fromkeys([*names, *(name.replace("_", " ") for name in sets)]))
    drivers = [f"{item['variable']} ({100 * item['share']:.0f} %)" for item in discovery.get("drivers", [])[:3]]
    return "something that no known effect explains; it depends on " + (", ".join(drivers) or "nothing measured")


def _interval(parameter: dict[str, Any]) -> str:
    lo, hi = parameter["ci95"]
    return f"{parameter['value']:.3f} {parameter['unit']} (95 %: {lo:.3f} to {hi:.3f})"
