"""Summary of a finished run from its files: lines for the terminal, and a row for a campaign's table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from torsight.actuator.quantities import effect_values
from torsight.core.files.storage import read_json
from torsight.core.files.tables import read_angles
from torsight.core.units import DEG
from torsight.core.words.wording import (
    doubt_of,
    effect_name,
    error_words,
    estimate,
    held_out_errors,
    named,
    predicts_worse,
)


def discovery_lines(discovery: Mapping[str, Any]) -> list[str]:
    """Return the lines of a ``discovery.json``: friction, what is missing, laws, error before and after, next step."""
    effects = [
        # Values meant for people, where the effect has any.
        f"  {effect_name(str(effect['id']))}: {effect_values(effect)}"
        for effect in discovery.get("effects") or []
    ]
    floor = discovery.get("noise_floor_deg")
    noise = "" if floor is None else f" (noise floor {error_words(floor)})"
    proposed = (discovery.get("next_experiment") or {}).get("text")
    return [
        f"Friction torque   {estimate(discovery['parameters']['tau_c_mnm'])}",
        f"Missing           {named(discovery)}",
        *effects,
        *(f"Law               {law['sentence']}" for law in discovery.get("laws") or [] if law.get("sentence")),
        f"Error             {_errors(discovery)}{noise}",
        *(f"  {record['file']}: {_unseen(record)}" for record in discovery.get("records") or []),
        *([f"Next experiment   {proposed}"] if proposed else []),
    ]


def _errors(discovery: Mapping[str, Any]) -> str:
    before, after = held_out_errors(discovery)
    on = "held-out half-cycles"
    if before is None or after is None:
        before, after = (discovery[name]["rmse_train_deg"] for name in ("before", "after"))
        on = "the record that was fitted itself: with one half-cycle, none can be held out"
    return f"{error_words(before)} rms before, {error_words(after)} after, on {on}"


def _unseen(record: Mapping[str, Any]) -> str:
    """Return the error on a record that was predicted from the others."""
    before, after = (float(record[name]["rmse_other_records_deg"]) for name in ("before", "after"))
    return f"{error_words(before)} rms before, {error_words(after)} after, with the rig's values from the other records"


def attention(discovery: Mapping[str, Any]) -> list[str]:
    """Return a warning line each where an answer is in doubt, and where its model predicts worse than the plain one."""
    return [f"Attention         {doubt}" for doubt in (doubt_of(discovery), predicts_worse(discovery)) if doubt]


def summary(folder: Path) -> list[str]:
    """Return the lines that end ``torsight run``: motion, friction, what was missing, error before and after."""
    angles = read_angles(folder / "angle.csv")
    known = angles.angle_rad[angles.valid] / DEG
    discovery = read_json(folder / "discovery.json")
    return [
        *attention(discovery),
        (
            f"Range of motion   {np.ptp(known):.1f}° (from {known.min():.1f}° to {known.max():.1f}°), "
            f"{100.0 * angles.valid.mean():.1f} % of {len(angles)} frames measured"
        ),
        *discovery_lines(discovery),
        f"Report            {folder / 'report.html'}",
        f"Recording         {folder / 'recording.rrd'}",
    ]


def result_row(folder: Path) -> dict[str, Any]:
    """Return one row of the table of results from the files of a finished run."""
    angles = read_angles(folder / "angle.csv")
    discovery, clock = read_json(folder / "discovery.json"), read_json(folder / "sync.json")
    known_deg = angles.angle_rad[angles.valid] / DEG
    friction = discovery["parameters"]["tau_c_mnm"]
    return {
        "frames": len(angles),
        "valid_share": float(angles.valid.mean()),
        "angle_min_deg": float(known_deg.min()),
        "angle_max_deg": float(known_deg.max()),
        "angle_sigma_deg": float(np.median(angles.sigma_rad[angles.valid]) / DEG),
        "offset_s": clock["offset_s"]["value"],
        "tau_c_mnm": friction["value"],
        "tau_c_lo_mnm": friction["ci95"][0],
        "tau_c_hi_mnm": friction["ci95"][1],
        "verdict": discovery["verdict"],
        "effects": " ".join(effect["id"] for effect in discovery["effects"]),
        "rmse_before_deg": discovery["before"]["rmse_held_out_deg"],
        "rmse_after_deg": discovery["after"]["rmse_held_out_deg"],
        "noise_floor_deg": discovery["noise_floor_deg"],
        "folder": str(folder),
    }
