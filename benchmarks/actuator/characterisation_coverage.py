"""Coverage of the characterisation's intervals: synthetic tests with the paper's noise, many seeds.

``python benchmarks/actuator/characterisation_coverage.py OUT.jsonl [FIRST] [SEEDS]``

One line per seed is appended to OUT.jsonl; seeds that the file already holds are skipped, so that an interrupted run
can be continued; the table of all seeds in the file is printed at the end.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from seeds import lines_of

from torsight.actuator.characterising.characterisation import characterise
from torsight.actuator.characterising.spring_tests import read_tests

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "actuator"))
from spring_bench import Spring, true_values, write_bench

_ROWS = 500


def one(seed: int) -> dict[str, Any]:
    """Return, for each value of a seed, whether its interval holds and its error in sigmas."""
    true = true_values(Spring())
    with tempfile.TemporaryDirectory() as folder:
        found = characterise(read_tests(write_bench(Path(folder), rng=np.random.default_rng(seed), rows=_ROWS)))
    values = {}
    for name, estimate in found.estimates.items():
        low, high = estimate.ci95
        values[name] = {
            "inside": bool(low <= true[name] <= high),
            "sigmas": (estimate.value - true[name]) / estimate.sigma,
            "sigma": estimate.sigma,
        }
    return {
        "seed": seed,
        "values": values,
        "better_law": found.better_law,
        "rmse": {name: step.rmse for name, step in found.steps.items()},
    }


def main() -> None:
    """Characterise the seeds that are not in the file yet; print coverage and error in sigmas of every value."""
    lines = lines_of(one, about=__doc__)
    table = {
        name: {
            "coverage": float(np.mean([line["values"][name]["inside"] for line in lines])),
            "rms_in_sigmas": float(np.sqrt(np.mean([line["values"][name]["sigmas"] ** 2 for line in lines]))),
            "sigma": float(np.median([line["values"][name]["sigma"] for line in lines])),
        }
        for name in lines[0]["values"]
    }
    rmse = {name: float(np.median([line["rmse"][name] for line in lines])) for name in lines[0]["rmse"]}
    better = float(np.mean([line["better_law"] == "liang_rogers" for line in lines]))
    print(json.dumps({"seeds": len(lines), "values": table, "rmse": rmse, "right_law": better}, indent=2))


if __name__ == "__main__":
    main()
