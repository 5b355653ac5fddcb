"""Time for a VGA film of 9,000 frames: decoding its luma, tracking it, and tracking it in the usual ways.

Run: python benchmarks/tracking/speed.py [--frames 9000]

Every way runs in a process of its own; its start-up and end (the same command on the first 60 frames of the film, with
all imports and the pictures that it writes) stand apart, as wall and CPU time, and are taken off the rest. Sources are
parsed in the first run alone, as those of an installed package are before. The film is drawn by the tests' renderer,
one swing of the stick that is repeated, in H.264 at CRF 20.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
SHORT = 60
WAYS = {
    "decode luma (PyAV)": "decode",
    "torsight track, markers given": "ours",
    "torsight track, markers found": "found",
    "read, grey, full-frame pyramidal LK": "naive",
    "trackpy": "trackpy",
}
SOME = ("found", "trackpy")
"""Ways of which ten times as many frames as make the start-up are enough: what they cost more is known from others."""


def main() -> None:
    """Draw the film, run every way, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=9000)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--way", choices=sorted(WAYS.values()), help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--film", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.way:
        globals()[options.way](options.folder, options.film)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        draw(folder, options.frames)
        head = f"{'way':40s} {'wall µs/frame':>14s} {'× decode':>9s} {'CPU µs/frame':>13s} {'peak MiB':>9s}"
        print(f"{head} {'start s':>8s} {'CPU s':>6s}", flush=True)
        first = None
        for label, way in WAYS.items():
            if way == "trackpy" and importlib.util.find_spec("trackpy") is None:
                print(f"{label:40s} not installed")
                continue
            count, film = (10 * SHORT, "middle.mp4") if way in SOME else (options.frames, "long.mp4")
            runs = [cost(way, folder, film) for _ in range(options.repeat)]
            starts = [cost(way, folder, "short.mp4") for _ in range(options.repeat)]
            wall, cpu = (
                (min(run[i] for run in runs) - min(run[i] for run in starts)) / (count - SHORT) * 1e6 for i in range(2)
            )
            first = first or wall
            peak = max(run[2] for run in runs)
            start, start_cpu = (min(run[i] for run in starts) for i in range(2))
            print(
                f"{label:40s} {wall:14.0f} {wall / first:9.2f} {cpu:13.0f} {peak:9.0f} {start:8.2f} {start_cpu:6.2f}",
                flush=True,
            )


def draw(folder: Path, frames: int) -> None:
    """Write the film in three lengths, and its markers."""
    sys.path.insert(0, str(ROOT / "tests" / "tracker"))
    from films import Rig, write_film

    rig = Rig(
        lambda t: 60.0 + 233.0 * (np.cos(2.0 * np.pi * t / 16.0) - 1.0),
        size=(640, 480),
        base_px=(55.0, 135.0),
        moving_px=(50.0, 120.0),
        radius_px=6.0,
        half_width_px=9.0,
        hub_px=16.0,
        frames=480,
        noise=1.0,
    )
    write_film(rig, folder / "swing.mp4", codec="libx264", crf=20)
    (folder / "markers.toml").write_text(rig.markers_toml())
    for name, count in (("long", frames), ("middle", 10 * SHORT), ("short", SHORT)):
        repeat_film(folder / "swing.mp4", folder / f"{name}.mp4", count)


def repeat_film(source: Path, target: Path, count: int) -> None:
    """Copy the packets of a film over and over."""
    import av

    with av.open(str(source)) as one, av.open(str(target), "w") as other:
        stream = one.streams.video[0]
        copy = other.add_stream_from_template(stream)
        packets = [packet for packet in one.demux(stream) if packet.dts is not None]
        content = [(bytes(p), p.pts, p.dts, p.is_keyframe) for p in packets]
        step = round(1.0 / (stream.average_rate * stream.time_base))
        for number in range(count):
            turn, index = divmod(number, len(content))
            data, pts, dts, key = content[index]
            packet = av.Packet(data)
            packet.stream, packet.time_base = copy, stream.time_base
            packet.pts, packet.dts = pts + turn * len(content) * step, dts + turn * len(content) * step
            packet.is_keyframe = key
            other.mux(packet)


def cost(way: str, folder: Path, film: str) -> tuple[float, float, float]:
    """Return wall time, CPU time (s) and peak memory (MiB) of one way in a process of its own."""
    command = [sys.executable, __file__, "--way", way, "--folder", str(folder), "--film", film]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(command, check=True, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, cpu, float((folder / f"{way}.peak").read_text())


def decode(folder: Path, film: str) -> None:
    """Decode with the decoder's own choice of threads; the luma as a view."""
    import av

    with av.open(str(folder / film)) as container:
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        for frame in container.decode(stream):
            np.frombuffer(frame.planes[0], np.uint8)
    note_peak(folder, "decode")


def ours(folder: Path, film: str) -> None:
    """Track with given markers, and write the files."""
    track("ours", folder, film, "--markers", str(folder / "markers.toml"))


def found(folder: Path, film: str) -> None:
    """Find the markers, track, and write the files."""
    track("found", folder, film)


def track(way: str, folder: Path, film: str, *options: str) -> None:
    """Run the command, which ends the process with its exit code."""
    sys.path.insert(0, str(ROOT))
    from torsight.cli.main import main as command

    try:
        command(["track", str(folder / film), *options, "--out", str(folder / "out")])
    finally:
        note_peak(folder, way)


def naive(folder: Path, film: str) -> None:
    """Follow as tutorials do: read, grey, Lucas–Kanade from frame to frame on whole pictures."""
    import tomllib

    import cv2

    content = tomllib.loads((folder / "markers.toml").read_text())
    points = np.array([*content["base"], *content["moving"]], np.float32).reshape(-1, 1, 2)
    capture = cv2.VideoCapture(str(folder / film))
    last = None
    while True:
        good, picture = capture.read()
        if not good:
            break
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        if last is not None:
            points, _, _ = cv2.calcOpticalFlowPyrLK(last, grey, points, None, winSize=(21, 21), maxLevel=3)
        last = grey
    note_peak(folder, "naive")


def trackpy(folder: Path, film: str) -> None:
    """Locate dark dots in every picture and link them."""
    import av
    import trackpy as tp

    tp.quiet()
    found = []
    with av.open(str(folder / film)) as container:
        for number, frame in enumerate(container.decode(video=0)):
            table = tp.locate(frame.to_ndarray(format="gray"), diameter=13, invert=True, topn=6)
            found.append(table.assign(frame=number))
    import pandas as pd

    tp.link(pd.concat(found), search_range=15)
    note_peak(folder, "trackpy")


def note_peak(folder: Path, way: str) -> None:
    """Keep the peak memory of this process for the one that started it."""
    (folder / f"{way}.peak").write_text(str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0))


if __name__ == "__main__":
    main()
