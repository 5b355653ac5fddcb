"""The experiment file: paths relative to it, unknown keys named, and back again from provenance."""

from __future__ import annotations

from pathlib import Path

import pytest

from torsight.cli.experiment_file import experiment_from, read_experiment
from torsight.core.errors import ConfigError, InputError

WHOLE = """
[video]
path = "film.mp4"
[camera]
file = "camera.toml"
[markers]
base = [[1, 2], [3, 4]]
moving = [[5, 6], [7, 8]]
[temperature]
path = "temps.csv"
[sync]
offset_s = 3.0
[actuator]
file = "actuator.toml"
[discover]
seed = 4
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("film.mp4", "right.mp4", "camera.toml", "temps.csv", "actuator.toml"):
        (tmp_path / name).write_bytes(name.encode())
    return tmp_path


def _write(folder: Path, text: str) -> Path:
    path = folder / "experiment.toml"
    path.write_text(text)
    return path


def test_paths_are_relative_to_the_file(folder: Path) -> None:
    experiment = read_experiment(_write(folder, WHOLE))
    assert experiment.video == str(folder / "film.mp4")
    assert experiment.output == folder / "results"
    assert experiment.seed == 4
    assert experiment.markers["moving"] == [[5, 6], [7, 8]]
    assert experiment.inputs()[0] == folder / "film.mp4"


def test_the_configuration_as_used_gives_the_same_experiment(folder: Path) -> None:
    experiment = read_experiment(_write(folder, WHOLE))
    again = experiment_from(experiment.to_configuration(folder), where="provenance.json", folder=folder)
    assert again == experiment


def test_names_and_units_of_the_logs_columns(folder: Path) -> None:
    columns = {"time": "Time", "a": "Temp A (°C)", "b": "Temp B (°C)"}
    said = 'path = "temps.csv"\ncolumns = { time = "Time", a = "Temp A (°C)", b = "Temp B (°C)" }\nunits.time = "ms"'
    experiment = read_experiment(_write(folder, WHOLE.replace('path = "temps.csv"', said)))
    assert experiment.columns == columns
    assert experiment.units == {"time": "ms"}
    assert experiment_from(experiment.to_configuration(folder), where="again", folder=folder) == experiment


def test_the_folder_of_an_experiment_stands_for_it(folder: Path) -> None:
    assert read_experiment(_write(folder, WHOLE).parent) == read_experiment(folder / "experiment.toml")
    (folder / "experiment.toml").unlink()
    with pytest.raises(InputError, match=r"holds no experiment\.toml; 'torsight init"):
        read_experiment(folder)


def test_a_stereo_pair(folder: Path) -> None:
    text = WHOLE.replace('path = "film.mp4"', 'path = ["film.mp4", "right.mp4"]')
    assert read_experiment(_write(folder, text)).video_right == str(folder / "right.mp4")


@pytest.mark.parametrize(
    ("old", "new", "kind", "words"),
    [
        ("[temperature]", "[tempratures]", ConfigError, "unknown key 'tempratures'.*did you mean 'temperature'"),
        ("offset_s", "ofset_s", ConfigError, r"\[sync\]: unknown key 'ofset_s'.*did you mean 'offset_s'"),
        ('path = "film.mp4"', "", ConfigError, r"\[video\]: 'path' names no film"),
        ('path = "film.mp4"', 'path = ["a", "b", "c"]', ConfigError, "a list of two for left and right"),
        (
            'path = "film.mp4"',
            'path = "flim.mp4"',
            InputError,
            r"did you mean film\.mp4.*experiment\.toml, \[video\] path",
        ),
        ('path = "film.mp4"', 'path = ""', ConfigError, r"\[video\]: 'path' names no film; found ''"),
        ('path = "temps.csv"', 'path = " "', ConfigError, r"\[temperature\]: 'path' is empty; found ' '"),
        ('path = "temps.csv"', "", ConfigError, r"\[temperature\]: names no file"),
        ('file = "actuator.toml"', "file = 3", ConfigError, "'file' is not a text"),
        ("seed = 4", "seed = -1", ConfigError, "'seed' is out of range; found -1"),
        ("[camera]\n", "[camera\n", ConfigError, "is not TOML"),
        (
            'path = "temps.csv"',
            'path = "temps.csv"\ncolumns = { tiem = "Time" }',
            ConfigError,
            r"\[temperature\], columns: unknown key 'tiem'.*did you mean 'time'",
        ),
        ("[discover]", "[discovery]", ConfigError, r"unknown key 'discovery'.*did you mean 'discover'\?"),
        (
            'path = "temps.csv"',
            'path = "temps.csv"\nunits = { a = "ms" }',
            ConfigError,
            r"\[temperature\]: unit of 'a' is not known; found 'ms'",
        ),
    ],
)
def test_what_is_wrong_is_named(folder: Path, old: str, new: str, kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        read_experiment(_write(folder, WHOLE.replace(old, new)))


def test_records_to_be_explained_together(folder: Path) -> None:
    earlier = folder / "earlier.csv"
    earlier.write_text("a record")
    named = read_experiment(_write(folder, WHOLE + 'together = ["earlier.csv"]\n'))
    assert named.together == (earlier,)
    assert earlier in named.inputs()
    again = experiment_from(named.to_configuration(folder), where="provenance.json", folder=folder)
    assert again.together == named.together
    campaign = read_experiment(_write(folder, WHOLE + "together = true\n"))
    assert campaign.together is True
    assert campaign.seed == 4


@pytest.mark.parametrize("value", ["3", "[]", '["missing.csv"]', '"earlier.csv"'])
def test_records_that_are_none_are_refused(folder: Path, value: str) -> None:
    with pytest.raises((ConfigError, InputError), match="together"):
        read_experiment(_write(folder, WHOLE + f"together = {value}\n"))
