"""More of the table of bad inputs: odd films, files of another kind, numbers and settings that no one means."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from tests.cli.bad_inputs import (
    ACTUATOR,
    DISCOVER,
    EXPERIMENT,
    FIT,
    PREDICT,
    RUN,
    SIMULATE,
    SYNC,
    TRACK,
    Bad,
    Damage,
    column,
    fine,
    gone,
    replaced,
    written,
)
from tests.cli.damages import model


def coded(name: str, *sizes: tuple[int, int], frames: int = 12, keep: float = 1.0) -> Damage:
    """Write a film of grey pictures, one piece after the other for several sizes, whole or cut off."""

    def apply(folder: Path) -> None:
        import av

        whole = b""
        for width, height in sizes:
            with av.open(str(folder / name), "w") as film:
                stream = film.add_stream("mpeg4", rate=20)
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                for index in range(frames):
                    picture = np.full((height, width, 3), 120 + index % 2, np.uint8)
                    film.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
                film.mux(stream.encode(None))
            whole += (folder / name).read_bytes()
        (folder / name).write_bytes(whole[: int(keep * len(whole))])

    return apply


def sound_only(name: str) -> Damage:
    """Write a film that is none: sound alone."""

    def apply(folder: Path) -> None:
        import av

        with av.open(str(folder / name), "w") as film:
            stream = film.add_stream("pcm_s16le", rate=8000)
            sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
            sound.sample_rate = 8000
            film.mux(stream.encode(sound))
            film.mux(stream.encode(None))

    return apply


def pipe(name: str) -> Damage:
    """Put a pipe where a file should be: to read it would wait for ever."""

    def apply(folder: Path) -> None:
        (folder / name).unlink()
        os.mkfifo(folder / name)

    return apply


def points_to_itself(name: str) -> Damage:
    """Put a link to itself where a file should be."""

    def apply(folder: Path) -> None:
        (folder / name).unlink()
        (folder / name).symlink_to(name)

    return apply


def mixed(name: str) -> Damage:
    """Part every second row with semicolons."""

    def apply(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        lines[1::2] = [line.replace(",", ";") for line in lines[1::2]]
        (folder / name).write_text("\n".join(lines) + "\n")

    return apply


NINES = "9" * 5000
NO_LIGHT = EXPERIMENT + '[sync]\nled_events = "board.toml"\n'
POINTER = f"version https://git-lfs.github.com/spec/v1\noid sha256:{'5b' * 32}\nsize 104857\n"
MARKERS = "markers {film.avi} --out {m.toml}"
FILM = "track {film.mkv} --out {out}"

ODD: dict[str, Bad] = {
    "track: film without its index": Bad(
        "track {film.mp4} --out {out}", coded("film.mp4", (160, 120), keep=0.7), 3, "film.mp4"
    ),
    "track: sound alone": Bad("track {film.wav} --out {out}", sound_only("film.wav"), 3, "no video stream"),
    "track: a Git LFS pointer in the place of the film": Bad(TRACK, written("film.avi", POINTER), 3, "git lfs pull"),
    "a Git LFS pointer in the place of the log": Bad(SIMULATE, written("temps.csv", POINTER), 3, "git lfs pull"),
    "a Git LFS pointer in the place of the model": Bad(PREDICT, written("model.json", POINTER), 3, "git lfs pull"),
    "calibrate: a Git LFS pointer in the place of the film": Bad(
        "calibrate {film.avi} --board {board.toml} --out {out.toml}", written("film.avi", POINTER), 3, "git lfs pull"
    ),
    "track: an address": Bad(
        "track rtsp://127.0.0.1/film --out {out}", fine, 3, "rtsp://127.0.0.1/film: is an address, not a file"
    ),
    "track: Git LFS pointers in the place of pictures": Bad(
        "track {.} --out {out}", written("a.png", POINTER), 3, "Git LFS pointer"
    ),
    "markers: a Git LFS pointer in the place of the film": Bad(
        MARKERS, written("film.avi", POINTER), 3, "a text of 131 bytes"
    ),
    "markers: sound alone": Bad("markers {film.wav} --out {m.toml}", sound_only("film.wav"), 3, "no video stream"),
    "markers: no film": Bad(MARKERS, gone("film.avi"), 3, "film.avi"),
    "markers: a port that is none": Bad(f"{MARKERS} --port 65536", fine, 2, "--port"),
    "markers: a preview below a file": Bad(f"{MARKERS} --preview {{temps.csv/a.png}}", fine, 3, "cannot be written"),
    "markers: no film and a preview below a file": Bad(
        f"{MARKERS} --preview {{temps.csv/a.png}}", gone("film.avi"), 3, "cannot be written"
    ),
    "view: no recording and pictures below a file": Bad(
        "view {gone} --pictures {temps.csv/p}", fine, 3, "cannot be written"
    ),
    "markers: a preview of another kind": Bad(f"{MARKERS} --preview {{a.docx}}", fine, 2, "--preview"),
    "track: one frame": Bad(FILM, coded("film.mkv", (160, 120), frames=1), 4, "frames 0 to 0"),
    "track: a picture of two pixels": Bad(FILM, coded("film.mkv", (16, 2)), 4, "marker"),
    "track: the size changes": Bad(
        "track {film.ts} --out {out}", coded("film.ts", (160, 120), (320, 240)), 3, "changes its picture size"
    ),
    "track: a table in the place of the film": Bad("track {temps.csv} --out {out}", fine, 3, "temps.csv"),
    "track: a pipe in the place of the film": Bad(TRACK, pipe("film.avi"), 3, "film.avi"),
    "track: output below a file": Bad(TRACK.replace("{out}", "{temps.csv/out}"), fine, 3, "cannot be written"),
    "log that is a pipe": Bad(SIMULATE, pipe("temps.csv"), 3, "is no ordinary file"),
    "log that is a device": Bad(SIMULATE.replace("{temps.csv}", "/dev/zero"), fine, 3, "is no ordinary file"),
    "log in hexadecimal": Bad(SIMULATE, column("temps.csv", 1, "0x17"), 3, "'0x17'"),
    "log in UTF-16": Bad(
        SIMULATE, written("temps.csv", "time_s,temp_a_c,temp_b_c\n0,1,2\n".encode("utf-16")), 3, "has one row only"
    ),
    "log with mixed separators": Bad(SIMULATE, mixed("temps.csv"), 3, "temps.csv, column time_s, line 2"),
    "sync: log that is a pipe": Bad(SYNC, pipe("temps.csv"), 3, "is no ordinary file"),
    "sync: log that points to itself": Bad(SYNC, points_to_itself("temps.csv"), 3, "link that leads nowhere"),
    "sync: log that is compressed": Bad(
        SYNC, written("temps.csv", b"\x1f\x8b\x08" + bytes(200)), 3, "a compressed file"
    ),
    "sync: log that is a spreadsheet": Bad(SYNC, written("temps.csv", b"PK\x03\x04" + bytes(200)), 3, "is not text"),
    "sync: log with mixed separators": Bad(SYNC, mixed("temps.csv"), 3, "temps.csv, column time_s, line 2"),
    "sync: log of numbers beyond all measure": Bad(SYNC, column("temps.csv", 1, "1e308"), 3, "found 1e+308"),
    "sync: log in hexadecimal": Bad(SYNC, column("temps.csv", 1, "0x17"), 3, "no number"),
    "sync: log of a web page": Bad(SYNC, written("temps.csv", "<html>404</html>\n"), 3, "time_s"),
    "sync: offset that is none": Bad(SYNC + " --offset nan", fine, 2, "offset"),
    "sync: angle that is a pipe": Bad(SYNC, pipe("angle.csv"), 3, "is no ordinary file"),
    "actuator with a number of 5000 digits": Bad(SIMULATE, replaced("actuator.toml", "60.0", NINES), 2, "is not TOML"),
    "actuator of nested lists": Bad(SIMULATE, written("actuator.toml", "a=" + "[" * 5000 + "]" * 5000), 2, "not TOML"),
    "actuator with a date": Bad(
        SIMULATE, replaced("actuator.toml", "36.0", "2024-01-01"), 2, "'A_s_c' is not a number"
    ),
    "actuator with tables in a list": Bad(
        SIMULATE, written("actuator.toml", ACTUATOR.replace("[geometry]", "[[geometry]]")), 2, "is not a table"
    ),
    "actuator that is a device": Bad(SIMULATE.replace("{actuator.toml}", "/dev/zero"), fine, 3, "no ordinary file"),
    "start angle that is none": Bad(SIMULATE.replace("178", "nan"), fine, 2, "start angle"),
    "run: a setting of the clock that is no number": Bad(
        RUN,
        written("experiment.toml", EXPERIMENT + "[sync]\noffset_s = true\n"),
        2,
        "experiment.toml, [sync]: 'offset_s' is not",
    ),
    "run: a lamp at no place": Bad(
        RUN, written("experiment.toml", EXPERIMENT + "[sync]\nled = [nan, 3]\n"), 2, "no place in the picture"
    ),
    "run: a light without times": Bad(RUN, written("experiment.toml", NO_LIGHT), 3, "is a board file"),
    "run: a seed between two numbers": Bad(
        RUN, written("experiment.toml", EXPERIMENT + "[discover]\nseed = 1.5\n"), 2, "no whole number"
    ),
    "run: markers twice": Bad(
        RUN,
        written("experiment.toml", EXPERIMENT + '[markers]\nfile = "markers.toml"\nkind = "dot"\n'),
        2,
        "both a file and its content",
    ),
    "run: a film that is a pipe": Bad(RUN, pipe("film.avi"), 3, "film.avi"),
    "run: output is an input": Bad(
        "run {experiment.toml}",
        written("experiment.toml", EXPERIMENT + '[output]\ndir = "temps.csv"\n'),
        3,
        "cannot be written",
    ),
    "fit: a sheet with an infinite angle": Bad(FIT, column("merged.csv", 1, "1e300", row=5), 3, "angle_deg"),
    "predict: model cut off": Bad(PREDICT, written("model.json", '{"schema": 1, "kind": "tors'), 3, "is not JSON"),
    "predict: model of nested lists": Bad(PREDICT, written("model.json", "[" * 100_000), 3, "is not JSON"),
    "predict: model with a number of 5000 digits": Bad(PREDICT, written("model.json", NINES), 3, "is not JSON"),
    "predict: model that is a pipe": Bad(PREDICT, pipe("model.json"), 3, "is no ordinary file"),
    "predict: model with a list for a value": Bad(
        PREDICT, model(lambda content: content.update(values=[1.0] * 100_000)), 3, "'values' is not a table"
    ),
    "predict: model without its law": Bad(PREDICT, model(lambda content: content.pop("phase_law")), 3, "phase_law"),
    "batch: no process": Bad("batch {experiment.toml} --out {out} --jobs 0", fine, 2, "no number of processes"),
    "batch: a hundred thousand processes": Bad(
        "batch {experiment.toml} --out {out} --jobs 100000", fine, 2, "no number of processes"
    ),
    "batch: a scheduler of no address": Bad(
        "batch {experiment.toml} --out {out} --scheduler nonsense", gone("temps.csv"), 3, "no Dask scheduler answers"
    ),
    "calibrate: a table in the place of pictures": Bad(
        "calibrate {temps.csv} --board {board.toml} --out {c.toml}", fine, 3, "temps.csv"
    ),
    "run: an actuator file": Bad("run {actuator.toml}", fine, 2, "is an actuator file; allowed an experiment file; "),
    "track: a camera file as markers": Bad(TRACK + " --markers {camera.toml}", fine, 2, "allowed a marker file"),
    "track: a marker file as camera": Bad(
        TRACK + " --camera {markers.toml}", fine, 2, "is a marker file; allowed a camera"
    ),
    "fit: a table as actuator": Bad(
        FIT.replace("actuator.toml", "merged.csv"), fine, 2, "is a merged table; allowed an"
    ),
    "fit: an actuator file as table": Bad(FIT.replace("merged.csv", "camera.toml"), fine, 3, "is a camera file"),
    "sync: angle and log swapped": Bad(
        "sync --angle {temps.csv} --temperature {angle.csv} --out {out}",
        fine,
        3,
        "allowed a table of angles; 'torsight tr",
    ),
    "sync: angles as log": Bad(SYNC.replace("temps.csv", "angle.csv"), fine, 3, "allowed a temperature log"),
    "discover: angles alone": Bad(DISCOVER.replace("merged.csv", "angle.csv"), fine, 3, "'torsight sync' makes one"),
    "run: a folder without experiment": Bad("run {blank}", fine, 3, "holds no experiment.toml; 'torsight init"),
    "predict: a folder": Bad(PREDICT.replace("model.json", "blank"), fine, 3, "is a folder, not a file"),
    "start angle with a decimal comma": Bad(
        SIMULATE.replace("178", "177,6"), fine, 2, "found 177,6; write a decimal point"
    ),
    "actuator with a decimal comma": Bad(
        SIMULATE, replaced("actuator.toml", "36.0", "36,0"), 2, "found A_s_c = 36,0; wri"
    ),
    "simulate: a table of no kind": Bad(SIMULATE.replace("sim.csv", "sim.txt"), fine, 2, "--out: has another suffix"),
    "sync: a table of no kind": Bad(f"{SYNC} --table {{t.xlsx}}", fine, 2, "--table: has another suffix"),
    "fit: an effect spelt otherwise": Bad(f"{FIT} --effect sensorlag", fine, 2, "did you mean 'sensor_lag'?"),
    "fit: nothing like it there": Bad(FIT.replace("merged.csv", "nofile.csv"), fine, 3, "no such file; check the path"),
    "run: a film": Bad("run {film.avi}", fine, 3, "found a film; name the file that belongs here"),
    "sync: a film as angles": Bad(SYNC.replace("angle.csv", "film.avi"), fine, 3, "found a film; name the file"),
    "simulate: a film as log": Bad(SIMULATE.replace("temps.csv", "film.avi"), fine, 3, "found a film; name the file"),
    "predict: an actuator file as model": Bad(
        PREDICT.replace("model.json", "actuator.toml"), fine, 3, "an actuator file"
    ),
}
