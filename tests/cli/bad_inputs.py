"""The table of bad inputs: how each is made, the command that meets it, its exit code and words of its message.

``{x}`` in a command stands for the file of that name in the world; a damage changes one file of a world that is good.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

Damage = Callable[[Path], None]

ACTUATOR = """
[geometry]
wire_diameter_mm = 0.5
wire_length_mm = 64.1
[material]
E_A_gpa = 60.0
E_M_gpa = 20.0
E_S_gpa = 5.0
A_s_c = 36.0
A_f_c = 54.0
M_s_c = 42.0
M_f_c = 28.0
C_A_mpa_per_k = 32.0
C_M_mpa_per_k = 32.0
theta_cr_deg = 180.0
[assembly]
theta_p_deg = 1080.0
[friction]
tau_c_mnm = 0.8
[uncertainty]
E_A_gpa = 1.8
A_s_c = 0.4
"""
EXPERIMENT = """
[video]
path = "film.avi"
[temperature]
path = "temps.csv"
[actuator]
file = "actuator.toml"
"""
CAMERA = """
[intrinsics]
width = 160
height = 120
fx_px = 300
fy_px = 300
cx_px = 79.5
cy_px = 59.5
distortion = [0, 0, 0, 0, 0]
"""
FROM_LEFT = "[right.from_left]\nrvec = [0.0, 0.1, 0.0]\ntvec_mm = [-60.0, 0.0, 3.0]\n"
MARKERS = "base = [[100, 60], [130, 60]]\nmoving = [[80, 40], [80, 15]]\n"
BOARD = 'kind = "chessboard"\ncolumns = 9\nrows = 6\nsquare_mm = 25.0\n'


def make_world(folder: Path) -> None:
    """Fill a folder with one good input of every kind."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        "actuator.toml": ACTUATOR,
        "experiment.toml": EXPERIMENT,
        "camera.toml": CAMERA,
        "stereo.toml": CAMERA + CAMERA.replace("[intrinsics]", "[right.intrinsics]") + FROM_LEFT,
        "markers.toml": MARKERS,
        "board.toml": BOARD,
        "model.json": '{"schema": 1}',
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    _film(folder / "film.avi")
    blank = folder / "blank"
    blank.mkdir()
    for k in range(4):
        cv2.imwrite(str(blank / f"{k}.png"), np.full((120, 160), 128, np.uint8))
    time_s = np.arange(0.0, 400.0, 0.5)
    temp_a_c = np.interp(time_s, [0, 60, 200, 300, 400], [23, 23, 80, 24, 23])
    angle_deg = np.interp(temp_a_c, [45, 70], [178, -230])
    _csv(folder / "temps.csv", "time_s,temp_a_c,temp_b_c", time_s, temp_a_c, np.full_like(time_s, 23.0))
    _csv(
        folder / "merged.csv",
        "time_s,angle_deg,angle_sigma_deg,temp_a_c,temp_b_c",
        *(time_s, angle_deg, np.full_like(time_s, 0.05), temp_a_c, np.full_like(time_s, 23.0)),
    )
    frame = np.arange(len(time_s))
    sigma = np.full_like(time_s, 0.05)
    _csv(
        folder / "angle.csv",
        "frame,time_s,angle_deg,angle_sigma_deg,valid",
        frame,
        time_s,
        angle_deg,
        sigma,
        frame >= 0,
    )


def _csv(path: Path, header: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(columns), fmt="%.6g", delimiter=",", header=header, comments="")


def _film(path: Path) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20.0, (160, 120))
    for k in range(20):
        writer.write(np.full((120, 160, 3), 120 + k % 2, np.uint8))
    writer.release()


def replaced(name: str, old: str, new: str) -> Damage:
    """Change a piece of a text file that is there."""

    def apply(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text, f"{name} holds no {old!r}"
        (folder / name).write_text(text.replace(old, new, 1))

    return apply


def written(name: str, content: str | bytes) -> Damage:
    """Put another content into a file."""

    def apply(folder: Path) -> None:
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())

    return apply


def gone(name: str) -> Damage:
    """Remove a file."""
    return lambda folder: (folder / name).unlink()


