"""How often the intervals of the characterisation hold: synthetic tests with the paper's noise, many seeds.

``python benchmarks/actuator/characterisation_coverage.py [SEEDS]``
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from torsight.actuator.characterisation import characterise
from torsight.actuator.spring_tests import read_tests

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "actuator"))
from spring_bench import Spring, true_values, write_bench


def main(seeds: int) -> None:
    """Print coverage and mean error in sigmas of every value."""
    true = true_values(Spring())
    inside = dict.fromkeys(true, 0)
    sizes: dict[str, list[float]] = {name: [] for name in true}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(seeds):
            path = write_bench(Path(folder), rng=np.random.default_rng(seed), rows=500)
            for name, estimate in characterise(read_tests(path)).estimates.items():
                low, high = estimate.ci95
                inside[name] += low <= true[name] <= high
                sizes[name].append((estimate.value - true[name]) / estimate.sigma)
    table = {
        name: {"coverage": inside[name] / seeds, "rms_in_sigmas": float(np.sqrt(np.mean(np.square(sizes[name]))))}
        for name in true
    }
    print(json.dumps({"seeds": seeds, "values": table}, indent=2))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
