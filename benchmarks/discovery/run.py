"""Run the blind suite, one line of JSON per case; cases that the file already holds are skipped.

``work`` and ``report`` are random laws, other forms, pairs and clean rigs (:mod:`blind`); ``forms-…`` is the suite of
the library's own effects and of mechanisms outside it (:mod:`cases`). A case at which discovery fails is recorded and
run again next time.

Examples
--------
    python benchmarks/discovery/run.py --part work --first 24 --jobs 2 --cache records --out work.jsonl
    python benchmarks/discovery/run.py --part report --jobs 2 --out report.jsonl && \
        python benchmarks/discovery/report.py report.jsonl --diagram reliability.png
    python benchmarks/discovery/run.py --part forms-usual --match double --out usual.jsonl
    python benchmarks/discovery/run.py --part work --match clean- --digit 0.1 --out rounded.jsonl
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import time
import traceback
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeAlias

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import blind
import cases
import numpy as np
from blind_hidden import PLACES
from blind_rig import Record as BlindRecord
from numpy.typing import NDArray

from torsight.core.units import DEG
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_with_sigma
from torsight.discovery.report import DiscoveryReport

Case: TypeAlias = blind.Case | cases.Case
Record: TypeAlias = BlindRecord | cases.Record
Array = NDArray[np.float64]

PARTS: Final = ("work", "report", "forms-work", "forms-report", "forms-usual")
_MOVES_DEG_S: Final = 0.05
_HOT_C: Final = 55.0
"""A spring that hot is past its motion on the way up and before it on the way down: it stands at its top."""


def suite(part: str) -> Sequence[Case]:
    """Return the cases of a part."""
    return cases.suite(part.removeprefix("forms-")) if part.startswith("forms-") else blind.suite(part)


def run_case(case: Case, record: Record) -> dict[str, Any]:
    """Discover on one case and compare with the truth."""
    started, cpu = time.perf_counter(), sum(os.times()[:4])
    report = discover(record.table, record.spec, seed=0, where=case.name)
    seconds, cpu_seconds = time.perf_counter() - started, sum(os.times()[:4]) - cpu
    return {
        **_hidden(case, record),
        "verdict": report.verdict,
        "effects": [effect.id for effect in report.effects],
        "probabilities": {effect.id: effect.probability for effect in report.effects},
        "alternatives": [list(names) for names in report.alternatives],
        "drivers": [list(item) for item in report.drivers],
        "laws": [[law.effect, law.port, law.driver, law.spring, law.share] for law in report.laws],
        "before_deg": report.before.rmse_held_out_deg,
        "after_deg": report.after.rmse_held_out_deg,
        "train_deg": [report.before.rmse_train_deg, report.after.rmse_train_deg],
        "floor_deg": report.noise_floor_deg,
        **_later(report, record),
        "covered": _covered(report, record),
        "evidence": dict(report.evidence),
        "estimates": {
            effect.id: {name: [e.value, e.sigma] for name, e in effect.parameters.items()} for effect in report.effects
        },
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
    }


def _hidden(case: Case, record: Record) -> dict[str, Any]:
    """Return what the case hides and which answers are right."""
    found = {
        "name": case.name,
        "kind": case.kind,
        "truth": list(case.effects),
        "sizes_deg": dict(record.sizes_deg),
        "shown_deg": dict(record.shown_deg) if isinstance(record, BlindRecord) else {},
        "details": {name: dict(details) for name, details in record.details.items()},
        "zero_deg": record.truth.get("zero_deg", 0.0),
    }
    if isinstance(case, blind.Case) and case.law is not None:
        place = PLACES[case.law]
        found |= {"law": list(case.law), "ports": place.ports, "drivers_right": place.drivers, "own_names": place.names}
        found["spring"] = record.law.spring if isinstance(record, BlindRecord) and record.law else "b"
    elif case.kind == "outside":
        found["drivers_right"] = list(cases.OUTSIDE[case.effects[0]][1])
    return found


def _later(report: DiscoveryReport, record: Record) -> dict[str, Any]:
    """Return how well the later record is predicted, and how often the stated interval holds the true angle."""
    later = predict_with_sigma(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    error = (later.angle_rad - record.later_angle_rad) / DEG
    sigma = later.sigma_rad / DEG
    inside = np.abs(error) <= 1.96 * sigma
    moves = np.abs(np.gradient(record.later_angle_rad, record.later.time_s)) / DEG > _MOVES_DEG_S
    top = ~moves & (np.maximum(record.later.temp_a_c, record.later.temp_b_c) > _HOT_C)
    kept = np.isfinite(error)
    groups = {"motion": moves, "rest": ~moves, "top": top, "all": np.ones(len(error), bool)}
    return {
        "later_deg": float(np.sqrt(np.mean(error[kept] ** 2))),
        "later_sigma_deg": float(np.sqrt(np.mean(sigma[kept] ** 2))),
        "within": {
            name: float(np.mean(inside[group & kept])) for name, group in groups.items() if np.any(group & kept)
        },
    }


def _covered(report: DiscoveryReport, record: Record) -> dict[str, bool]:
    """Return whether the 95 % interval of each of the rig's fitted values holds the truth."""
    return {
        name: bool(estimate.ci95[0] <= record.truth[name] <= estimate.ci95[1])
        for name, estimate in report.parameters.items()
        if name in record.truth and not estimate.fixed
    }


