"""Test whether fits of the plain model from five starts end at one optimum, on clean records of the blind suite.

The first start is the priors' means, the others are drawn from the priors of all values and of the start state. An end
is as good as the best where its posterior density is within 0.5 log units, under the likelihood of the first one's end.

    python benchmarks/discovery/starts.py --first 100
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import blind
import numpy as np

from torsight.actuator.model import ActuatorModel
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import silent
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.search import Search
from torsight.discovery.settings import Settings

STARTS = 5
ALIKE = 0.5


def gaps(case: blind.Case) -> list[float]:
    """Return by how many log units each start's end is below the best one's."""
    record = blind.make_record(case)
    problem = ActuatorProblem(ActuatorModel(record.spec).prepare(record.table), record.spec)
    search = Search(problem, settings=Settings(), progress=silent)
    ends = [search.plain()]
    rng = np.random.default_rng(case.seed)
    for _ in range(STARTS - 1):
        start = {
            p.name: float(np.clip(p.value + (p.sigma or 0.2 * p.value) * rng.standard_normal(), p.lower, p.upper))
            for p in problem.parameters
        }
        ends.append(search.fit_from(start))
    values = [replace(end, likelihood=ends[0].likelihood).log_posterior for end in ends]
    return [max(values) - value for value in values]


def main() -> None:
    """Print the gaps of every record, and how many fits ended at the best optimum."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("work", "report"), default="work")
    parser.add_argument("--first", type=int, default=100, help="clean records")
    given = parser.parse_args()
    clean = [case for case in blind.suite(given.part) if case.kind == "clean"][: given.first]
    found = []
    with one_thread():
        for case in clean:
            found.append(gaps(case))
            print(f"{case.name:24s} {' '.join(f'{gap:7.2f}' for gap in found[-1])}", flush=True)
    off = np.array(found)
    print(
        f"from the priors' means within {ALIKE} log units of the best: {np.mean(off[:, 0] <= ALIKE):.0%} of the records"
    )
    print(f"all {STARTS} starts: {np.mean(np.all(off <= ALIKE, axis=1)):.0%}; single fits: {np.mean(off <= ALIKE):.0%}")


if __name__ == "__main__":
    main()
