"""A run's folder in the contract's form, made without any of the stages: for the tests of what people see.

The angle follows a smooth stroke between two temperatures; the measured one follows a temperature that comes late by
a few seconds, the plain curve does not, the extended one almost does.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from torsight.discovery.measured_law import MeasuredLaw

HEATING_S, COOLING_S = 60.0, 40.0
LAG_S = 4.0
SIZE_PX = (320, 240)
CENTRE_PX = np.array([160.0, 120.0])
RADII_PX = (35.0, 90.0)
BASE_RAD = np.deg2rad(200.0)
LOST_S = (30.0, 33.0)


def stroke_deg(temp_c: np.ndarray, *, low: float, high: float, start: float, end: float) -> np.ndarray:
    share = np.clip((temp_c - low) / (high - low), 0.0, 1.0)
    return start + (end - start) * (1.0 - np.cos(np.pi * share)) / 2.0


def half_cycle(time_s: np.ndarray, *, late_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Temperature and unsigned stroke (177 to −233 to −177 deg) of one heating and cooling."""

    def temp(t: np.ndarray) -> np.ndarray:
        heated = 25.0 + 50.0 * np.clip(t, 0.0, HEATING_S) / HEATING_S
        return np.where(t > HEATING_S, 25.0 + 50.0 * np.exp(-(t - HEATING_S) / 12.0), heated)

    seen = temp(time_s - late_s)
    down = stroke_deg(seen, low=47.0, high=70.0, start=177.0, end=-233.0)
    back = stroke_deg(-seen, low=-51.0, high=-47.0, start=-233.0, end=-177.0)
    return temp(time_s), np.where(time_s <= HEATING_S + late_s, down, back)


def curves(*, half_cycles: int = 4, rate_hz: float = 10.0, seed: int = 3) -> pd.DataFrame:
    length_s = HEATING_S + COOLING_S
    time_s = np.arange(0.0, half_cycles * length_s, 1.0 / rate_hz)
    number = (time_s // length_s).astype(int)
    local_s = time_s - number * length_s
    sign = np.where(number % 2 == 0, 1.0, -1.0)
    temp_c, plain = half_cycle(local_s, late_s=0.0)
    _, true = half_cycle(local_s, late_s=LAG_S)
    _, almost = half_cycle(local_s, late_s=LAG_S - 0.05)
    rest_c = 25.0 + 4.0 * np.exp(-(((local_s - 60.0) / 30.0) ** 2))
    noise = np.random.default_rng(seed).normal(0.0, 0.06, len(time_s))
    angle = sign * true + noise
    angle[(time_s >= LOST_S[0]) & (time_s < LOST_S[1])] = np.nan
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "angle_deg": angle,
            "angle_sigma_deg": np.where(np.isfinite(angle), 0.06, np.nan),
            "plain_deg": sign * plain,
            "extended_deg": sign * almost,
            "temp_a_c": np.where(sign > 0, temp_c, rest_c),
            "temp_b_c": np.where(sign > 0, rest_c, temp_c),
            "half_cycle": number,
            "active": np.where(sign > 0, "a", "b"),
            "direction": np.where(local_s <= HEATING_S, "heating", "cooling"),
            "held_out": (number == half_cycles - 1).astype(int),
            "xi_a": np.where(sign > 0, 0.5, 1.0),
            "xi_b": np.where(sign > 0, 1.0, 0.5),
        }
    )
    table["residual_before_deg"] = table["angle_deg"] - table["plain_deg"]
    table["residual_after_deg"] = table["angle_deg"] - table["extended_deg"]
    return table


def marker_table(table: pd.DataFrame) -> pd.DataFrame:
    """Four markers on two sticks that turn about one point; y points down, so the picture's angle is mirrored."""
    true_rad = np.deg2rad(table["angle_deg"].interpolate().to_numpy())
    columns: dict[str, np.ndarray] = {"frame": np.arange(len(table)), "time_s": table["time_s"].to_numpy()}
    valid = table["angle_deg"].notna().to_numpy()
    for stick, turn_rad in (("base", np.zeros(len(table))), ("moving", true_rad)):
        for place, radius in zip(("inner", "outer"), RADII_PX, strict=True):
            name = f"{stick}_{place}"
            good = valid if name == "moving_outer" else np.ones(len(table), bool)
            columns[f"{name}_x_px"] = np.where(good, CENTRE_PX[0] + radius * np.cos(BASE_RAD + turn_rad), np.nan)
            columns[f"{name}_y_px"] = np.where(good, CENTRE_PX[1] - radius * np.sin(BASE_RAD + turn_rad), np.nan)
            columns[f"{name}_sigma_px"] = np.where(good, 0.03, np.nan)
            columns[f"{name}_valid"] = good.astype(int)
    return pd.DataFrame(columns)


def parameter(value: float, sigma: float, unit: str, **more: object) -> dict[str, object]:
    return {
        "value": value,
        "sigma": sigma,
        "ci95": [value - 1.96 * sigma, value + 1.96 * sigma],
        "unit": unit,
        "fixed": False,
        **more,
    }


