"""A proposed experiment as a scene of the synthetic rig: for the test of proposals, and for their benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def half_cycles(segments: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the half-cycles of a scene file that do what a proposed programme's segments say."""
    out: list[dict[str, Any]] = []
    for segment in segments:
        if segment["action"] == "cool":
            out[-1]["cool_s"] = segment["duration_s"]
            continue
        if not out or "cool_s" in out[-1]:
            out.append({"spring": segment["spring"], "points": [], "heat_s": 0.0})
        last, end_s = out[-1], out[-1]["heat_s"] + segment["duration_s"]
        last["points"].append([end_s - segment["hold_s"], segment["to_c"]])
        if segment["hold_s"] > 0.0:
            last["points"].append([end_s, segment["to_c"]])
        last["heat_s"] = end_s
    return out
