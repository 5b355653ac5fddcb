"""Test whether the proposed experiment distinguishes rivals, on a rig with another integrator and either as the truth.

For each pair a first record is made in which the two can hardly be distinguished, ``discover`` runs on it, and the
programme that it proposes (or, after another verdict, would propose for the pair) is run on the rig twice: with the
true effect, and with the other one at the size that was fitted to it. ``discover`` then runs on either new record
alone. One line of JSON per pair, and a picture of each programme with both records.

Examples
--------
    python benchmarks/discovery/next_experiment.py --out next.jsonl --figures figures
    python benchmarks/discovery/next_experiment.py --only lag-clock
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests import proposed
from torsight.actuator.model import ActuatorModel
from torsight.actuator.spec import ActuatorSpec, actuator_from
from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.design.next_experiment import NextExperiment, next_experiment
from torsight.discovery.discover import discover
from torsight.discovery.inference.engine import Findings
from torsight.discovery.own.find import find_missing
from torsight.discovery.settings import Settings
from torsight.report.plots.panels import Axis, Panel
from torsight.report.plots.still import still
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from

ROOM_C = 23.4


@dataclass(frozen=True)
class Pair:
    """A first record: true effect, the one it is confused with, heating rates of its cycles, noise, seed of the rig."""

    name: str
    true: str
    rival: str
    effect: Mapping[str, float]
    rates_c_per_s: tuple[float, ...]
    sigma_deg: float
    seed: int


_COIL = {"rise_mnm": 0.2, "onset_deg": 680.0}
_STIFF = {"rise_mnm": 0.12, "onset_deg": 690.0}
_COOL_ENDS = {"cooler_c": 5.0, "share": 0.03}
PAIRS = (
    Pair("lag-clock", "sensor_lag", "clock_offset", {"lag_s": 4.0}, (0.1, 0.2), 0.6, 1),
    Pair("clock-lag", "clock_offset", "sensor_lag", {"offset_s": 4.0}, (0.1, 0.2), 0.6, 2),
    Pair("coil-stiffening", "coil_friction", "stiffening", _COIL, (0.15,), 3.0, 1),
    Pair("stiffening-coil", "stiffening", "coil_friction", _STIFF, (0.15, 0.12), 0.6, 2),
    Pair("cool-stiffening", "nonuniform_temperature", "stiffening", _COOL_ENDS, (0.15,), 0.6, 1),
)
"""The films are poor ones, or the first records would not be ambiguous."""


def cycles(rates_c_per_s: Sequence[float]) -> list[dict[str, Any]]:
    """Return one full heating of A and of B per rate."""
    top_c, found = 74.0, []
    for rate in rates_c_per_s:
        ramp_s = (top_c - ROOM_C) / rate
        found += [
            {"spring": s, "peak_c": top_c, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": 280.0} for s in "ab"
        ]
    return found


def record(pair: Pair, effects: Mapping[str, Mapping[str, float]], half_cycles: list[dict[str, Any]]) -> SyncedTable:
    """Run the pair's rig: its own values, other noise for another programme."""
    scene = {
        "motion": {"kind": "rig"},
        "protocol": {"half_cycle": half_cycles},
        "effects": {name: dict(keys) for name, keys in effects.items()},
    }
    return make_record(scene, seed=pair.seed, sigma_deg=pair.sigma_deg).table


def as_hidden(effect: str, values: Mapping[str, float]) -> dict[str, float]:
    """Return the rig's own keys of an effect for fitted parameters of the effect file."""
    turn = 100.0 * DEG
    made = {
        "sensor_lag": lambda v: {"lag_s": v["lag_s"]},
        "clock_offset": lambda v: {"offset_s": v["clock_offset_s"]},
        "coil_friction": lambda v: {
            "rise_mnm": v["coil_friction_mnm_per_rad"] * turn ** v.get("coil_exponent", 1.0),
            "onset_deg": v["coil_onset_deg"],
        },
        "stiffening": lambda v: {
            "rise_mnm": v["stiffening_mnm_per_rad3"] * turn ** v.get("stiffening_exponent", 3.0),
            "onset_deg": v["stiffening_onset_deg"],
        },
        "nonuniform_temperature": lambda v: {"cooler_c": v["cool_drop_c"], "share": v["cool_share"]},
    }
    return made[effect](values)


