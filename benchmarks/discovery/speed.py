"""How long a discovery takes on a record of two hours, at 4 and at 66 rows a second.

    python benchmarks/discovery/speed.py
    python benchmarks/discovery/speed.py --rates 4

Eight half-cycles of a rig with a late sensor. Wanted: under 60 s on two cores that do nothing else. Beside the time
stands the time that the cores worked; at 66 Hz also how much longer it takes than at 4 Hz (the search steps the model
through the rows that matter, whatever the rate).
"""

from __future__ import annotations

import argparse
import os
import time

from torsight.actuator.spec import actuator_from
from torsight.discovery.discover import discover
from torsight.synthetic.experiment import make_record
from torsight.synthetic.values import declared_from

_RATES_C_PER_S = (0.1, 0.15, 0.2, 0.12)


def scene() -> dict[str, object]:
    """Return a scene of four cycles in two hours, the third heating of A incomplete."""
    half_cycles = []
    for cycle, rate in enumerate(_RATES_C_PER_S):
        for spring in "ab":
            top_c = 60.0 if (cycle, spring) == (2, "a") else 76.0
            ramp_s = (top_c - 23.4) / rate
            cool_s = 7200.0 / 8.0 - ramp_s - 40.0
            half_cycles.append(
                {"spring": spring, "peak_c": top_c, "ramp_s": ramp_s, "heat_s": ramp_s + 20.0, "cool_s": cool_s}
            )
    return {
        "motion": {"kind": "rig"},
        "protocol": {"half_cycle": half_cycles, "rest_s": 20.0},
        "effects": {"sensor_lag": {"lag_s": 4.0}},
    }


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rates", type=float, nargs="+", default=[4.0, 66.0])
    given = parser.parse_args()
    spec = actuator_from(declared_from({}, where="benchmark").to_toml(), where="benchmark")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
    first_s = None
    # Machine code is compiled once and kept: the first record is a short one that does not count.
    discover(make_record({**scene(), "protocol": {"half_cycle": scene()["protocol"]["half_cycle"][:2]}}).table, spec)  # type: ignore[index]
    for rate_hz in given.rates:
        table = make_record(scene(), seed=4, rate_hz=rate_hz).table
        began_s, worked_s = time.perf_counter(), time.process_time()
        report = discover(table, spec)
        took_s, worked_s = time.perf_counter() - began_s, time.process_time() - worked_s
        first_s = first_s or took_s
        print(
            f"{rate_hz:5.1f} Hz, {len(table):7d} rows, {table.time_s[-1]:6.0f} s: {took_s:6.1f} s ({worked_s:.1f} s of "
            f"the cores), {took_s / first_s:.2f} × the first; {report.verdict}, "
            f"{'+'.join(effect.id for effect in report.effects) or '-'}"
        )


if __name__ == "__main__":
    main()
