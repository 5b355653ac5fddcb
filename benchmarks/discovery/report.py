"""Print the blind suite's figures from the lines that run.py has written, and draw its probabilities' calibration.

Example: python benchmarks/discovery/report.py report.jsonl --diagram reliability.png
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
"""What shows less than two resolutions of a record is not expected to be named."""
LEAST_LEFT_DEG: Final = 0.5
"""An effect from which the plain fit leaves so much is expected to be named."""
_EDGES: Final = np.array([0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0])


def read(paths: Sequence[str]) -> list[Result]:
    """Return the results of all files; of a case that stands twice, the later one."""
    lines = [json.loads(line) for path in paths for line in Path(path).read_text().splitlines()]
    return list({result["name"]: result for result in lines}.values())


def sets_of(result: Result) -> list[set[str]]:
    """Return the sets of names that an answer holds possible, the named one first."""
    if not result["effects"] and not result["alternatives"]:
        return []
    return [set(result["effects"]), *(set(names) for names in result["alternatives"])]


def is_named(result: Result) -> bool:
    """Return whether the right set is the answer, or one of at most three."""
    sets = sets_of(result)
    return len(sets) <= 3 and set(result["truth"]) in sets


def has_wrong_name(result: Result) -> bool:
    """Return whether a name was given that is neither hidden nor a member of the hidden law's own family."""
    return not set(result["effects"]) <= {*result["truth"], *result.get("own_names", ())}


def is_placed(result: Result) -> bool:
    """Return whether a hidden law's place and variable are the answer's first, or among the sets of an ambiguous one.

    A name of the law's own family says as much. An answer without laws is judged by its first driver.
    """
    own, drivers = set(result["own_names"]), result["drivers_right"]
    for _, port, driver, *_ in result["laws"][:1]:
        if port in result["ports"] and driver in drivers:
            return True
    if result["verdict"] == "ambiguous":
        ids = {name for names in sets_of(result) for name in names}
        return bool(ids & own) or any(
            name.startswith(port) and name.endswith(driver)
            for name in ids
            for port in result["ports"]
            for driver in drivers
        )
    if result["effects"]:
        return result["effects"][0] in own
    return not result["laws"] and right_driver(result)


def right_driver(result: Result) -> bool:
    """Return whether the first driver is one of the right answers."""
    return bool(result["drivers"]) and result["drivers"][0][0] in result["drivers_right"]


def shows(result: Result, least_deg: float = LEAST_SHOWN_DEG) -> bool:
    """Return whether each hidden piece leaves something that nothing else imitates."""
    return all(size >= least_deg for size in result["shown_deg"].values())


def share(results: Sequence[Result], right: Callable[[Result], bool]) -> str:
    """Return 'k of n (p %)'."""
    if not results:
        return "none run"
    count = sum(right(result) for result in results)
    return f"{count} of {len(results)} ({100.0 * count / len(results):.0f} %)"


def spread(values: Sequence[float]) -> str:
    """Return median and 90 % quantile."""
    kept = np.array([value for value in values if np.isfinite(value)])
    return "–" if not len(kept) else f"{np.median(kept):.2f} (90 %: {np.quantile(kept, 0.9):.2f})"


def within(results: Sequence[Result], group: str) -> str:
    """Return the share of true angles inside the stated interval, the mean over records."""
    shares = [result["within"][group] for result in results if group in result["within"]]
    return "–" if not shares else f"{100.0 * np.mean(shares):.1f} % of {len(shares)} records"


def targets(results: list[Result]) -> list[tuple[str, str, str]]:
    """Return what is asked for: name, target and figure."""
    kind = {name: [r for r in results if r["kind"] == name] for name in ("clean", "law", "form", "pair")}
    effects = [r for r in results if r["kind"] in ("form", "single")]
    both = [r for r in results if r["kind"] in ("pair", "double")]
    left = [r for r in effects if r["before_deg"] >= LEAST_LEFT_DEG]
    answered = [*kind["clean"], *(r for r in results if r["effects"] and is_named(r))]
    late = [r for r in results if "sensor_lag" in r["truth"]]
    return [
        ("clean: a name", "≤ 1 %", share(kind["clean"], lambda r: bool(r["effects"]))),
        ("random law: no wrong name", "≥ 98 %", share(kind["law"], lambda r: not has_wrong_name(r))),
        ("random law: right place and variable, or among the sets", "≥ 85 %", share(kind["law"], is_placed)),
        ("  of those that show by 0.2°", "", share([r for r in kind["law"] if shows(r)], is_placed)),
        ("effect, plain fit leaves 0.5°: right, or in a set of three", "≥ 95 %", share(left, is_named)),
        ("  of all", "", share(effects, is_named)),
        ("  another name only", "", share(effects, lambda r: bool(r["effects"]) and not is_named(r))),
        ("pair, each shows by 0.2°: both", "≥ 90 %", share([r for r in both if shows(r)], is_named)),
        ("  of all", "", share(both, is_named)),
        ("  a wrong name", "", share(both, has_wrong_name)),
        ("later record, °, clean and named", "≤ 0.2", spread([r["later_deg"] for r in answered])),
        ("later record, °, random laws", "≤ 0.4", spread([r["later_deg"] for r in kind["law"]])),
        ("later record within 1°", "≥ 90 %", share(results, lambda r: r["later_deg"] <= 1.0)),
        ("true angle in the 95 % interval, in motion", "90–98 %", within(results, "motion")),
        ("  at rest", "90–98 %", within(results, "rest")),
        ("  at tops behind slow sensors", "90–98 %", within(late, "top")),
    ]


