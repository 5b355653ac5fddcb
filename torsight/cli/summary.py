"""The end of a run in plain words, read from the files that it left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from torsight.actuator.quantities import effect_values
from torsight.core.files.storage import read_json
from torsight.core.files.tables import read_angles
from torsight.core.units import DEG
from torsight.core.words.wording import effect_name, estimate, held_out_errors, named, not_explained


def effect_lines(discovery: Mapping[str, Any]) -> list[str]:
    """Return a line for each effect that was named, with its values: those made for people where there are any."""
    effects = discovery.get("effects") or []
    return [f"  {effect_name(str(effect['id']))}: {effect_values(effect)}" for effect in effects]


def summary(folder: Path) -> list[str]:
    """Return the lines that end ``torsight run``: motion, friction, what was missing, error before and after."""
    angles = read_angles(folder / "angle.csv")
    known = angles.angle_rad[angles.valid] / DEG
    discovery = read_json(folder / "discovery.json")
    # What does not explain the record is said before anything that is read from it.
    doubt = not_explained(discovery)
    lines = [
        *([f"Attention         {doubt}"] if doubt else []),
        (
            f"Range of motion   {np.ptp(known):.1f}° (from {known.min():.1f}° to {known.max():.1f}°), "
            f"{100.0 * angles.valid.mean():.1f} % of {len(angles)} frames measured"
        ),
        f"Friction torque   {estimate(discovery['parameters']['tau_c_mnm'])}",
        f"Missing           {named(discovery)}",
        *effect_lines(discovery),
    ]
    lines += [f"Law               {law['sentence']}" for law in discovery.get("laws") or [] if law.get("sentence")]
    before, after = held_out_errors(discovery)
    if before is not None and after is not None:
        floor = discovery.get("noise_floor_deg")
        lines.append(
            f"Error             {before:.2f}° rms before, {after:.2f}° after, on half-cycles that the fit did not see"
            + (f" (noise floor {floor:.2f}°)" if floor is not None else "")
        )
    proposed = (discovery.get("next_experiment") or {}).get("text")
    if proposed:
        lines.append(f"Next experiment   {proposed}")
    lines += [f"Report            {folder / 'report.html'}", f"Recording         {folder / 'recording.rrd'}"]
    return lines
