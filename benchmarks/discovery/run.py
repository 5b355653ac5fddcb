"""Run the blind suite, one line of JSON per case; what a file already holds is not run again.

Examples
--------
    python benchmarks/discovery/run.py --part work --first 24 --out work.jsonl
    python benchmarks/discovery/run.py --part report --out report.jsonl && \
        python benchmarks/discovery/report.py report.jsonl
    python benchmarks/discovery/run.py --part usual --match double --out usual.jsonl
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from cases import OUTSIDE, Case, Record, make_record, suite
from shown import shown

from torsight.actuator.model import ActuatorModel
from torsight.core.units import DEG
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_with_sigma
from torsight.discovery.report import DiscoveryReport


def run_case(case: Case, record: Record) -> dict[str, Any]:
    """Discover on one case and compare with the truth."""
    started, cpu = time.perf_counter(), time.process_time()
    report = discover(record.table, record.spec, seed=0, where=case.name)
    seconds, cpu_seconds = time.perf_counter() - started, time.process_time() - cpu
    later = predict_with_sigma(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    error = (later.angle_rad - record.later_angle_rad) / DEG
    sigma = later.sigma_rad / DEG
    return {
        "name": case.name,
        "kind": case.kind,
        "model_error": case.model_error,
        "truth": list(case.effects),
        "size_deg": record.size_deg,
        "sizes_deg": dict(record.sizes_deg),
        "shown_deg": _shown_deg(case, record),
        "details": {name: dict(details) for name, details in record.details.items()},
        "verdict": report.verdict,
        "effects": [effect.id for effect in report.effects],
        "alternatives": [list(names) for names in report.alternatives],
        "drivers": [list(item) for item in report.drivers],
        "expected_drivers": list(OUTSIDE[case.effects[0]][1]) if case.kind == "outside" else [],
        "before_deg": report.before.rmse_held_out_deg,
        "after_deg": report.after.rmse_held_out_deg,
        "floor_deg": report.noise_floor_deg,
        "later_deg": float(np.sqrt(np.nanmean(error**2))),
        "later_sigma_deg": float(np.sqrt(np.nanmean(sigma**2))),
        "later_within": float(np.mean((np.abs(error) <= 1.96 * sigma)[np.isfinite(error)])),
        "covered": _covered(report, record),
        "tau_c_error": report.parameters["tau_c_mnm"].value / record.truth["tau_c_mnm"] - 1.0,
        "evidence": dict(report.evidence),
        "estimates": {
            effect.id: {name: [e.value, e.sigma] for name, e in effect.parameters.items()} for effect in report.effects
        },
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
    }


def _shown_deg(case: Case, record: Record) -> dict[str, float]:
    """Return by how much each of several hidden effects shows; of one alone the plain fit tells."""
    if case.kind != "double":
        return {}
    problem = ActuatorProblem(ActuatorModel(record.spec).prepare(record.table), record.spec)
    return shown(problem, case.effects)


def _covered(report: DiscoveryReport, record: Record) -> dict[str, bool]:
    """Return whether the 95 % interval of each of the rig's fitted values holds the truth."""
    return {
        name: bool(estimate.ci95[0] <= record.truth[name] <= estimate.ci95[1])
        for name, estimate in report.parameters.items()
        if name in record.truth and not estimate.fixed
    }


def _record(case: Case, cache: Path | None) -> Record:
    """Return a case's record, from the cache where there is one."""
    if cache is None:
        return make_record(case)
    path = cache / f"{case.name}.pickle"
    if path.exists():
        kept: Record = pickle.loads(path.read_bytes())  # noqa: S301 - this script's own files
        return kept
    record = make_record(case)
    cache.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(record))
    return record


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases of a part that match and are not in the file yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("work", "report", "usual"), default="work")
    parser.add_argument("--match", default="", help="only cases whose name contains one of these, comma-separated")
    parser.add_argument("--first", type=int, default=None, help="only the first so many")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cache", type=Path, default=None, help="folder in which the records are kept")
    parser.add_argument("--make-only", action="store_true", help="only make the records")
    given = parser.parse_args(arguments)
    wanted = given.match.split(",")
    cases = [case for case in suite(given.part) if any(word in case.name for word in wanted)][: given.first]
    done = set()
    if given.out.exists():
        done = {json.loads(line)["name"] for line in given.out.read_text().splitlines()}
    for case in cases:
        if case.name in done:
            continue
        record = _record(case, given.cache)
        if given.make_only:
            continue
        result = run_case(case, record)
        with given.out.open("a") as file:
            file.write(json.dumps(result) + "\n")
        print(_line(result), flush=True)


def _line(result: dict[str, Any]) -> str:
    found = "+".join(result["effects"]) or "-"
    others = " or ".join("+".join(names) for names in result["alternatives"])
    drivers = ",".join(name for name, _ in result["drivers"])
    return (
        f"{result['name']:48s} {result['size_deg']:5.1f} {result['verdict']:10s} {found:30s}"
        f" {result['before_deg']:6.2f} {result['after_deg']:6.2f} {result['later_deg']:6.2f}"
        f" {result['cpu_seconds']:4.0f} s {others} {drivers}"
    )


if __name__ == "__main__":
    main()