def column(name: str, index: int, value: str, row: int | None = None) -> Damage:
    """Put a value into one field of a table, or into a whole column."""

    def apply(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        for number, line in enumerate(lines):
            if number > 0 and row in (None, number):
                fields = line.split(",")
                fields[index] = value
                lines[number] = ",".join(fields)
        (folder / name).write_text("\n".join(lines) + "\n")

    return apply


def kept_rows(name: str, count: int) -> Damage:
    """Keep the header and the first rows of a table."""

    def apply(folder: Path) -> None:
        lines = (folder / name).read_text().splitlines()
        (folder / name).write_text("\n".join(lines[: count + 1]) + "\n")

    return apply


def fine(_folder: Path) -> None:
    """Change nothing: the command itself asks for what cannot be."""


def _keep_only_text(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_file() and path.suffix not in {".toml", ".csv"}:
            path.unlink()


@dataclass(frozen=True, slots=True)
class Bad:
    """One bad input and what must come of it."""

    command: str
    damage: Damage
    code: int
    words: str


TRACK = "track {film.avi} --out {out}"
SYNC = "sync --angle {angle.csv} --temperature {temps.csv} --out {out}"
SIMULATE = "simulate {actuator.toml} {temps.csv} --start-angle 178 --out {sim.csv}"
FIT = "fit {merged.csv} --actuator {actuator.toml} --out {out}"
DISCOVER = "discover {merged.csv} --actuator {actuator.toml} --out {out}"
PREDICT = "predict {model.json} {temps.csv} --start-angle 178 --out {sim.csv}"
CALIBRATE = "calibrate {blank} --board {board.toml} --out {cam.toml}"
RUN = "run {experiment.toml} --out {out}"
JUNK = bytes(range(256)) * 8

ACTUATOR_KEYS = (
    "wire_diameter_mm = 0.5",
    "E_A_gpa = 60.0",
    "E_M_gpa = 20.0",
    "E_S_gpa = 5.0",
    "A_s_c = 36.0",
    "A_f_c = 54.0",
    "M_s_c = 42.0",
    "M_f_c = 28.0",
    "C_A_mpa_per_k = 32.0",
    "C_M_mpa_per_k = 32.0",
    "theta_cr_deg = 180.0",
    "theta_p_deg = 1080.0",
    "tau_c_mnm = 0.8",
)

BAD: dict[str, Bad] = {
    **{
        f"actuator without {line.split()[0]}": Bad(SIMULATE, replaced("actuator.toml", line, ""), 2, line.split()[0])
        for line in ACTUATOR_KEYS
    },
    **{
        f"{line.split()[0]} is a text": Bad(
            SIMULATE, replaced("actuator.toml", line, f'{line.split()[0]} = "much"'), 2, "is not a number"
        )
        for line in ACTUATOR_KEYS
    },
    **{
        f"{line.split()[0]} is negative": Bad(
            SIMULATE, replaced("actuator.toml", line, f"{line.split()[0]} = -3000.0"), 2, line.split()[0]
        )
        for line in ACTUATOR_KEYS
    },
    "moduli in Pa": Bad(SIMULATE, replaced("actuator.toml", "E_A_gpa = 60.0", "E_A_gpa = 60e9"), 2, "E_A_gpa"),
    "temperatures in kelvin": Bad(SIMULATE, replaced("actuator.toml", "A_f_c = 54.0", "A_f_c = 327.15"), 2, "A_f_c"),
    "A_f below A_s": Bad(SIMULATE, replaced("actuator.toml", "A_f_c = 54.0", "A_f_c = 30.0"), 2, "A_f_c"),
    "M_s below M_f": Bad(SIMULATE, replaced("actuator.toml", "M_s_c = 42.0", "M_s_c = 20.0"), 2, "M_s_c"),
    "martensite stiffer than austenite": Bad(
        SIMULATE, replaced("actuator.toml", "E_M_gpa = 20.0", "E_M_gpa = 90.0"), 2, "E_M_gpa"
    ),
    "actuator with an unknown key": Bad(
        SIMULATE, replaced("actuator.toml", "A_s_c = 36.0", "A_s_c = 36.0\nA_start_c = 3"), 2, "unknown key 'A_start_c'"
    ),
    "actuator with an unknown table": Bad(
        SIMULATE, replaced("actuator.toml", "[friction]", "[frictoin]"), 2, "did you mean 'friction'"
    ),
    "uncertainty of an unknown key": Bad(
        SIMULATE, replaced("actuator.toml", "E_A_gpa = 1.8", "E_A = 1.8"), 2, "did you mean 'E_A_gpa'"
    ),
    "uncertainty that is negative": Bad(
        SIMULATE, replaced("actuator.toml", "E_A_gpa = 1.8", "E_A_gpa = -1.8"), 2, "E_A_gpa"
    ),
    "actuator that is no TOML": Bad(SIMULATE, written("actuator.toml", "[geometry\n"), 2, "is not TOML"),
    "actuator that is no text": Bad(SIMULATE, written("actuator.toml", JUNK), 3, "is not UTF-8"),
    "actuator that is missing": Bad(SIMULATE, gone("actuator.toml"), 3, "no such file"),
    "actuator that is empty": Bad(SIMULATE, written("actuator.toml", ""), 2, "geometry"),
    "start angle that is no number": Bad(SIMULATE.replace("178", "home"), fine, 2, "--start-angle"),
    "start angle beyond the springs": Bad(SIMULATE.replace("178", "99999"), fine, 2, "start"),
    "log that is missing": Bad(SIMULATE, gone("temps.csv"), 3, "no such file"),
    "log that is empty": Bad(SIMULATE, written("temps.csv", ""), 3, "temps.csv"),
    "log with only a header": Bad(SIMULATE, kept_rows("temps.csv", 0), 3, "temps.csv"),
    "log that is no text": Bad(SIMULATE, written("temps.csv", JUNK), 3, "temps.csv"),
    "log without temp_b_c": Bad(SIMULATE, replaced("temps.csv", "temp_b_c", "room_c"), 3, "temp_b_c"),
    "log without time_s": Bad(SIMULATE, replaced("temps.csv", "time_s", "row"), 3, "time_s"),
    "log with a word in a field": Bad(SIMULATE, column("temps.csv", 1, "hot", row=7), 3, "'hot'"),
    "log in kelvin": Bad(SIMULATE, column("temps.csv", 1, "296.15"), 3, "temp_a_c"),
    "sync: log without temp_a_c": Bad(SYNC, replaced("temps.csv", "temp_a_c", "t1"), 3, "temp_a_c"),
    "sync: log that is missing": Bad(SYNC, gone("temps.csv"), 3, "no such file"),
    "sync: log that is no text": Bad(SYNC, written("temps.csv", JUNK), 3, "temps.csv"),
    "sync: log that is empty": Bad(SYNC, written("temps.csv", ""), 3, "temps.csv"),
    "sync: angle that is missing": Bad(SYNC, gone("angle.csv"), 3, "no such file"),
    "sync: angle without sigma": Bad(SYNC, replaced("angle.csv", "angle_sigma_deg", "sd"), 3, "angle_sigma_deg"),
    "sync: angle without valid": Bad(SYNC, replaced("angle.csv", ",valid", ",ok"), 3, "valid"),
    "sync: angle time goes back": Bad(SYNC, column("angle.csv", 1, "0.1", row=50), 3, "row 51, column time_s"),
    "sync: angle nowhere valid": Bad(SYNC, column("angle.csv", 4, "0"), 4, "angle"),
    "sync: nothing moves": Bad(SYNC, column("angle.csv", 2, "178"), 4, "mo"),
    "sync: nothing is heated": Bad(SYNC, column("temps.csv", 1, "23"), 4, "temp"),
    "sync: offset that is no number": Bad(SYNC + " --offset soon", fine, 2, "--offset"),
    "sync: gap that is negative": Bad(SYNC + " --max-gap -1", fine, 2, "gap"),
    "sync: given offset without overlap": Bad(SYNC + " --offset 90000", fine, 3, "overlap"),
    "track: film that is missing": Bad(TRACK, gone("film.avi"), 3, "film.avi"),
    "track: film whose name is empty": Bad("track '' --out {out}", fine, 2, "names no film"),
    "track: table of times that ends too early": Bad(
        TRACK + " --timestamps {times.csv}", written("times.csv", "frame,time_s\n0,0\n"), 3, "table of timestamps for"
    ),
    "track: film that is empty": Bad(TRACK, written("film.avi", ""), 3, "film.avi"),
    "track: film that is a text": Bad(TRACK, written("film.avi", "no film\n" * 99), 3, "film.avi"),
    "track: film without markers": Bad(TRACK, fine, 4, "marker"),
    "track: folder without pictures": Bad("track {.} --out {out}", _keep_only_text, 3, "picture"),
    "track: glob without pictures": Bad("track {none*.png} --out {out}", fine, 3, "none"),
    "track: pictures without a rate that fits": Bad("track {blank} --fps 0 --out {out}", fine, 2, "fps"),
    "track: pictures without markers": Bad("track {blank} --fps 10 --out {out}", fine, 4, "marker"),
    "track: camera that is missing": Bad(TRACK + " --camera {none.toml}", fine, 3, "no such file"),
    "track: camera for another size": Bad(
        TRACK + " --camera {camera.toml}", replaced("camera.toml", "width = 160", "width = 640"), 2, "640"
    ),
    "track: camera without fx": Bad(
        TRACK + " --camera {camera.toml}", replaced("camera.toml", "fx_px = 300", ""), 2, "fx_px"
    ),
    "track: camera with an unknown key": Bad(
        TRACK + " --camera {camera.toml}", replaced("camera.toml", "fx_px", "focal_px"), 2, "unknown key 'focal_px'"
    ),
    "track: camera with four distortions": Bad(
        TRACK + " --camera {camera.toml}",
        replaced("camera.toml", "[0, 0, 0, 0, 0]", "[0, 0, 0, 0]"),
        2,
        "5 numbers",
    ),
    "track: markers that are missing": Bad(TRACK + " --markers {none.toml}", fine, 3, "no such file"),
    "track: markers outside the picture": Bad(
        TRACK + " --markers {markers.toml}", replaced("markers.toml", "[130, 60]", "[1300, 60]"), 2, "outside"
    ),
    "track: one marker too few": Bad(
        TRACK + " --markers {markers.toml}", replaced("markers.toml", ", [130, 60]]", "]"), 2, "base"
    ),
    "track: markers without the moving stick": Bad(
        TRACK + " --markers {markers.toml}", replaced("markers.toml", "moving", "mowing"), 2, "did you mean 'moving'"
    ),
    "track: markers that are words": Bad(
        TRACK + " --markers {markers.toml}", replaced("markers.toml", "[100, 60]", '["left", 60]'), 2, "base"
    ),
    "track: markers where no dot is": Bad(TRACK + " --markers {markers.toml}", fine, 4, "dot"),
    "track: unknown kind of marker": Bad(
        TRACK + " --markers {markers.toml}",
        replaced("markers.toml", "base", 'kind = "square"\nbase'),
        2,
        "dot, texture",
    ),
    "track: frame times that are missing": Bad(TRACK + " --timestamps {none.csv}", fine, 3, "no such file"),
    "track: frame times without time_s": Bad(
        TRACK + " --timestamps {angle.csv}", replaced("angle.csv", "time_s", "t"), 3, "time_s"
    ),
    "track: frame times that go back": Bad(
        TRACK + " --timestamps {angle.csv}", column("angle.csv", 1, "0.1", row=9), 3, "time_s"
    ),
    "track: stereo without a camera": Bad("track {film.avi} {film.avi} --out {out}", fine, 2, "camera"),
    "run: experiment that is missing": Bad(RUN, gone("experiment.toml"), 3, "no such file"),
    "run: experiment that is no TOML": Bad(RUN, written("experiment.toml", "video ="), 2, "is not TOML"),
    "run: unknown table": Bad(RUN, replaced("experiment.toml", "[video]", "[vdeo]"), 2, "did you mean 'video'"),
    "run: unknown key": Bad(RUN, replaced("experiment.toml", "path", "pth"), 2, "did you mean 'path'"),
    "run: no temperature": Bad(RUN, replaced("experiment.toml", "[temperature]\npath", "[sync]\n#"), 2, "temperature"),
    "run: film that is missing": Bad(RUN, gone("film.avi"), 3, "film.avi"),
    "run: log without a column": Bad(RUN, replaced("temps.csv", "temp_a_c", "t1"), 3, "temp_a_c"),
    "run: actuator with an unknown key": Bad(RUN, replaced("actuator.toml", "A_s_c", "A_s"), 2, "unknown key 'A_s'"),
    "run: neither experiment nor provenance": Bad("run --out {out}", fine, 2, "EXPERIMENT.toml"),
    "run: provenance of something else": Bad("run --from {model.json}", fine, 3, "provenance"),
    "fit: table that is missing": Bad(FIT, gone("merged.csv"), 3, "no such file"),
    "fit: table that is no text": Bad(FIT, written("merged.csv", JUNK), 3, "merged.csv"),
    "fit: table without angle": Bad(FIT, replaced("merged.csv", "angle_deg", "phi"), 3, "angle_deg"),
    "fit: time goes back": Bad(FIT, column("merged.csv", 0, "1", row=9), 3, "row 10, column time_s"),
    "fit: nothing moves": Bad(FIT, column("merged.csv", 1, "178"), 4, "mo"),
    "fit: nothing is heated": Bad(FIT, column("merged.csv", 3, "23"), 4, "heat"),
    "fit: no angle is known": Bad(FIT, column("merged.csv", 1, ""), 3, "angle"),
    "fit: no temperature is known": Bad(FIT, column("merged.csv", 3, ""), 3, "temp_a_c"),
    "fit: two rows": Bad(FIT, kept_rows("merged.csv", 2), 3, "row"),
    "fit: actuator that is missing": Bad(FIT, gone("actuator.toml"), 3, "no such file"),
    "discover: table that is missing": Bad(DISCOVER, gone("merged.csv"), 3, "no such file"),
    "discover: nothing is heated": Bad(DISCOVER, column("merged.csv", 3, "23"), 4, "heat"),
    "discover: nothing moves": Bad(DISCOVER, column("merged.csv", 1, "178"), 4, "mo"),
    "discover: a seed below zero": Bad(DISCOVER + " --seed -1", fine, 2, "seed"),
    "discover: moduli out of order": Bad(
        DISCOVER, replaced("actuator.toml", "E_S_gpa = 5.0", "E_S_gpa = 50.0"), 2, "E_S_gpa"
    ),
    "predict: model that is missing": Bad(PREDICT, gone("model.json"), 3, "no such file"),
    "predict: model that is no JSON": Bad(PREDICT, written("model.json", "{"), 3, "is not JSON"),
    "predict: model that is a list": Bad(PREDICT, written("model.json", "[1]"), 3, "object"),
    "predict: model of another schema": Bad(PREDICT, written("model.json", '{"schema": 9}'), 3, "schema"),
    "predict: model without content": Bad(PREDICT, fine, 3, "model.json"),
    "predict: model that is no text": Bad(PREDICT, written("model.json", JUNK), 3, "UTF-8"),
    "calibrate: no board in any picture": Bad(CALIBRATE, fine, 4, "board"),
    "calibrate: pictures that are missing": Bad(CALIBRATE.replace("blank", "none"), fine, 3, "none"),
    "calibrate: board that is missing": Bad(CALIBRATE, gone("board.toml"), 3, "no such file"),
    "calibrate: board with an unknown key": Bad(
        CALIBRATE, replaced("board.toml", "square_mm", "squares_mm"), 2, "did you mean 'square_mm'"
    ),
    "calibrate: board of no size": Bad(CALIBRATE, replaced("board.toml", "25.0", "0.0"), 2, "square_mm"),
    "calibrate: unknown kind of board": Bad(CALIBRATE, replaced("board.toml", "chessboard", "go"), 2, "kind"),
    "view: folder that is missing": Bad("view {none}", fine, 3, "none"),
    "view: folder without a recording": Bad("view {blank}", fine, 3, "recording.rrd"),
    "batch: nothing there": Bad("batch {none*} --out {out}", fine, 3, "no experiment"),
    "batch: folder without experiments": Bad("batch {blank} --out {out}", fine, 3, "no experiment"),
    "render: scene that is missing": Bad("render {none.toml} --out {out}", fine, 3, "no such file"),
    "render: scene with an unknown table": Bad(
        "render {board.toml} --out {out}", written("board.toml", "[fim]\nfps = 3"), 2, "did you mean 'film'"
    ),
    "output where a file stands": Bad(SYNC.replace("{out}", "{temps.csv}"), fine, 3, "cannot be written"),
}
