"""Pictures of a recording, saved by the command and the function; and laws in the recording."""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_up_run import made_up_law, rewrite, write_made_up_run

from tests.command_line import leave
from torsight.core.errors import InputError, OutputError
from torsight.core.files.storage import write_table
from torsight.viewer import save_pictures, view_layout, write_recording
from torsight.viewer.screenshots import file_name

LAW = "Law: change of the friction torque (mN·m) against the angle"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a run with a law and its recording."""
    folder = tmp_path_factory.mktemp("with_law")
    write_made_up_run(folder, half_cycles=2, rate_hz=2.0)
    law = made_up_law()
    write_table(folder / law.csv_name, law.table())
    rewrite(folder, "discovery", laws=[law.to_json()])
    write_recording(folder)
    return folder


def test_a_law_is_in_the_recording_value_by_value_apart_where_the_record_was_not(run: Path) -> None:
    from rerun.chunk import RrdReader

    law, found = made_up_law(), {}
    for chunk in RrdReader(str(run / "recording.rrd")).stream():
        if str(chunk.entity_path).startswith("/laws/"):
            columns = chunk.to_record_batch().to_pydict()
            found[str(chunk.entity_path).split("/")[-1]] = [
                np.asarray(
                    next(values for name, values in columns.items() if name.endswith(part))[0][0]["buffer"], float
                )
                for part in ("abscissa", "values")
            ]
    assert set(found) == set(view_layout.LAW_COLOURS)
    for part, rows in (("reached", law.covered), ("not_reached", ~law.covered)):
        np.testing.assert_allclose(found[part][0], law.driver_values[rows])
        np.testing.assert_allclose(found[part][1], law.value[rows], rtol=1e-6)


def test_the_summary_of_the_recording_says_first_that_the_record_is_not_explained(run: Path) -> None:
    from torsight.core.files.results import read_results
    from torsight.viewer.run_words import summary_document

    text = summary_document(read_results(run))
    assert text.startswith("### This record is not explained: the residual is 7.33 times the noise floor")
    assert "lag of the sensor τ_T 4.020 s" in text
    assert made_up_law().sentence in text


@pytest.mark.graphics
def test_every_pane_is_saved_and_nothing_is_written_beside_the_recording(run: Path, tmp_path: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    try:
        made = save_pictures(run, str(tmp_path / "out"), time_s=50.0, size_px=(900, 700))
    except OutputError as error:
        pytest.skip(f"no graphics driver here: {error}")
    names = ["angle", "events", "film", file_name(LAW), "residual_measured_model", "summary", "temperature_c", "whole"]
    assert [path.name for path in made] == sorted(f"{name}.png" for name in names)
    pictures = {path.stem: cv2.imread(str(path)) for path in made}
    assert pictures["whole"] is not None
    assert pictures["whole"].shape == (700, 900, 3)
    # No notice, which would lie over a legend: each leaves an orange dot at the bell in the right half of the bar.
    blue, green, red = pictures["whole"][:36, 450:].astype(int).transpose(2, 0, 1)
    assert not ((red > 180) & (green < red - 60) & (blue < green - 30)).any()
    # Bars of both colours, BGR in OpenCV.
    bars = pictures[file_name(LAW)]
    assert bars is not None
    for colour in view_layout.LAW_COLOURS.values():
        near = np.linalg.norm(bars[..., ::-1].astype(float) - np.array(colour, float), axis=2) < 60.0
        assert near.mean() > 0.005
    assert {path: path.stat().st_mtime_ns for path in run.iterdir()} == before


def test_without_a_driver_the_command_says_what_to_install(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # What Vulkan's loader reads: without any driver's description there is none.
    monkeypatch.setenv("VK_ICD_FILENAMES", str(tmp_path / "none.json"))
    monkeypatch.setenv("VK_DRIVER_FILES", str(tmp_path / "none.json"))
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    code = leave("view", run, "--pictures", tmp_path / "out")
    assert not list((tmp_path / "temporary").iterdir())
    said = capsys.readouterr().err
    assert code == 3
    assert "the viewer cannot draw here" in said
    assert "mesa-vulkan-drivers" in said
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_recording_and_a_time_without_pictures_are_refused(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match=r"no such recording"):
        save_pictures(tmp_path, tmp_path / "out")
    assert leave("view", run, "--at", "3") == 2
    assert "--pictures" in capsys.readouterr().err
