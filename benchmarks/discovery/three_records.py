"""Joint answer from three records of one rig on a case that one record may leave ambiguous.

The rig of a case of the blind suite goes on with two more programmes of its own (other rates, other incomplete
heatings); each record is answered alone, then all three together, and a later programme is predicted by both.

    python benchmarks/discovery/three_records.py [CASE]
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from itertools import pairwise

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import blind
import numpy as np
from blind_rig import EVERY, REFERENCE, STEP_S, Record, draw_programme, draw_rig, run_rig, seen

from torsight.core.records import SyncedTable
from torsight.core.units import DEG
from torsight.discovery.discover import discover
from torsight.discovery.prediction import predict_with_sigma
from torsight.discovery.report import DiscoveryReport
from torsight.discovery.together import discover_together

RECORDS = 3
CASE = "pair-sensor_lag+eccentricity-103002"
COLUMNS = ("angle_rad", "angle_sigma_rad", "temp_a_c", "temp_b_c")


def records(case: blind.Case) -> tuple[Record, list[SyncedTable]]:
    """Return all that the rig of a case shows, and its records one by one."""
    sized, rng = blind.make_record(case), np.random.default_rng(case.seed)
    rig = draw_rig(rng, turned=None)
    shift_c = rig.declared["material"]["A_s_c"] - REFERENCE["material"]["A_s_c"]  # type: ignore[index]
    more = [draw_programme(np.random.default_rng(case.seed + k), shift_c, cycles=4) for k in range(1, RECORDS)]
    whole = replace(rig.record, half_cycles=sum((one.half_cycles for one in (rig.record, *more)), ()))
    laws = () if sized.law is None else (sized.law,)
    longer = replace(rig, record=whole)
    found = seen(run_rig(longer, (sized.details, laws)), longer, sized.details)
    ends = np.cumsum([0, rig.record.duration_s, *(one.duration_s - one.rest_s for one in more)])
    rows = np.rint(ends / (STEP_S * EVERY)).astype(int)
    return found, [_part(found.table, slice(a, b)) for a, b in pairwise(rows)]


def _part(table: SyncedTable, rows: slice) -> SyncedTable:
    """Return rows of a table, its time from zero."""
    time_s = table.time_s[rows]
    return SyncedTable(time_s=time_s - time_s[0], **{name: getattr(table, name)[rows] for name in COLUMNS})


def line(name: str, report: DiscoveryReport, record: Record) -> str:
    """Return an answer in one line, with the error of its prediction of what came after the last record."""
    others = " or ".join("+".join(names) for names in report.alternatives)
    found = "+".join(item.id for item in report.effects) or ", ".join(f"{i.port}({i.driver})" for i in report.laws)
    later = predict_with_sigma(report.model, record.later, start_angle_rad=float(record.later_angle_rad[0]))
    error = float(np.sqrt(np.nanmean((later.angle_rad - record.later_angle_rad) ** 2))) / DEG
    return f"{name:12s} {report.verdict:10s} {found or '-'}{' or ' if others else ''}{others}, later {error:.2f}°"


def main() -> None:
    """Print one line per record, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="?", default=CASE, help="name of a case, or how it ends")
    parser.add_argument("--part", choices=("work", "report"), default="work")
    given = parser.parse_args()
    case = next(case for case in blind.suite(given.part) if case.name.endswith(given.case))
    record, tables = records(case)
    print(f"{case.name}: {dict(record.details) or record.law}", flush=True)
    for number, table in enumerate(tables, start=1):
        print(line(f"record {number}", discover(table, record.spec), record), flush=True)
    print(line("together", discover_together(tables, record.spec), record))


if __name__ == "__main__":
    main()
