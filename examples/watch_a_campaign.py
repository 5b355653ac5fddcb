"""Many experiments from Python: a table of results that grows while they run.

Run: python examples/watch_a_campaign.py FOLDER_OF_EXPERIMENTS OUT
"""

from __future__ import annotations

import sys
from pathlib import Path

from torsight.cli.campaign import find_experiments, run_campaign, tasks, write_results


def told(step: str, done: float, total: float | None) -> None:
    """Print the number of finished experiments."""
    print(f"{step}: {done:g} of {total:g}")


def main(folder: Path, out: Path, *, jobs: int = 1) -> list[dict[str, object]]:
    """Run every unfinished experiment and print one line for each."""
    rows = run_campaign(tasks(find_experiments([str(folder)]), out), jobs=jobs, progress=told)
    for row in rows:
        found = row["message"] or f"τ_c {row['tau_c_mnm']:.3f} mN·m, {row['verdict']} {row['effects']}"
        print(f"{row['name']}: {row['status']}, {found}")
    write_results(rows, out)
    return rows


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), jobs=-1)