def figures(results: list[Result]) -> list[tuple[str, str]]:
    """Return further figures, kind by kind: name and value."""
    rows = []
    outside = [r for r in results if r["kind"] == "outside"]
    if outside:
        rows.append(("outside: 'unknown'", share(outside, lambda r: r["verdict"] == "unknown")))
        rows.append(("outside: a wrong name", share(outside, lambda r: bool(r["effects"]))))
        rows.append(("outside: right first driver", share(outside, right_driver)))
    for name in dict.fromkeys(r["kind"] for r in results):
        group = [r for r in results if r["kind"] == name]
        verdicts = Counter(r["verdict"] for r in group)
        rows.append((f"{name}: verdicts", ", ".join(f"{key} {count}" for key, count in verdicts.most_common())))
        rows.append((f"{name}: held out before, °, median", spread([r["before_deg"] for r in group])))
        rows.append((f"{name}: held out after", spread([r["after_deg"] for r in group])))
        rows.append((f"{name}: later record", spread([r["later_deg"] for r in group])))
        rows.append((f"{name}: its sigma, as predicted", spread([r["later_sigma_deg"] for r in group])))
    rows.append(("noise floor, °, median", spread([r["floor_deg"] for r in results])))
    covered = [hit for r in results if r["kind"] == "clean" or is_named(r) for hit in r["covered"].values()]
    rows.append(("95 % intervals that hold the rig's value", f"{np.mean(covered):.0%} of {len(covered)}"))
    zeros = [r["covered"]["zero_deg"] for r in results if "zero_deg" in r["covered"]]
    rows.append(("  of the sticks' zero", f"{np.mean(zeros):.0%} of {len(zeros)}" if zeros else "–"))
    rows.append(("wall time, s, median", spread([r["seconds"] for r in results])))
    rows.append(("processor time, s, median", spread([r["cpu_seconds"] for r in results])))
    return rows


def by_place(results: list[Result]) -> list[str]:
    """Return how random laws of each place came out."""
    rows = []
    for place in dict.fromkeys(tuple(r["law"]) for r in results if "law" in r):
        group = [r for r in results if tuple(r.get("law", ())) == place]
        after = spread([r["later_deg"] for r in group])
        rows.append(f"{' over '.join(place):30s} placed {share(group, is_placed):16s} later {after}")
    return rows


def answers(results: list[Result]) -> list[str]:
    """Return what was hidden and what came out, one line per hidden set."""
    table: dict[str, Counter[str]] = {}
    for result in results:
        laws = [f"{port}({driver})" for _, port, driver, *_ in result["laws"]]
        answer = " or ".join("+".join(sorted(names)) for names in sets_of(result)) or " ".join(
            [result["verdict"], *laws]
        )
        hidden = " over ".join(result["law"]) if "law" in result else "+".join(result["truth"]) or "nothing"
        table.setdefault(hidden, Counter())[answer] += 1
    return [
        f"{hidden:45s} {', '.join(f'{answer} × {count}' for answer, count in found.most_common())}"
        for hidden, found in sorted(table.items())
    ]


def stated(results: list[Result]) -> tuple[list[float], list[bool]]:
    """Return the probabilities of all names that were given, and whether each was right."""
    pairs = [
        (probability, name in {*result["truth"], *result.get("own_names", ())})
        for result in results
        for name, probability in result["probabilities"].items()
    ]
    return [probability for probability, _ in pairs], [right for _, right in pairs]


def reliability(probabilities: Sequence[float], right: Sequence[bool]) -> list[tuple[float, int, int]]:
    """Return for each bin of stated probabilities their mean, how many there are, and how many were right."""
    stated_, hits = np.asarray(probabilities, np.float64), np.asarray(right, bool)
    place = np.clip(np.searchsorted(_EDGES, stated_, side="right") - 1, 0, len(_EDGES) - 2)
    chosen = [place == k for k in range(len(_EDGES) - 1) if np.any(place == k)]
    return [(float(stated_[k].mean()), int(k.sum()), int(hits[k].sum())) for k in chosen]


def draw_reliability(results: list[Result], path: Path) -> None:
    """Draw how often names were right against how probable they were said to be, with 95 % intervals."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from scipy.stats import beta

    figure, axes = plt.subplots(figsize=(4.5, 4.5), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.7", lw=1)
    for probability, count, hits in reliability(*stated(results)):
        low, high = (float(beta.ppf(q, hits + 0.5, count - hits + 0.5)) for q in (0.025, 0.975))
        axes.plot([probability] * 2, [low, high], color="C0", lw=1.5)
        axes.plot(probability, hits / count, "o", color="C0")
        axes.annotate(f"{count}", (probability, hits / count), xytext=(6, -4), textcoords="offset points", fontsize=8)
    axes.set(
        xlabel="stated probability of a name", ylabel="share of names that were right", xlim=(0, 1.02), ylim=(0, 1.02)
    )
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Print targets, figures and answers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", metavar="RESULTS.jsonl")
    parser.add_argument("--diagram", type=Path, default=None, help="picture of how far stated probabilities hold")
    given = parser.parse_args()
    results = read(given.results)
    failed = [r for r in results if "failed" in r]
    results = [r for r in results if "failed" not in r]
    print(f"{len(results)} records, {len(failed)} failed {' '.join(r['name'] for r in failed)}")
    for name, target, value in targets(results):
        print(f"  {name:60s} {target:8s} {value}")
    for name, value in figures(results):
        print(f"  {name:60s} {value}")
    print("Random laws by place")
    print("".join(f"  {line}\n" for line in by_place(results)) + "Hidden, and what came out")
    print("".join(f"  {line}\n" for line in answers(results)), end="")
    for probability, count, hits in reliability(*stated(results)):
        print(f"  names stated at {probability:.3f}: {hits} of {count} right")
    if given.diagram is not None:
        draw_reliability(results, given.diagram)


if __name__ == "__main__":
    main()
