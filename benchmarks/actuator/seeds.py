"""Studies over seeds: one line of JSON per seed; seeds that the file already holds are not repeated."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def lines_of(one: Callable[[int], dict[str, Any]], *, about: str | None, usual: int = 200) -> list[dict[str, Any]]:
    """Do the seeds that the command line asks for with OUT.jsonl [FIRST] [SEEDS], and return their lines."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT.jsonl")
    parser.add_argument("first", type=int, nargs="?", default=0, help="the first seed (default: %(default)s)")
    parser.add_argument("seeds", type=int, nargs="?", default=usual, help="how many (default: %(default)s)")
    given = parser.parse_args()
    known = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    wanted = range(given.first, given.first + given.seeds)
    done = {line["seed"] for line in known}
    for seed in wanted:
        if seed not in done:
            known.append(one(seed))
            with given.out.open("a") as file:
                file.write(json.dumps(known[-1]) + "\n")
    return [line for line in known if line["seed"] in wanted]
