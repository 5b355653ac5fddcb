"""More of the table of bad inputs: units mixed up, columns twice, files of another kind, damaged models, odd names."""

from __future__ import annotations

from tests.cli.bad_inputs import (
    DISCOVER,
    FIT,
    JUNK,
    PREDICT,
    RUN,
    SIMULATE,
    SYNC,
    TRACK,
    Bad,
    column,
    fine,
    gone,
    kept_rows,
    replaced,
    written,
)
from tests.cli.damages import as_parquet, doubled, is_a_folder, model, scaled, turned

MORE: dict[str, Bad] = {
    "log in milliseconds": Bad(SIMULATE, scaled("temps.csv", 0, 1000.0), 3, "give times in seconds"),
    "log in days": Bad(SIMULATE, scaled("temps.csv", 0, 1.0 / 86400.0), 3, "give times in seconds"),
    "log stamped in milliseconds of the calendar": Bad(SIMULATE, scaled("temps.csv", 0, 1e3, 1e12), 3, "1e+11"),
    "log in picoseconds": Bad(SIMULATE, scaled("temps.csv", 0, 1e-12), 3, "too close together"),
    "log in Fahrenheit": Bad(SIMULATE, scaled("temps.csv", 1, 1.8, 32.0), 3, "not in °F or kelvin"),
    "log in °C under a header of kelvin": Bad(
        SIMULATE,
        replaced("temps.csv", "time_s,temp_a_c,temp_b_c", "Time (s),Temp A (K),Temp B (K)"),
        3,
        "column Temp A (K): is colder than any rig",
    ),
    "log in seconds under a header of hours": Bad(
        SIMULATE,
        replaced("temps.csv", "time_s,temp_a_c,temp_b_c", "Time (h),Temp A,Temp B"),
        3,
        "column Time (h): runs too slowly",
    ),
    "log with a column twice": Bad(SIMULATE, doubled("temps.csv", 1), 3, "two columns have one name"),
    "log that runs backwards": Bad(SIMULATE, turned("temps.csv"), 3, "row 3, column time_s: time does not increase"),
    "log that is a folder": Bad(SIMULATE, is_a_folder("temps.csv"), 3, "is a folder"),
    "log with infinite times": Bad(SIMULATE, column("temps.csv", 0, "inf"), 3, "row 2, column time_s"),
    "log with semicolons": Bad(SIMULATE, replaced("temps.csv", "time_s,temp_a_c", "time_s;temp_a_c"), 3, "time_s"),
    "log with one row": Bad(SIMULATE, kept_rows("temps.csv", 1), 3, "one row"),
    "log with a row that is too long": Bad(SIMULATE, column("temps.csv", 2, "23,23,23", row=5), 3, "too many fields"),
    "log with a quotation mark that stays open": Bad(SIMULATE, column("temps.csv", 1, '"23', row=5), 3, "temps.csv"),
    "log that is no Parquet": Bad(
        SIMULATE.replace("temps.csv", "temps.parquet"), written("temps.parquet", JUNK), 3, "write it again"
    ),
    "log that is Parquet cut off": Bad(
        SIMULATE.replace("temps.csv", "temps.parquet"), as_parquet("temps.csv", keep=0.6), 3, "write it again"
    ),
    "log with a name that is too long": Bad(SIMULATE.replace("temps.csv", "t" * 300), fine, 3, "too long"),
    "log over itself": Bad(SIMULATE.replace("sim.csv", "temps.csv"), fine, 2, "written over, and it is an input"),
    "a number that no float can hold": Bad(
        SIMULATE, replaced("actuator.toml", "60.0", "1" + "0" * 400), 2, "'E_A_gpa' is not a number"
    ),
    "angles of the actuator in radians": Bad(
        SIMULATE, replaced("actuator.toml", "theta_cr_deg = 180.0", "theta_cr_deg = 3.1416"), 2, "not radians"
    ),
    "a key twice": Bad(
        SIMULATE, replaced("actuator.toml", "A_s_c = 36.0", "A_s_c = 36.0\nA_s_c = 36.0"), 2, "not TOML"
    ),
    "actuator that is a folder": Bad(SIMULATE, is_a_folder("actuator.toml"), 3, "is a folder"),
    "an option that is not known": Bad(SIMULATE + " --startangle 3", fine, 2, "startangle"),
    "an option without its value": Bad(SIMULATE + " --start-angle", fine, 2, "--start-angle"),
    "sync: log in milliseconds": Bad(SYNC, scaled("temps.csv", 0, 1000.0), 3, "give times in seconds"),
    "sync: log in kelvin": Bad(SYNC, scaled("temps.csv", 1, 1.0, 273.15), 3, "not in kelvin"),
    "sync: log in Fahrenheit": Bad(SYNC, scaled("temps.csv", 1, 1.8, 32.0), 3, "not in °F or kelvin"),
    "sync: log with a column twice": Bad(SYNC, doubled("temps.csv", 1), 3, "two columns have one name"),
    "sync: angles without a number": Bad(SYNC, column("angle.csv", 2, "1e300"), 3, "no angle of a stick"),
    "sync: frames without end": Bad(SYNC, column("angle.csv", 0, "1e18", row=9), 3, "is no frame number"),
    "sync: angle that is a folder": Bad(SYNC, is_a_folder("angle.csv"), 3, "is a folder"),
    "sync: angle with a column twice": Bad(SYNC, doubled("angle.csv", 2), 3, "has this column twice"),
    "sync: light without times": Bad(SYNC + " --led-events {board.toml}", fine, 3, "is a board file"),
    "sync: light that is missing": Bad(SYNC + " --led-events {none.csv}", fine, 3, "no such file"),
    "track: frame times without end": Bad(
        TRACK + " --timestamps {angle.csv}", column("angle.csv", 0, "1e15", row=700), 3, "is no frame number"
    ),
    "track: frame times over the angles": Bad(
        "track {film.avi} --timestamps {angle.csv} --out {.}", fine, 2, "written over, and it is an input"
    ),
    "track: camera that is no TOML": Bad(TRACK + " --camera {film.avi}", fine, 3, "is not UTF-8"),
    "track: film cut within its header": Bad(TRACK, written("film.avi", b"RIFF\x00\x10\x00\x00AVI "), 3, "film.avi"),
    "run: film that is no text": Bad(RUN, replaced("experiment.toml", '"film.avi"', "3"), 2, "names no film"),
    "run: three films": Bad(RUN, replaced("experiment.toml", '"film.avi"', '["a", "b", "c"]'), 2, "left and right"),
    "run: a name with a zero byte": Bad(
        RUN, replaced("experiment.toml", '"temps.csv"', '"te\\u0000mps.csv"'), 2, "a character that no name has"
    ),
    "run: a name that is too long": Bad(RUN, replaced("experiment.toml", "temps.csv", "t" * 300), 3, "too long"),
    "run: experiment that is a folder": Bad(RUN, is_a_folder("experiment.toml"), 3, "holds no experiment.toml"),
    "run: output where a file stands": Bad("run {experiment.toml} --out {board.toml}", fine, 3, "cannot be written"),
    "run: provenance that is missing": Bad("run --from {none.json}", fine, 3, "no such file"),
    "run: provenance of an input that is gone": Bad(
        "run --from {provenance.json}",
        written("provenance.json", '{"schema": 1, "inputs": {"/none/film.avi": "9f"}, "configuration": {}}'),
        3,
        "/none/film.avi: no such file",
    ),
    "fit: record in milliseconds": Bad(FIT, scaled("merged.csv", 0, 1000.0), 3, "give times in seconds"),
    "fit: record in kelvin": Bad(FIT, scaled("merged.csv", 3, 1.0, 273.15), 3, "kelvin"),
    "fit: record with a column twice": Bad(FIT, doubled("merged.csv", 1), 3, "has this column twice"),
    "fit: record that runs backwards": Bad(FIT, turned("merged.csv"), 3, "time does not increase"),
    "fit: record that is Parquet cut off": Bad(
        FIT.replace("merged.csv", "merged.parquet"), as_parquet("merged.csv", keep=0.5), 3, "write it again"
    ),
    "fit: an effect that nobody knows": Bad(FIT + " --effect sensor_leg", fine, 2, "sensor_leg"),
    "discover: record with a column twice": Bad(DISCOVER, doubled("merged.csv", 3), 3, "has this column twice"),
    "predict: model with a value that is none": Bad(
        PREDICT, model(lambda content: content["values"].update(tau_c_mnm=float("nan"))), 3, "tau_c_mnm"
    ),
    "predict: model with a value beyond its bounds": Bad(
        PREDICT, model(lambda content: content["values"].update(tau_c_mnm=-1.0)), 3, "out of range"
    ),
    "predict: model without a value": Bad(
        PREDICT, model(lambda content: content.update(values={})), 3, "lacks a value"
    ),
    "predict: model with an unknown effect": Bad(
        PREDICT, model(lambda content: content.update(effects=["__import__"])), 3, "__import__"
    ),
    "predict: model with an unknown law": Bad(
        PREDICT, model(lambda content: content.update(phase_law="os.system")), 3, "liang_rogers"
    ),
    "predict: model with a law that is none": Bad(
        PREDICT, model(lambda content: content.update(laws=[{"id": "os.system"}])), 3, "os.system"
    ),
    "predict: model of an earlier version with a part that is not known any more": Bad(
        PREDICT, model(lambda content: content.update(closure={"angle_deg": [0.0, 1.0]})), 3, "unknown key 'closure'"
    ),
    "predict: model of half a cycle": Bad(
        PREDICT, model(lambda content: content["cycles"].update(a=0.5)), 3, "no whole number"
    ),
    "characterise: tests that are missing": Bad("characterise {none.toml} --out {out}", fine, 3, "no such file"),
    "characterise: another file": Bad("characterise {board.toml} --out {out}", fine, 2, "is a board file"),
    "board: output of another kind": Bad("board --out {board.xyz}", fine, 2, ".xyz"),
    "board: page that nobody prints": Bad("board --out {b.pdf} --page a99", fine, 2, "a99"),
    "batch: all experiments fail": Bad(
        "batch {experiment.toml} --out {out} --jobs 1", gone("temps.csv"), 4, "the only experiment failed"
    ),
    "init: files that are there": Bad("init {.}", fine, 2, "is there already"),
    "doctor: nothing of that name": Bad("doctor {none.toml}", fine, 3, "none.toml"),
    "live: actuator that is missing": Bad(
        "live {film.avi} --temperature {temps.csv} --actuator {none.toml} --out {out} --no-viewer",
        fine,
        3,
        "no such file",
    ),
    "live: film that is missing": Bad(
        "live {none.avi} --temperature {temps.csv} --out {out} --no-viewer", fine, 3, "none.avi"
    ),
}
