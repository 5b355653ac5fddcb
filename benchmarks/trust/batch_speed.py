"""Speed-up of a campaign on two cores over one core.

    python benchmarks/trust/batch_speed.py --records 64

Renders a few short rigs, makes ``--records`` experiments of them, and does the whole campaign twice, each time from
nothing: with one process on one core, and with ``--jobs`` on all. For a machine that does nothing else; the ratio of
both times counts.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from kills import SCENE, TORSIGHT

from torsight.synthetic.scene import scene_from
from torsight.synthetic.scene_files import render_scene


def campaign(folder: Path, *, records: int, rigs: int) -> Path:
    """Make experiments over a few rendered rigs; every one has a seed, and so a task, of its own."""
    for index in range(rigs):
        scene = scene_from(tomllib.loads(SCENE.format(seed=23 + index)), where="scene")
        render_scene(scene, out=folder / "rigs" / f"{index}")
    text = (folder / "rigs" / "0" / "experiment.toml").read_text(encoding="utf-8")
    for index in range(records):
        rig = folder / "rigs" / f"{index % rigs}"
        (rig / f"experiment_{index:03d}.toml").write_text(text.replace("seed = 0", f"seed = {index}"), encoding="utf-8")
    for rig in (folder / "rigs").iterdir():
        (rig / "experiment.toml").unlink()
    return folder / "rigs"


def timed(rigs: Path, out: Path, *words: str, on_one_core: bool = False) -> float:
    """Do the campaign with these further words and return its wall time, s."""
    began = time.monotonic()
    done = subprocess.run(
        [*TORSIGHT, "batch", str(rigs), "--out", str(out), *words],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=(lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})) if on_one_core else None,
    )
    if done.returncode != 0:
        sys.exit(done.stderr)
    took_s = time.monotonic() - began
    print(f"  {' '.join(words):40s} {took_s:7.1f} s; {done.stderr.strip().splitlines()[-1]}")
    return took_s


def main() -> None:
    """Print both times and their ratio; end with 1 where it is below 1.7."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=64)
    parser.add_argument("--rigs", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    # One thread each: what is compared is processes.
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rigs = campaign(folder, records=given.records, rigs=given.rigs)
        print(f"{given.records} records, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the start")
        # Machine code is compiled once, and kept: the first run does not count.
        timed(next(rigs.rglob("experiment_*.toml")), folder / "warm", "--jobs", "1", on_one_core=True)
        # One process on one core: a discovery has threads of its own, and would take the second.
        one = timed(rigs, folder / "one", "--jobs", "1", on_one_core=True)
        several = timed(rigs, folder / "several", "--jobs", str(given.jobs), on_one_core=given.jobs == 1)
    print(f"{one / several:.2f} × as fast with {given.jobs} processes (wanted: over 1.70)")
    sys.exit(one / several <= 1.7)


if __name__ == "__main__":
    main()