def propose(findings: Findings, problem: ActuatorProblem, pair: Pair) -> NextExperiment:
    """Return the programme for the record's own rivals, or for the pair where it has none."""
    decision, needed = findings.decision, Settings().apart
    if decision.rivals:
        return next_experiment(problem, findings.field, (decision.chosen, *decision.rivals), needed_gain=needed)
    both = [findings.field.explanations[(name,)] for name in (pair.true, pair.rival)]
    return next_experiment(problem, findings.field, both, needed_gain=needed)


def run(pair: Pair, spec: ActuatorSpec, figures: Path | None) -> dict[str, Any]:
    """Run one pair."""
    first = record(pair, {pair.true: pair.effect}, cycles(pair.rates_c_per_s))
    problem = ActuatorProblem(ActuatorModel(spec).prepare(first), spec)
    findings = find_missing(problem).found
    decision, started = findings.decision, sum(os.times()[:4])
    found = propose(findings, problem, pair)
    seconds = sum(os.times()[:4]) - started
    truths = {
        pair.true: dict(pair.effect),
        pair.rival: as_hidden(pair.rival, findings.field.explanations[(pair.rival,)].fit.values),
    }
    base = findings.field.base.log_evidence
    gains = {name: findings.field.explanations[(name,)].log_evidence - base for name in truths}
    answers, tables = {}, {}
    for name, keys in truths.items():
        tables[name] = record(pair, {name: keys}, proposed.half_cycles(found.segments))
        report = discover(tables[name], spec)
        answers[name] = {
            "true": keys,
            "verdict": report.verdict,
            "effects": [effect.id for effect in report.effects],
            "before_deg": report.before.rmse_held_out_deg,
            "after_deg": report.after.rmse_held_out_deg,
            "right": report.verdict == "identified" and [effect.id for effect in report.effects] == [name],
        }
    if figures is not None:
        draw(figures / f"{pair.name}.svg", found, tables)
    return {
        "pair": pair.name,
        "first": {
            "verdict": findings.verdict,
            "effects": list(decision.chosen.effects),
            "rivals": [list(rival.effects) for rival in decision.rivals],
            "gains": gains,
        },
        "text": found.text,
        "duration_s": found.duration_s,
        "separation_sigmas": math.sqrt(found.gain),
        "repeat_sigmas": math.sqrt(found.repeat_gain),
        "search_cpu_s": seconds,
        "new": answers,
    }


def draw(path: Path, found: NextExperiment, tables: Mapping[str, SyncedTable]) -> None:
    """Draw the programme, and the angle that the rig shows under it with either effect."""
    time_s = np.asarray(found.columns["time_s"], np.float64)
    span = Axis.along("time (s)", time_s)
    temperatures = Axis.around("temperature (°C)", found.columns["temp_a_c"], found.columns["temp_b_c"])
    heat = Panel(span, temperatures, height=220)
    for spring in "ab":
        heat.line(time_s, found.columns[f"temp_{spring}_c"], f"spring-{spring}", label=f"spring {spring.upper()}")
    angles = {name: table.angle_rad / DEG for name, table in tables.items()}
    motion = Panel(span, Axis.around("angle (°)", *angles.values()), height=260)
    for place, (name, table) in enumerate(tables.items()):
        motion.line(table.time_s, angles[name], f"rival-{place}", label=f"the rig with {name}")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(still([heat, motion]) + "\n", encoding="utf-8")


def main() -> None:
    """Run the pairs that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", help="names of pairs")
    parser.add_argument("--out", type=Path, help="lines of JSON are added here")
    parser.add_argument("--figures", type=Path, help="folder for the pictures")
    asked = parser.parse_args()
    spec = actuator_from(declared_from({}, where="reference").to_toml(), where="reference")
    for pair in PAIRS:
        if asked.only and pair.name not in asked.only:
            continue
        line = json.dumps(run(pair, spec, asked.figures))
        print(line, flush=True)
        if asked.out is not None:
            with asked.out.open("a", encoding="utf-8") as file:
                file.write(line + "\n")


if __name__ == "__main__":
    main()