def discovery() -> dict[str, object]:
    return {
        "schema": 1,
        "verdict": "identified",
        "effects": [
            {
                "id": "sensor_lag",
                "family": "temperature",
                "parameters": {"lag_s": parameter(4.02, 0.05, "s")},
                "probability": 0.996,
            }
        ],
        "alternatives": [],
        "drivers": [
            {"variable": "temp_rate_c_s", "share": 0.74},
            {"variable": "direction", "share": 0.18},
            {"variable": "temp_active_c", "share": 0.08},
        ],
        "before": {"rmse_train_deg": 31.2, "rmse_held_out_deg": 33.4, "r2_held_out": 0.953},
        "after": {"rmse_train_deg": 0.41, "rmse_held_out_deg": 0.44, "r2_held_out": 0.99999},
        "held_out": [3],
        "noise_floor_deg": 0.06,
        "parameters": {
            "tau_c_mnm": parameter(0.793, 0.011, "mN·m"),
            "A_s_c": parameter(36.2, 0.2, "°C"),
            "A_f_c": parameter(54.1, 0.2, "°C"),
            "E_A_gpa": parameter(60.4, 1.1, "GPa"),
            "C_A_mpa_per_k": {"value": 32.0, "sigma": None, "ci95": [None, None], "unit": "MPa/K", "fixed": True},
        },
        "next_experiment": None,
    }


def write_made_up_run(folder: Path, *, half_cycles: int = 4, rate_hz: float = 10.0) -> pd.DataFrame:
    """Fill ``folder`` with every file that a finished run leaves, and return the curves."""
    folder.mkdir(parents=True, exist_ok=True)
    table = curves(half_cycles=half_cycles, rate_hz=rate_hz)
    table.to_csv(folder / "curves.csv", index=False)
    merged = ["time_s", "angle_deg", "angle_sigma_deg", "temp_a_c", "temp_b_c"]
    table[merged].to_csv(folder / "merged.csv", index=False)
    angle = table[["time_s", "angle_deg", "angle_sigma_deg"]].copy()
    angle.insert(0, "frame", np.arange(len(table)))
    angle["valid"] = table["angle_deg"].notna().astype(int)
    angle.to_csv(folder / "angle.csv", index=False)
    marker_table(table).to_csv(folder / "markers.csv", index=False)
    for name, content in documents().items():
        (folder / f"{name}.json").write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")
    return table


def rewrite(folder: Path, name: str, **changes: object) -> None:
    """Write one of the run's JSON files with other values of some of its keys."""
    content = documents()[name] | changes
    (folder / f"{name}.json").write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")


def documents() -> dict[str, dict[str, object]]:
    return {
        "track": {
            "schema": 1,
            "frames": 4000,
            "events": [
                {"time_s": LOST_S[0], "frame": 300, "kind": "occlusion", "text": "moving_outer is covered"},
                {"time_s": LOST_S[1], "frame": 330, "kind": "found", "text": "moving_outer is found again"},
            ],
            "advice": ["The film is compressed hard (H.264 CRF 28): a lower CRF would halve the noise of the angle."],
        },
        "sync": {
            "schema": 1,
            "offset_s": {"value": 12.31, "ci95": [12.1, 12.52]},
            "drift_ppm": {"value": 18.0, "ci95": [-22.0, 58.0]},
            "method": "turning points of the angle against turning points of the temperatures",
        },
        "fit": {
            "schema": 1,
            "parameters": {
                "tau_c_mnm": parameter(1.05, 0.02, "mN·m"),
                "A_s_c": parameter(38.9, 0.1, "°C"),
                "A_f_c": parameter(56.8, 0.1, "°C"),
                "E_A_gpa": parameter(57.1, 1.0, "GPa"),
                "C_A_mpa_per_k": {"value": 32.0, "sigma": None, "ci95": [None, None], "unit": "MPa/K", "fixed": True},
            },
            "rmse_deg": 31.2,
            "r2": 0.95,
            "case": "a",
            "theta_1_deg": 717.6,
            "theta_2_deg": 307.1,
            "theta_3_deg": 362.4,
            "beta_cr_deg": 468.0,
            "converged": True,
        },
        "discovery": discovery(),
        "provenance": {
            "schema": 1,
            "command": "torsight run",
            "versions": {"python": "3.11.9", "torsight": "0.1.0", "numpy": "2.4.0"},
            "inputs": {"film.mp4": "9f" * 32, "temps.csv": "3c" * 32},
            "configuration": {"video": {"path": "film.mp4"}, "actuator": {"file": "actuator.toml"}},
            "seed": 0,
        },
    }


def made_up_law() -> MeasuredLaw:
    """Return a friction that changes once per turn, as it might be measured: not near 0°, where nothing rested."""
    angle_deg = np.arange(-240.0, 241.0, 20.0)
    covered = (np.abs(angle_deg) <= 200.0) & (np.abs(angle_deg) > 10.0)
    return MeasuredLaw(
        effect=None,
        port="friction",
        driver="angle_deg",
        spring="both",
        unit="mN·m",
        share=0.8,
        driver_values=angle_deg,
        value=0.5 * np.sin(np.deg2rad(angle_deg)),
        sigma=np.where(covered, 0.02, 0.2),
        covered=covered,
        sentence="Friction rises by half a mN·m towards 90°.",
    )
