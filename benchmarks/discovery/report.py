"""Print the blind suite's figures from the lines that run.py has written.

Example: python benchmarks/discovery/report.py report.jsonl
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

Result = dict[str, Any]
LEAST_SHOWN_DEG: Final = 0.2
"""An effect that takes less from the error is not worth a name: two resolutions, as discovery counts it."""


def read(paths: Sequence[str]) -> list[Result]:
    """Return the results of all files."""
    return [json.loads(line) for path in paths for line in Path(path).read_text().splitlines()]


def candidates_of(result: Result) -> list[set[str]]:
    """Return the sets of effects that an answer holds possible, the named one first."""
    if not result["effects"]:
        return []
    return [set(result["effects"]), *(set(names) for names in result["alternatives"])]


def is_named(result: Result) -> bool:
    """Return whether the right set is the answer, or one of at most three."""
    sets = candidates_of(result)
    return len(sets) <= 3 and set(result["truth"]) in sets


def share(results: Sequence[Result], right: Callable[[Result], bool]) -> str:
    """Return 'k of n (p %)'."""
    if not results:
        return "none run"
    count = sum(right(result) for result in results)
    return f"{count} of {len(results)} ({100.0 * count / len(results):.0f} %)"


def quartiles(values: Sequence[float]) -> str:
    """Return median and 90 % quantile."""
    kept = np.array([value for value in values if np.isfinite(value)])
    return "–" if not len(kept) else f"{np.median(kept):.2f} (90 %: {np.quantile(kept, 0.9):.2f})"


def both_show(result: Result) -> bool:
    """Return whether each of the hidden effects leaves something to see when it alone is left out."""
    return all(size >= LEAST_SHOWN_DEG for size in result.get("shown_deg", {}).values())


def is_the_one_that_shows(result: Result) -> bool:
    """Return whether the answer, or one of at most three, holds just those hidden effects that show."""
    sets = candidates_of(result) or [set()]
    seen = {name for name, size in result["shown_deg"].items() if size >= LEAST_SHOWN_DEG}
    return len(sets) <= 3 and seen in sets


def right_driver(result: Result) -> bool:
    """Return whether the first driver is one of the right answers."""
    return bool(result["drivers"]) and result["drivers"][0][0] in result["expected_drivers"]


def figures(results: list[Result]) -> list[tuple[str, str]]:
    """Return the figures that are asked for, name and value."""
    kind = {name: [r for r in results if r["kind"] == name] for name in ("clean", "single", "double", "outside")}
    shown = [r for r in kind["single"] if r["before_deg"] >= 0.5]
    pairs, hidden = ([r for r in kind["double"] if both_show(r) is wanted] for wanted in (True, False))
    rows = [
        ("clean: a name where nothing is missing", share(kind["clean"], lambda r: bool(r["effects"]))),
        ("clean: 'unknown'", share(kind["clean"], lambda r: r["verdict"] == "unknown")),
        ("single: right, or in a set of at most three", share(kind["single"], is_named)),
        ("single, plain fit leaves 0.5° or more", share(shown, is_named)),
        ("single: another name only", share(kind["single"], lambda r: bool(r["effects"]) and not is_named(r))),
        ("double: both", share(kind["double"], is_named)),
        (
            "double: one of the two, no other name",
            share(kind["double"], lambda r: bool(r["effects"]) and set(r["effects"]) < set(r["truth"])),
        ),
        ("double, each shows by 0.2° or more: both", share(pairs, is_named)),
        ("double, one shows by less: both", share(hidden, is_named)),
        ("double, one shows by less: the one that shows", share(hidden, is_the_one_that_shows)),
        ("double: a wrong name", share(kind["double"], lambda r: not set(r["effects"]) <= set(r["truth"]))),
        ("outside: 'unknown'", share(kind["outside"], lambda r: r["verdict"] == "unknown")),
        ("outside: a wrong name", share(kind["outside"], lambda r: bool(r["effects"]))),
        (
            "outside, 'unknown': right first driver",
            share([r for r in kind["outside"] if r["verdict"] == "unknown"], right_driver),
        ),
    ]
    for name, group in kind.items():
        rows.append((f"{name}: held out before, ° rms, median", quartiles([r["before_deg"] for r in group])))
        rows.append((f"{name}: held out after", quartiles([r["after_deg"] for r in group])))
        rows.append((f"{name}: later record", quartiles([r["later_deg"] for r in group])))
        rows.append((f"{name}: its sigma, as predicted", quartiles([r["later_sigma_deg"] for r in group])))
        within = f"{np.mean([r['later_within'] for r in group]):.0%}" if group else "–"
        rows.append((f"{name}: samples within 1.96 of it", within))
    rows.append(("noise floor, °, median", quartiles([r["floor_deg"] for r in results])))
    covered = [hit for r in results if r["kind"] == "clean" or is_named(r) for hit in r["covered"].values()]
    rows.append(("95 % intervals that hold the rig's value", f"{np.mean(covered):.0%} of {len(covered)}"))
    rows.append(("processor time, s, median", quartiles([r["cpu_seconds"] for r in results])))
    rows.append(("wall time, s, median", quartiles([r["seconds"] for r in results])))
    return rows


def confusion(results: list[Result]) -> list[str]:
    """Return what was hidden and what came out, one line per hidden set."""
    table: dict[str, Counter[str]] = {}
    for result in results:
        answer = " or ".join("+".join(sorted(names)) for names in candidates_of(result)) or result["verdict"]
        table.setdefault("+".join(result["truth"]) or "nothing", Counter())[answer] += 1
    return [
        f"{hidden:45s} {', '.join(f'{answer} × {count}' for answer, count in found.most_common())}"
        for hidden, found in sorted(table.items())
    ]


def main() -> None:
    """Print the figures and the confusion matrix, all records and those with structured model error."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", metavar="RESULTS.jsonl")
    results = read(parser.parse_args().results)
    for title, chosen in (("All", results), ("With structured model error", [r for r in results if r["model_error"]])):
        print(f"{title}: {len(chosen)} records")
        for name, value in figures(chosen):
            print(f"  {name:48s} {value}")
    print("Hidden, and what came out")
    for line in confusion(results):
        print(f"  {line}")


if __name__ == "__main__":
    main()
