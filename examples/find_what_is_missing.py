"""The effect that the model lacks on one record, and the extended model's prediction of a later one.

Run: python examples/find_what_is_missing.py merged.csv actuator.toml [later_temps.csv START_DEG]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from torsight.actuator import read_actuator, read_log
from torsight.core import DEG, read_merged
from torsight.discovery import DiscoveryReport, discover, predict_with_sigma


def told(step: str, done: float, total: float | None) -> None:
    """Print the progress: any function with these arguments can be given as ``progress``."""
    if total:
        print(f"\r{step}: {100 * done / total:3.0f} %   ", end="", file=sys.stderr)


def find(merged: Path, actuator: Path) -> DiscoveryReport:
    """Return the report on what the model lacks on a record."""
    return discover(read_merged(merged), read_actuator(actuator), progress=told)


def main(merged: Path, actuator: Path, later: Path | None = None, start_deg: float = 0.0) -> DiscoveryReport:
    """Print the verdict, the error before and after, and the prediction for a later temperature log."""
    report = find(merged, actuator)
    print(f"\n{report.verdict}: {', '.join(effect.id for effect in report.effects) or 'nothing'}")
    before, after = report.before.rmse_held_out_deg, report.after.rmse_held_out_deg
    print(f"error on held-out half-cycles {before:.2f}° before, {after:.2f}° after")
    if later is not None:
        found = predict_with_sigma(report.model, read_log(later), start_angle_rad=start_deg * DEG)
        low_deg, high_deg = np.nanmin(found.angle_rad) / DEG, np.nanmax(found.angle_rad) / DEG
        print(f"later: from {low_deg:.1f}° to {high_deg:.1f}°, ±{np.nanmedian(found.sigma_rad) / DEG:.2f}°")
    return report


if __name__ == "__main__":
    paths = [Path(word) for word in sys.argv[1:4]]
    main(*paths, start_deg=float(sys.argv[4]) if len(sys.argv) > 4 else 0.0)
