"""The clock estimate of a real test with two instruments whose offset is not recorded.

Run: python benchmarks/sync/two_instruments.py ../shared/data/sma_react
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "sync")]

from two_instruments import read_pair  # noqa: E402 - needs the path above

from sync import estimate_clock  # noqa: E402 - needs the path above


def main() -> None:
    """Print offset, drift, method and notes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    clock = estimate_clock(*read_pair(parser.parse_args().folder))
    print(f"offset {clock.offset_s:.0f} s, 95 %: {clock.offset_ci95_s[0]:.0f} to {clock.offset_ci95_s[1]:.0f} s")
    print(f"drift {clock.drift_ppm:.0f} ppm, 95 %: {clock.drift_ci95_ppm[0]:.0f} to {clock.drift_ci95_ppm[1]:.0f} ppm")
    print(clock.method)
    for note in clock.notes:
        print(f"note: {note}")


if __name__ == "__main__":
    main()
