"""Uncertainty of the top temperatures of incomplete heatings, on clean records of the blind suite.

Discovery takes a top to be known as well as the smoother says (``temperature_errors``). That is right where the errors
that the records ask for have mean square one, in their own standard deviations, and the evidence is largest: it is
measured with the standard deviations as they are, and with half and twice of them.

``--constants`` prints the angle's errors with half and with twice the constants from which errors are drawn, and
``--draws`` how far the plain model's log evidence depends on the seed, by the number of draws.

    python benchmarks/discovery/tops.py --first 22
    python benchmarks/discovery/tops.py --first 4 --constants
    python benchmarks/discovery/tops.py --first 6 --draws
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import blind
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from half_and_twice import half_and_twice

from torsight.actuator.model import ActuatorModel
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import silent
from torsight.core.units import Floats
from torsight.discovery.actuator import temperature_errors
from torsight.discovery.actuator_problem import ActuatorProblem
from torsight.discovery.inference.search import Search
from torsight.discovery.settings import Settings

FACTORS = (0.5, 1.0, 2.0)
SEEDS = 6
CONSTANTS = ((temperature_errors, "TURN_C"), (temperature_errors, "_DRAWS"))


class Scaled(ActuatorProblem):
    """An actuator's problem whose tops are known so many times less well."""

    factor = 1.0

    def shared_errors(self, values: Mapping[str, float], effects: Sequence[str]) -> Floats:
        """Return the errors (n, k) that many samples share, degrees."""
        return self.factor * super().shared_errors(values, effects)


def tops(record: blind.Record, factor: float = 1.0) -> tuple[list[float], float]:
    """Return the mean square of every top's error, in its standard deviations, and the plain model's log evidence."""
    problem = Scaled(ActuatorModel(record.spec).prepare(record.table), record.spec)
    problem.factor = factor
    search = Search(problem, settings=Settings(), progress=silent)
    plain = search.fits.plain()
    weight = plain.likelihood.weight(plain.residual)
    errors = weight.errors(plain.residual)
    known = np.eye(len(errors)) + weight.shared.T @ (weight.shared * weight.each[:, None])
    return list(errors**2 + np.diag(np.linalg.inv(known))), plain.log_evidence


def input_errors(records: Sequence[blind.Record]) -> Floats:
    """Return what errors of the temperatures do to the angle (3,), degrees rms: in motion, at rest, and by tops."""
    found = []
    for record in records:
        problem = ActuatorProblem(ActuatorModel(record.spec).prepare(record.table), record.spec)
        values = {parameter.name: parameter.value for parameter in problem.parameters}
        noise = problem.input_noise(values, ())
        shared = np.sqrt(np.sum(problem.shared_errors(values, ()) ** 2, axis=1))
        found.append([np.mean(each**2) for each in (noise[~problem.rest], noise[problem.rest], shared)])
    return np.asarray(np.sqrt(np.mean(found, axis=0)))


def show_constants(records: Sequence[blind.Record]) -> None:
    """Print the angle's errors at half and twice of every constant."""
    print("constant        factor   in motion   at rest   by tops")
    lines = [("", 1.0, input_errors(records))]
    for module, name in CONSTANTS:
        lines += [(name, factor, input_errors(records)) for factor in half_and_twice(name, module)]
    for name, factor, errors in lines:
        print(f"{name:15s} {factor:6.1f} {errors[0]:10.3f}° {errors[1]:8.3f}° {errors[2]:8.3f}°")


def by_seed(records: Sequence[blind.Record]) -> list[float]:
    """Return the standard deviation of the plain model's log evidence over seeds, for every record."""
    spreads = []
    for record in records:
        drive = ActuatorModel(record.spec).prepare(record.table)
        problems = [ActuatorProblem(drive, record.spec, seed=seed) for seed in range(SEEDS)]
        found = [Search(one, settings=Settings(), progress=silent).fits.plain().log_evidence for one in problems]
        spreads.append(float(np.std(found, ddof=1)))
    return spreads


def show_draws(records: Sequence[blind.Record]) -> None:
    """Print how far the log evidence depends on the seed, at half and twice of the number of draws."""
    print("factor of draws   median of the records   largest")
    lines = [(1.0, by_seed(records))]
    lines += [(factor, by_seed(records)) for factor in half_and_twice("_DRAWS", temperature_errors)]
    for factor, spreads in lines:
        print(f"{factor:15.1f} {np.median(spreads):23.2f} {max(spreads):9.2f}")


def main() -> None:
    """Print a line for every time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=("work", "report"), default="work")
    parser.add_argument("--first", type=int, default=22, help="clean records")
    parser.add_argument("--constants", action="store_true", help="half and twice of constants instead")
    parser.add_argument("--draws", action="store_true", help="dependence on the number of draws instead")
    given = parser.parse_args()
    clean = [case for case in blind.suite(given.part) if case.kind == "clean"][: given.first]
    records = [blind.make_record(case) for case in clean]
    if given.constants or given.draws:
        with one_thread():
            (show_constants if given.constants else show_draws)(records)
        return
    print("factor    tops   mean square error   log evidence")
    with one_thread():
        for factor in FACTORS:
            each = [tops(record, factor) for record in records]
            squares = [square for found, _ in each for square in found]
            print(f"{factor:7.1f} {len(squares):6d} {np.mean(squares):19.2f} {sum(log for _, log in each):14.1f}")


if __name__ == "__main__":
    main()
