"""Time of a discovery on a record of an hour at 4 rows a second, and of two hours at 4 and at 66.

    python benchmarks/discovery/speed.py
    python benchmarks/discovery/speed.py --rates 4 --effects position_friction

Eight half-cycles of a rig with a late sensor, of one whose friction changes once per turn and is flat at its extremes
(what that leaves beyond the effect's own form keeps the search going), and of one with Tanaka's phase law. Wanted on
two cores that do nothing else: 15 s for one hour at 4 Hz, 30 s for two hours at 66 Hz. Beside the time stands the time
that the cores worked, and how much longer it takes than the first (the search steps the model through the rows that
matter, whatever the rate).
"""

from __future__ import annotations

import argparse
import os
import time

from torsight.actuator.spec import actuator_from
from torsight.discovery.discover import discover
from torsight.synthetic.experiment import make_record
from torsight.synthetic.rig.rig_values import declared_from

_RATES_C_PER_S = (0.1, 0.15, 0.2, 0.12)
_EFFECTS: dict[str, dict[str, float | str]] = {
    "sensor_lag": {"lag_s": 4.0},
    "position_friction": {"amplitude": 0.3, "phase_rad": 0.7, "form": "flattened"},
    "kinetics_shape": {"bend": 0.0, "tanaka": 1.0},
}
_RECORDS = ((1.0, 4.0), (2.0, 4.0), (2.0, 66.0))
"""Hours, and rows a second."""


def scene(effect: str, *, cycles: int = 4, hours: float = 2.0) -> dict[str, object]:
    """Return a scene of up to four cycles in so many hours, the third heating of A incomplete."""
    half_cycles = []
    for cycle, rate in enumerate(_RATES_C_PER_S[:cycles]):
        for spring in "ab":
            top_c = 60.0 if (cycle, spring) == (2, "a") else 76.0
            ramp_s = (top_c - 23.4) / rate * hours / 2.0
            cool_s = hours * 3600.0 / 8.0 - ramp_s - 40.0
            half_cycles.append(
                {"spring": spring, "peak_c": top_c, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": cool_s}
            )
    return {
        "motion": {"kind": "rig"},
        "protocol": {"half_cycle": half_cycles, "rest_s": 20.0},
        "effects": {effect: _EFFECTS[effect]},
    }


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, nargs="+", default=[1.0, 2.0])
    parser.add_argument("--rates", type=float, nargs="+", default=[4.0, 66.0])
    parser.add_argument("--effects", nargs="+", choices=tuple(_EFFECTS), default=list(_EFFECTS))
    given = parser.parse_args()
    spec = actuator_from(declared_from({}, where="benchmark").to_toml(), where="benchmark")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    # Machine code is compiled once and kept: the first record is a short one that does not count.
    discover(make_record(scene("sensor_lag", cycles=1)).table, spec)
    for effect in given.effects:
        first_s = None
        for hours, rate_hz in _RECORDS:
            if hours not in given.hours or rate_hz not in given.rates:
                continue
            table = make_record(scene(effect, hours=hours), seed=4, rate_hz=rate_hz).table
            began_s, worked_s = time.perf_counter(), sum(os.times()[:4])
            report = discover(table, spec)
            took_s, worked_s = time.perf_counter() - began_s, sum(os.times()[:4]) - worked_s
            first_s = first_s or took_s
            print(
                f"{effect}, {rate_hz:5.1f} Hz, {len(table):7d} rows, {table.time_s[-1]:6.0f} s: {took_s:6.1f} s "
                f"({worked_s:.1f} s of the cores), {took_s / first_s:.2f} × the first; {report.verdict}, "
                f"{'+'.join(found.id for found in report.effects) or '-'}",
                flush=True,
            )


if __name__ == "__main__":
    main()
