"""Effect of halving and doubling each constant that separates half-cycles, on logs whose switches are known.

Run: python benchmarks/actuator/half_cycles.py [--seeds 6] [--only WORD]

Logs of the synchronisation tests' generator (ramps, holds, natural cooling, the neighbour warmed; the paper's pace and
ten times as fast; noise of 0.03 and 0.3 °C; a controller that swings about its goal; a sensor that lags by 4 s; one
spring heated twice in a row) are split without their switches. In half of them torques shift when one spring is
switched for the other, so that the angle jumps by a degree. Columns: records in which each half-cycle's spring is
found, and how far the starts are from the switches, s: in half of the half-cycles, in 95 of 100 and at most. Then how
many of the starts are found by a jump, of those with one and of those without.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "sync")]

from made_up_pairs import Rig, make_pair, programme  # noqa: E402 - needs the path above

from benchmarks.half_and_twice import half_and_twice  # noqa: E402 - needs the path above
from torsight.actuator.record import segments  # noqa: E402 - needs the path above
from torsight.core.units import DEG  # noqa: E402 - needs the path above

CONSTANTS = (
    "TURN_C", "_BEFORE_S", "_JUMP_S", "_JUMP_RAD", "_COLD_SHARE",
)  # fmt: skip
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """A log without its switches, and what they were."""

    time_s: Array
    temps_c: tuple[Array, Array]
    angle_rad: Array
    springs: tuple[int, ...]
    starts_s: Array
    jumps: bool


def logs(seeds: int) -> list[Split]:
    """Return the logs."""
    made = []
    for seed in range(seeds):
        for fast in (False, True):
            for noise_c in (0.03, 0.3):
                made.append(log_of(seed, fast=fast, noise_c=noise_c, jumps=bool(len(made) % 2)))
    return made


def log_of(seed: int, *, fast: bool, noise_c: float, jumps: bool) -> Split:
    """Return one log: every second one with a spring that is heated twice in a row."""
    rng = np.random.default_rng([seed, fast, round(100.0 * noise_c)])
    pace = {"rates": (1.2, 3.0), "hold": (1.0, 8.0), "rest_s": 60.0} if fast else {}
    cycles = programme(seed, **pace)
    if seed % 2:
        cycles = [*cycles[:3], replace(cycles[3], spring=cycles[2].spring), *cycles[4:]]
    rig = Rig(lag_s=4.0, cooling_s=8.0 if fast else 40.0, temp_noise_c=0.0, passive_share=float(rng.uniform(0.05, 0.3)))
    pair = make_pair(seed, rig=rig, cycles=cycles, film_fps=4.0)
    time_s = pair.film_s
    switched = [np.interp(time_s, pair.log_s, heat.astype(float)) > 0.5 for heat in (pair.heat_a, pair.heat_b)]
    temps = []
    for temp_c, heat in zip((pair.temp_a_c, pair.temp_b_c), switched, strict=True):
        swing_c = rng.uniform(0.0, 1.5) * np.sin(time_s / rng.uniform(1.0, 4.0)) * heat
        held = np.interp(time_s, pair.log_s, temp_c) > 55.0
        read = np.interp(time_s, pair.log_s, temp_c) + swing_c * held + noise_c * rng.standard_normal(len(time_s))
        temps.append(np.round(read, 2))
    starts_s = pair.switch_true_s[:, 0]
    springs = tuple("ab".index(cycle.spring) for cycle in cycles)
    half = np.maximum(np.searchsorted(starts_s, time_s, side="right") - 1, 0)
    shift_deg = 1.0 * np.array(springs)[half] if jumps else 0.0
    return Split(time_s, (temps[0], temps[1]), (pair.angle_deg + shift_deg) * DEG, springs, starts_s, jumps)


def figures(made: list[Split]) -> str:
    """Return the columns."""
    right, away_s, told = 0, [], {True: [0, 0], False: [0, 0]}
    for log in made:
        noise_c = max(float(np.std(np.diff(temp_c, n=2))) / np.sqrt(6.0) for temp_c in log.temps_c)
        first = segments.half_cycles(*log.temps_c, noise_c=noise_c)
        found = segments.begun_with_a_jump(first, log.time_s, log.angle_rad, log.temps_c)
        if found.springs != log.springs:
            continue
        right += 1
        starts = np.flatnonzero(np.diff(found.half)) + 1
        away_s += np.abs(log.time_s[starts] - log.starts_s[1:]).tolist()
        told[log.jumps][0] += int(np.count_nonzero(starts != np.flatnonzero(np.diff(first.half)) + 1))
        told[log.jumps][1] += len(starts)
    half_s, most_s = np.quantile(away_s, [0.5, 0.95])
    return (
        f"{right:3d} of {len(made)}  {half_s:6.2f} {most_s:6.2f} {max(away_s):6.1f}  "
        f"{told[True][0] / max(told[True][1], 1):4.0%} {told[False][0] / max(told[False][1], 1):4.0%}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--only", default="", help="constants whose name holds this")
    options = parser.parse_args()
    made = logs(options.seeds)
    print(f"{'as it is':20s} {figures(made)}", flush=True)
    for name in CONSTANTS:
        if options.only not in name:
            continue
        for factor in half_and_twice(name, segments):
            print(f"{name + f' x{factor:g}':20s} {figures(made)}", flush=True)


if __name__ == "__main__":
    main()
