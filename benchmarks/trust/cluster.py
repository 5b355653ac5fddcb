"""A whole campaign on a Dask cluster of this machine, compared with the same campaign in local processes.

    python benchmarks/trust/cluster.py --records 4

Starts a scheduler and workers in processes of their own, renders short rigs, runs ``torsight batch`` with
``--scheduler`` and without, and compares every file of both; recordings by their data. Ends with 1 where any differs.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from batch_speed import campaign, timed
from kills import files, same


def main() -> None:
    """Print both times and what differs."""
    from distributed import LocalCluster

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=4)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rigs = campaign(folder, records=given.records, rigs=min(2, given.records))
        # The same folder for both: its name stands in tables and pages.
        out, kept = folder / "out", folder / "cluster"
        with LocalCluster(
            n_workers=given.workers, threads_per_worker=1, host="127.0.0.1", protocol="tcp", dashboard_address=None
        ) as cluster:
            print(f"{given.records} records, {given.workers} workers at {cluster.scheduler_address}")
            timed(rigs, out, "--scheduler", cluster.scheduler_address)
        out.rename(kept)
        timed(rigs, out, "--jobs", str(given.workers))
        here, there = files(out), files(kept)
        differ = sorted(set(here) ^ set(there)) + [
            path for path in sorted(set(here) & set(there)) if not same(here[path], there[path])
        ]
        print(f"{len(here)} files, {len(differ)} differ {json.dumps(differ)}")
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
