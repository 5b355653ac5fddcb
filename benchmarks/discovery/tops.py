"""How well the top temperatures of incomplete heatings are known, on clean records of the blind suite.

Discovery takes a top to be known as well as the mean of the readings within some seconds (``temperature_errors``). That
time is right where the errors that the records ask for have mean square one, in their own standard deviations, and the
evidence is largest.

    python benchmarks/discovery/tops.py --first 22
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import blind
import numpy as np

from torsight.actuator.model import ActuatorModel
from torsight.core.progress import silent
from torsight.core.threads import one_thread
from torsight.discovery.actuator import temperature_errors
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.search import Search
from torsight.discovery.settings import Settings

SECONDS = (0.5, 1.0, 2.0, 4.0, 8.0)


def tops(record: blind.Record) -> tuple[list[float], float]:
    """Return the mean square of every top's error, in its standard deviations, and the plain model's log evidence."""
    problem = ActuatorProblem(ActuatorModel(record.spec).prepare(record.table), record.spec)
    search = Search(problem, settings=Settings(), progress=silent)
    plain = search.plain()
    weight = plain.likelihood.weight(plain.residual)
    errors = weight.errors(plain.residual)
    known = np.eye(len(errors)) + weight.shared.T @ (weight.shared * weight.each[:, None])
    return list(errors**2 + np.diag(np.linalg.inv(known))), plain.log_evidence


def main() -> None:
    """Print a line for every time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("work", "report"), default="work")
    parser.add_argument("--first", type=int, default=22, help="clean records")
    given = parser.parse_args()
    clean = [case for case in blind.suite(given.part) if case.kind == "clean"][: given.first]
    records = [blind.make_record(case) for case in clean]
    print("seconds   tops   mean square error   log evidence")
    with one_thread():
        for seconds in SECONDS:
            temperature_errors._TOP_KNOWN_S = seconds  # noqa: SLF001 - what is measured here
            each = [tops(record) for record in records]
            squares = [square for found, _ in each for square in found]
            print(f"{seconds:7.1f} {len(squares):6d} {np.mean(squares):19.2f} {sum(log for _, log in each):14.1f}")


if __name__ == "__main__":
    main()
