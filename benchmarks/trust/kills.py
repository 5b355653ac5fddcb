"""SIGKILL at random instants: every file is whole, and ``--resume`` ends in the bytes of an undisturbed run.

    python benchmarks/trust/kills.py track --kills 50
    python benchmarks/trust/kills.py run --kills 50
    python benchmarks/trust/kills.py batch --kills 50 --signal TERM

Instants are spread evenly at random over the length of an undisturbed run. After each kill every file that has its
final name must hold, byte for byte, what the undisturbed run has there (nothing half-written, nothing else; a model
may still be that of the fit, which the discovery replaces). After ``--resume`` (for ``batch``: the same call again) all
files must be there with those bytes and nothing beside them. Timestamps are left out of the comparison: a recording
is compared by its data (see ``same_recording``).
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.recordings import same_recording
from tests.small_picture import SMALL_PICTURE
from torsight.core.files.results import DOCUMENTS
from torsight.synthetic.scene import scene_from
from torsight.synthetic.scene_files import render_scene

SCENE = (
    """
seed = {seed}
[protocol]
time_factor = 0.05
rest_s = 12.0
[[protocol.half_cycle]]
spring = "a"
peak_c = 84.0
[[protocol.half_cycle]]
spring = "b"
peak_c = 82.0
[thermal]
wire_capacity_j_per_k = 0.6
[film]
fps = 10.0
crf = 8
"""
    + SMALL_PICTURE
)
TORSIGHT = (sys.executable, "-m", "torsight.cli.main")


def commands(kind: str, rigs: list[Path], out: Path) -> tuple[list[str], list[str]]:
    """Return the words of the run, and of the one that goes on with it."""
    if kind == "track":
        words = ["track", str(rigs[0] / "film.mp4"), "--out", str(out)]
    elif kind == "run":
        words = ["run", str(rigs[0] / "experiment.toml"), "--out", str(out)]
    else:
        words = ["batch", *(str(rig / "experiment.toml") for rig in rigs), "--out", str(out), "--jobs", "2"]
        return words, words
    return words, [*words, "--resume"]


def files(out: Path) -> dict[str, Path]:
    """Return every file with its final name."""
    return {
        str(path.relative_to(out)): path
        for path in sorted(out.rglob("*"))
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(out).parts)
    }


def same(path: Path, reference: Path) -> bool:
    """Return whether two files say the same, timestamps apart."""
    if path.suffix == ".rrd":
        return same_recording(path, reference)
    return path.read_bytes() == reference.read_bytes()


def is_the_fits(path: Path, fitted: list[bytes]) -> bool:
    """Return whether this is the model that the fit leaves until the discovery replaces it."""
    return path.name == "model.json" and path.read_bytes() in fitted


def stage(out: Path) -> str:
    """Return how far a killed run had come."""
    done = [name for name in DOCUMENTS if list(out.rglob(f"{name}.json"))]
    return "nothing" if not done else done[-1]


def start(words: list[str], log: Path) -> subprocess.Popen[bytes]:
    """Start a command in a session of its own, so that a signal meets all of its processes or only the first."""
    with log.open("ab") as file:
        return subprocess.Popen([*TORSIGHT, *words], stdout=file, stderr=file, start_new_session=True)


def finish(words: list[str], log: Path) -> float:
    """Run a command to its end and return how long it took, s."""
    began = time.monotonic()
    process = start(words, log)
    if process.wait() != 0:
        sys.exit(f"{' '.join(words)} ended with {process.returncode}; see {log}")
    return time.monotonic() - began


def main() -> None:
    """Kill, look, go on, compare; end with 1 where anything differed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("track", "run", "batch"))
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--signal", choices=("KILL", "TERM", "INT"), default="KILL")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this long")
    given = parser.parse_args()
    number = getattr(signal, f"SIG{given.signal}")
    rng = np.random.default_rng(given.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rigs = [folder / f"rig{index}" for index in range(2 if given.command == "batch" else 1)]
        for index, rig in enumerate(rigs):
            render_scene(scene_from(tomllib.loads(SCENE.format(seed=23 + index)), where="scene"), out=rig)
        # The same folder for all: its name stands in provenance, tables and pages.
        out, log, kept = folder / "out", folder / "log", folder / "undisturbed"
        words, again = commands(given.command, rigs, out)
        finish(words, log)
        shutil.rmtree(out)
        length_s = finish(words, log)
        out.rename(kept)
        began = time.monotonic()
        whole = files(kept)
        fitted = []
        for merged in sorted(kept.rglob("merged.csv")) if given.command != "track" else []:
            actuator = rigs[0 if merged.parent == kept else [rig.name for rig in rigs].index(merged.parent.name)]
            finish(
                ["fit", str(merged), "--actuator", str(actuator / "actuator.toml"), "--out", str(folder / "fit")], log
            )
            fitted.append((folder / "fit" / "model.json").read_bytes())
        wrong: list[str] = []
        killed, resumed_s = Counter[str](), []
        for count in range(given.kills):
            if time.monotonic() - began > 60.0 * given.minutes:
                print(f"stopped after {count} kills")
                break
            process = start(words, log)
            time.sleep(rng.uniform(0.0, length_s))
            os.kill(process.pid, number)
            process.wait()
            killed[stage(out) if out.exists() else "no folder"] += 1
            for relative, path in files(out).items():
                if relative not in whole or not (same(path, kept / relative) or is_the_fits(path, fitted)):
                    wrong.append(f"kill {count}: {relative} is not what the undisturbed run has")
            resumed_s.append(finish(again, log))
            left = sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())
            if left != sorted(whole):
                wrong.append(f"kill {count}: after --resume {set(left) ^ set(whole)} differ")
            wrong += [
                f"kill {count}: {relative} differs after --resume"
                for relative in set(left) & set(whole)
                if not same(out / relative, kept / relative)
            ]
            shutil.rmtree(out)
    print(f"{given.command}: {sum(killed.values())} times SIG{given.signal}; undisturbed {length_s:.1f} s")
    print(f"  going on took {np.mean(resumed_s):.1f} s on average; files compared: {len(whole)} after each")
    print(f"  last finished document at the kill: {dict(killed)}")
    print(f"  {len(wrong)} differences")
    for line in wrong:
        print(f"    {line}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
