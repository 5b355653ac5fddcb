"""Coverage-guided fuzzing of every reader: executions, coverage, crashes, hangs, growth of memory.

    pip install atheris                               # Linux; the extra torsight[fuzz]
    python benchmarks/trust/fuzz.py --minutes 30      # all readers, the time shared evenly
    python benchmarks/trust/fuzz.py --reader model --minutes 5

Each reader runs in a process of its own under libFuzzer, from the good file of its kind (``tests/fuzz/readers.py``);
the corpus that it finds is kept between runs in ``--corpus``. An input that ends in anything but a record or an error
of ours stops that reader and is kept beside the corpus. A hang is an input over ten seconds, too much memory is 2 GB.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[2]
HANG_S = 10
MEMORY_MB = 2048
DICTIONARY = (
    "nan",
    "inf",
    "-1",
    "1e308",
    "true",
    "[[",
    "]]",
    "..",
    "/dev/null",
    "0x7fffffffffffffff",
    "time_s",
    "1e-320",
)


def fuzz_one(name: str, words: list[str]) -> None:
    """Fuzz one reader in this process; libFuzzer ends it."""
    import atheris

    with atheris.instrument_imports(include=["torsight", "sync", "tracker", "calibration", "tomllib", "json"]):
        from tests.fuzz.readers import READERS, make_neighbours
        from torsight.core.errors import TorsightError

    warnings.simplefilter("error")
    reader = READERS[name]
    shared = Path("/dev/shm")  # noqa: S108 - files in memory, where the system has them
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as folder:
        path = Path(folder) / reader.name
        make_neighbours(Path(folder))

        def once(content: bytes) -> None:
            path.write_bytes(content)
            with contextlib.suppress(TorsightError):
                reader.read(path)

        once(reader.good)
        once(reader.good)
        print(f"memory at the start: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB", flush=True)
        atheris.Setup([sys.argv[0], *words], once)
        atheris.Fuzz()


def run_reader(name: str, good: bytes, *, seconds: float, corpus: Path) -> dict[str, float | str]:
    """Fuzz one reader in a process of its own and return the figures."""
    place = corpus / name.replace(" ", "_")
    place.mkdir(parents=True, exist_ok=True)
    (place / "good").write_bytes(good)
    words = corpus / "words.txt"
    words.write_text("".join(f'"{word}"\n' for word in DICTIONARY))
    command = [
        *(sys.executable, __file__, "--one", name, "--"),
        *(f"-max_total_time={seconds:.0f}", f"-timeout={HANG_S}", f"-rss_limit_mb={MEMORY_MB}", "-print_final_stats=1"),
        *("-max_len=20000", f"-artifact_prefix={place}-", f"-dict={words}", str(place)),
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    began = time.monotonic()
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", env=environment, cwd=ROOT, check=False
    )
    log = done.stdout + done.stderr
    corpus.joinpath(f"{place.name}.log").write_text(log)
    coverage = re.findall(r"cov: (\d+) ft: (\d+)", log)
    start = re.search(r"memory at the start: (\d+)", log)
    return {
        "executions": float((re.findall(r"stat::number_of_executed_units: (\d+)", log) or ["0"])[-1]),
        "seconds": time.monotonic() - began,
        "branches": float(coverage[-1][0]) if coverage else 0.0,
        "features": float(coverage[-1][1]) if coverage else 0.0,
        "start_mb": float(start[1]) if start else 0.0,
        "peak_mb": float((re.findall(r"stat::peak_rss_mb:\s+(\d+)", log) or ["0"])[-1]),
        "outcome": _outcome(log, done.returncode),
    }


def _outcome(log: str, code: int) -> str:
    if "ERROR: libFuzzer: timeout" in log:
        return "HANG"
    if "out-of-memory" in log:
        return "MEMORY"
    if code != 0:
        found = re.findall(r"^(?:\w+\.)*(\w*(?:Error|Warning|Exception)): (.*)$", log, re.MULTILINE)
        return f"CRASH {found[-1][0]}: {found[-1][1][:90]}" if found else f"CRASH (code {code})"
    return "clean"


def main() -> None:
    """Fuzz the readers one after the other and print a table; end with 1 where one did not stay clean."""
    if "--one" in sys.argv:
        at = sys.argv.index("--one")
        fuzz_one(sys.argv[at + 1], sys.argv[sys.argv.index("--") + 1 :])
        return
    sys.path.insert(0, str(ROOT))
    from tests.fuzz.readers import READERS

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--reader", action="append", choices=sorted(READERS))
    parser.add_argument("--corpus", type=Path, default=Path(tempfile.gettempdir()) / "torsight-corpus")
    given = parser.parse_args()
    names = given.reader or list(READERS)
    print(f"{'reader':22s} {'executions':>10s} {'per s':>6s} {'branches':>8s} {'features':>8s} {'MB':>11s}  outcome")
    total, bad = 0.0, 0
    for name in names:
        row = run_reader(name, READERS[name].good, seconds=60.0 * given.minutes / len(names), corpus=given.corpus)
        total += float(row["executions"])
        bad += row["outcome"] != "clean"
        print(
            f"{name:22s} {row['executions']:10.0f} {float(row['executions']) / float(row['seconds']):6.0f} "
            f"{row['branches']:8.0f} {row['features']:8.0f} {row['start_mb']:4.0f} to {row['peak_mb']:4.0f}"
            f"  {row['outcome']}",
            flush=True,
        )
    print(f"{total:.0f} executions, {bad} of {len(names)} readers not clean; logs and inputs in {given.corpus}")
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
