"""Effect of halving and doubling each constant of the tracker, on films with hardships.

Run: python benchmarks/tracking/constants.py [--only WORD] [--films WORD ...] [--frames 200]

Every change is made in a copy of the sources, in a process of its own, since constants are compiled into the frame step
(a minute each). Columns, each summed or averaged over the films: frames with an angle, share; rms error over that of
the unchanged tracker; errors over their sigmas (rms); frames whose angle is given as right and is not, and marker
positions likewise (see hardships.py).
"""

from __future__ import annotations

import argparse
import ast
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("torsight", "tracker", "calibration", "sync", "benchmarks")
FILMS = (
    "shake 2 px",
    "camera bumped by 13 px",
    "hand over fast stick 1 s",
    "wire that stays in the way",
    "20 px per frame, smeared",
    "tilt 30, camera file",
    "moving stick below",
    "slow, H.264 CRF 30",
)
CONSTANTS = {
    "appearance/lucas_kanade": ("SHARP_PX", "RATE"),
    "appearance/motion_blur": ("CLEAR", "_SLACK_UNKNOWN", "_SLACK_KNOWN"),
    "follow/camera_state": ("SHAKE_PX", "TURN_RAD", "OFF_CIRCLE"),
    "follow/judgement": ("_LENGTH", "CLOSE", "NEAR"),
    "follow/learning": ("_CHANGE_PX",),
    "follow/motion_model": ("STALE", "JUMP"),
    "follow/reading": ("_DEVIATIONS", "_NEVER"),
    "follow/rotation_axis": ("STANDS_PX", "OFF_CIRCLE_PX"),
    "follow/redetect": ("_SLACK",),
}  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="constants whose name holds this")
    parser.add_argument("--films", nargs="*", default=FILMS)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        track_films(options.films, options.frames)
        return
    print(f"{'constant':44s} {'share':>6s} {'rms':>6s} {'pull':>6s} {'wrong':>6s} {'astray':>6s}")
    usual = measured("", "", 1.0, options)
    line("as it is", usual, usual)
    for module, names in CONSTANTS.items():
        for name in names:
            if options.only not in name:
                continue
            for factor in (0.5, 2.0):
                line(f"{module} {name} × {factor:g}", measured(module, name, factor, options), usual)


def measured(module: str, name: str, factor: float, options: argparse.Namespace) -> list[dict[str, float]]:
    """Return the figures of every film, tracked by a copy of the sources in which one constant is changed."""
    with tempfile.TemporaryDirectory() as folder:
        for package in PACKAGES:
            shutil.copytree(ROOT / package, Path(folder) / package, ignore=shutil.ignore_patterns("__pycache__"))
        if name:
            change(Path(folder) / "tracker" / f"{module}.py", name, factor)
        script = Path(folder) / "benchmarks" / "tracking" / Path(__file__).name
        command = [sys.executable, str(script), "--child", "--frames", str(options.frames), "--films", *options.films]
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder)
        return [json.loads(text) for text in done.stdout.splitlines()]


def change(path: Path, name: str, factor: float) -> None:
    """Multiply a constant in a source file; a whole number stays one."""
    text = path.read_text()
    for node in ast.parse(text).body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.target.id == name:
            value = ast.get_source_segment(text, node.value)
            whole = isinstance(node.value, ast.Constant) and isinstance(node.value.value, int)
            new = f"max(1, round({factor} * {value}))" if whole else f"{factor} * ({value})"
            path.write_text(text.replace(f"{name}: Final = {value}", f"{name}: Final = {new}", 1))
            return
    raise SystemExit(f"{path}: no constant {name}")


def track_films(names: list[str], frames: int) -> None:
    """Print the figures of films, a line of JSON each."""
    import numpy as np
    from hardships import films, run

    for film in films(5, frames):
        if film.name not in names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = run(film, Path(folder))
            except Exception:  # noqa: BLE001 - a film that fails has no angles
                print(json.dumps({"share": 0.0, "square": 0.0, "pull": 0.0, "wrong": 0, "astray": 0}))
                continue
        v = found.valid & (found.sigma_deg < 180.0)
        error, sigma = found.error_deg[v], found.sigma_deg[v]
        figures = {
            "share": float(found.valid.mean()),
            "square": float(np.mean(error**2)) if v.any() else 0.0,
            "pull": float(np.mean((error / sigma) ** 2)) if v.any() else 0.0,
            "wrong": int((np.abs(error) > np.maximum(1.0, 5.0 * sigma)).sum()),
            "astray": found.misplaced,
        }
        print(json.dumps(figures))


def line(title: str, found: list[dict[str, float]], usual: list[dict[str, float]]) -> None:
    """Print one row."""

    def mean(films: list[dict[str, float]], key: str) -> float:
        return sum(film[key] for film in films) / len(films)

    rms = (mean(found, "square") / mean(usual, "square")) ** 0.5
    wrong, astray = (int(sum(film[key] for film in found)) for key in ("wrong", "astray"))
    print(
        f"{title:44s} {mean(found, 'share'):6.3f} {rms:6.2f} {mean(found, 'pull') ** 0.5:6.2f} {wrong:6d} {astray:6d}",
        flush=True,
    )


if __name__ == "__main__":
    main()
