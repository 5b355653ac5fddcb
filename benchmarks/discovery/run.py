"""Run the blind suite and write one line of JSON per case.

Example: python benchmarks/discovery/run.py --part work --out work.jsonl --jobs 2
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from cases import OUTSIDE, Case, make_record, suite

from torsight.core.units import DEG
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_angle


def run_case(case: Case) -> dict[str, Any]:
    """Discover on one case and compare with the truth."""
    record = make_record(case)
    started = time.perf_counter()
    report = discover(record.table, record.spec, seed=0, where=case.name)
    seconds = time.perf_counter() - started
    later = predict_angle(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    error = (later - record.later_angle_rad) / DEG
    covered = {
        name: bool(estimate.ci95[0] <= record.truth[name] <= estimate.ci95[1])
        for name, estimate in report.parameters.items()
        if name in record.truth and not estimate.fixed
    }
    return {
        "name": case.name,
        "kind": case.kind,
        "model_error": case.model_error,
        "truth": list(case.effects),
        "size_deg": record.size_deg,
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
        "covered": covered,
        "tau_c_error": report.parameters["tau_c_mnm"].value / record.truth["tau_c_mnm"] - 1.0,
        "evidence": dict(report.evidence),
        "estimates": {
            effect.id: {name: [e.value, e.sigma] for name, e in effect.parameters.items()} for effect in report.effects
        },
        "seconds": seconds,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases of a part that match, two at a time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=("work", "report"), default="work")
    parser.add_argument("--match", default="", help="only cases whose name contains this")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    cases = [case for case in suite(given.part) if given.match in case.name]
    with given.out.open("w") as file, ProcessPoolExecutor(given.jobs) as pool:
        for done in as_completed([pool.submit(run_case, case) for case in cases]):
            if done.exception() is not None:
                print(f"failed: {done.exception()!r}", flush=True)
                continue
            result = done.result()
            file.write(json.dumps(result) + "\n")
            file.flush()
            print(
                f"{result['name']:55s} {result['verdict']:10s} {'+'.join(result['effects']) or '-':35s}"
                f" {result['before_deg']:7.2f} {result['after_deg']:6.2f} {result['later_deg']:6.2f}"
                f" {result['seconds']:5.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