def _record(case: Case, cache: Path | None) -> Record:
    """Return a case's record, from the cache where there is one."""
    path = None if cache is None else cache / f"{case.name}.pickle"
    if path is not None and path.exists():
        kept: Record = pickle.loads(path.read_bytes())  # noqa: S301 - this script's own files
        return kept
    record = blind.make_record(case) if isinstance(case, blind.Case) else cases.make_record(case)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickle.dumps(record))
    return record


def _rounded(record: Record, digit_c: float) -> Record:
    """Return a record as a logger writes it whose last digit stands for so many °C."""
    table, later = (
        replace(
            log,
            temp_a_c=digit_c * np.round(log.temp_a_c / digit_c),
            temp_b_c=digit_c * np.round(log.temp_b_c / digit_c),
        )
        for log in (record.table, record.later)
    )
    return replace(record, table=table, later=later)


def _work(case: Case, cache: Path | None, digit_c: float, make_only: bool) -> dict[str, Any] | None:  # noqa: FBT001
    record = _record(case, cache)
    if make_only:
        return None
    if digit_c > 0.0:
        record = _rounded(record, digit_c)
    try:
        return run_case(case, record)
    except Exception:  # noqa: BLE001 - what a case breaks is a finding, and the others go on
        return {**_hidden(case, record), "failed": traceback.format_exc()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases of a part that match and are not in the file yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=PARTS, default="work")
    parser.add_argument("--match", default="", help="only cases whose name contains one of these, comma-separated")
    parser.add_argument("--after", type=int, default=0, help="leave out so many at the beginning")
    parser.add_argument("--first", type=int, default=None, help="only the first so many")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cache", type=Path, default=None, help="folder in which the records are kept")
    parser.add_argument("--digit", type=float, default=0.0, help="round temperatures to so many °C, as loggers do")
    parser.add_argument("--make-only", action="store_true", help="only make the records")
    given = parser.parse_args(arguments)
    wanted = given.match.split(",")
    chosen = [case for case in suite(given.part) if any(word in case.name for word in wanted)]
    chosen = chosen[given.after :][: given.first]
    lines = given.out.read_text().splitlines() if given.out.exists() else []
    done = {result["name"] for result in map(json.loads, lines) if "failed" not in result}
    left = [case for case in chosen if case.name not in done]
    with ProcessPoolExecutor(given.jobs) as pool:
        tasks = [pool.submit(_work, case, given.cache, given.digit, given.make_only) for case in left]
        for number, task in enumerate(as_completed(tasks), 1):
            result = task.result()
            if result is not None:
                with given.out.open("a") as file:
                    file.write(json.dumps(result, default=_plain) + "\n")
                print(f"{number:3d}/{len(left)} {_line(result)}", flush=True)


def _plain(value: Any) -> Any:
    """Return what JSON has no word for as what it has: numbers of numpy, arrays, mappings, objects' names."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)


def _line(result: dict[str, Any]) -> str:
    if "failed" in result:
        return f"{result['name']:48s} failed: {result['failed'].strip().splitlines()[-1]}"
    found = (
        "+".join(result["effects"]) or ",".join(f"{port}({driver})" for _, port, driver, *_ in result["laws"]) or "-"
    )
    others = " or ".join("+".join(names) for names in result["alternatives"])
    drivers = ",".join(name for name, _ in result["drivers"])
    size = max(result["sizes_deg"].values(), default=0.0)
    return (
        f"{result['name']:48s} {size:5.2f} {result['verdict']:10s} {found:30s}"
        f" {result['before_deg']:6.2f} {result['after_deg']:6.2f} {result['later_deg']:6.2f}"
        f" {result['seconds']:4.0f} s {others} {drivers}"
    )


if __name__ == "__main__":
    main()
