"""The transformation strain of a shape memory alloy under stress: a law of stress, measured on published records.

A specimen of NiTiCo was cooled and heated under constant stress, once at 7, 50, 150 and 200 MPa (SMA-REACT,
doi.org/10.1177/00219983221144499). The plain model says that it always transforms by the same strain. The missing part
is measured as a curve over stress, at its place inside the model; then two forms of this curve, a straight line and one
that saturates, are candidates.

Run: python examples/sma_stress.py ../shared/data/sma_react/isobaric
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from torsight.discovery import Candidate, Findings, candidate, find_missing, law, model_problem, parameter

Array = NDArray[np.float64]
STRESSES_MPA = (7, 50, 150, 200)

PARAMETERS = [
    parameter("strain_pct", 2.0, unit="%", lower=0.0, upper=10.0),
    parameter("martensite_c", -50.0, unit="°C", lower=-100.0, upper=50.0),
    parameter("austenite_c", -5.0, unit="°C", lower=-100.0, upper=50.0),
    parameter("cooling_width_c", 5.0, unit="K", lower=0.5, upper=40.0),
    parameter("heating_width_c", 3.0, unit="K", lower=0.5, upper=40.0),
    parameter("rise_c_per_mpa", 0.1, unit="K/MPa", lower=0.0, upper=1.0),
    parameter("hot_pct", 0.2, unit="%", lower=-2.0, upper=2.0),
]
CANDIDATES = [
    candidate("straight", parameter("per_mpa", 0.01, unit="%/MPa", lower=-0.1, upper=0.1, null=0.0)),
    candidate(
        "saturating",
        parameter("lacking", 0.5, lower=0.0, upper=1.0, null=0.0),
        parameter("soon_mpa", 80.0, unit="MPa", lower=10.0, upper=1000.0),
    ),
]
MORE = law("more_pct", driver="stress", unit="%", driver_unit="MPa")


def read_loop(path: Path) -> dict[str, Array]:
    """Return one loop: number of the row, temperature in °C, stress in MPa, strain in %."""
    temperature_c, strain, stress_mpa = np.loadtxt(path).T
    return {
        "row": np.arange(float(len(strain))),
        "temperature_c": temperature_c,
        "stress_mpa": np.full(len(strain), stress_mpa.mean()),
        "strain_pct": 100.0 * strain,
    }


def predict(p: Any, record: Any) -> Array:
    """Return the strain in %: the share of martensite grows while it gets colder, and falls again on heating."""
    coldest = int(np.argmin(record.temperature_c))
    cold = np.minimum.accumulate(record.temperature_c)
    warm = np.maximum.accumulate(np.where(np.arange(len(cold)) < coldest, -np.inf, record.temperature_c))
    lifted = p.rise_c_per_mpa * record.stress_mpa
    made = _share(p.martensite_c + lifted - cold, p.cooling_width_c)
    left = _share(p.austenite_c + lifted - warm, p.heating_width_c)
    reached = 1.0 - p.get("lacking", 0.0) * np.exp(-record.stress_mpa / p.get("soon_mpa", 1.0))
    span = p.strain_pct * reached + p.more_pct(record.stress_mpa) + p.get("per_mpa", 0.0) * record.stress_mpa
    return p.hot_pct + span * made * left


def _share(below_c: Array, width_c: float) -> Array:
    return 1.0 / (1.0 + np.exp(-np.clip(below_c / width_c, -50.0, 50.0)))


def discover(folder: Path, candidates: Sequence[Candidate] = tuple(CANDIDATES)) -> Findings:
    """Return the findings on what the plain model lacks on the four loops."""
    loops = [read_loop(folder / f"{stress} MPa.txt") for stress in STRESSES_MPA]
    problem = model_problem(
        predict,
        loops,
        PARAMETERS,
        [*candidates, MORE],
        output="strain_pct",
        initial=["hot_pct"],
        drivers=[],
    )
    return find_missing(problem)


def main(folder: Path) -> None:
    """Print the law, and its name."""
    found = discover(folder, ())
    print(found)
    for curve in found.laws:
        for stress, more, sigma in zip(curve.nodes, curve.values, curve.sigma, strict=True):
            print(f"  {stress:5.0f} MPa  {more:+.2f} ± {sigma:.2f} %")
    print(discover(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data/sma_react/isobaric"))
