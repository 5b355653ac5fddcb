"""The recording: read back as data, and drawn without a screen."""

from __future__ import annotations

import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from grey_film import write_grey
from made_up_run import SIZE_PX, write_made_up_run

from torsight.core.errors import InputError, OutputError
from torsight.core.tracks import MARKERS
from torsight.viewer import view_layout, write_recording
from torsight.viewer.film_preview import write_preview
from torsight.viewer.overlay import ARC_COLOUR, BASE_COLOUR, MOVING_COLOUR
from torsight.viewer.screenshots import WHOLE, take_pictures


def film_of(markers: pd.DataFrame, path: Path) -> Path:
    """Write a lossless film with the four markers as dark dots on grey."""

    def pictures() -> Iterator[np.ndarray]:
        for row in markers.to_dict("records"):
            picture = np.full((SIZE_PX[1], SIZE_PX[0]), 150, np.uint8)
            for name in MARKERS:
                if row[f"{name}_valid"]:
                    place = (round(row[f"{name}_x_px"]), round(row[f"{name}_y_px"]))
                    cv2.circle(picture, place, 6, 20, -1, cv2.LINE_AA)
            yield picture

    return write_grey(path, pictures(), fps=10.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made_up")
    write_made_up_run(folder, half_cycles=2, rate_hz=2.0)
    film_of(pd.read_csv(folder / "markers.csv"), folder / "film.mkv")
    write_recording(folder, film=folder / "film.mkv")
    return folder


def read_back(path: Path) -> dict[str, dict[str, list[object]]]:
    """Every entity's columns, chunks one after the other."""
    from rerun.chunk import RrdReader

    found: dict[str, dict[str, list[object]]] = defaultdict(lambda: defaultdict(list))
    for chunk in RrdReader(str(path)).stream():
        for name, values in chunk.to_record_batch().to_pydict().items():
            found[str(chunk.entity_path)][name] += values
    return found


def test_every_curve_is_in_the_recording_sample_by_sample(run: Path) -> None:
    found = read_back(run / "recording.rrd")
    table = pd.read_csv(run / "curves.csv")
    for entity, column in (
        ("/angle/measured", "angle_deg"),
        ("/angle/plain", "plain_deg"),
        ("/angle/extended", "extended_deg"),
        ("/residual/before", "residual_before_deg"),
        ("/residual/after", "residual_after_deg"),
        ("/temperature/a", "temp_a_c"),
        ("/temperature/b", "temp_b_c"),
    ):
        values = [row[0] for row in found[entity]["Scalars:scalars"] if row]
        np.testing.assert_allclose(values, table[column])
        seen = [time.total_seconds() for time in found[entity][view_layout.TIME] if time is not None]
        np.testing.assert_allclose(seen, table["time_s"], atol=1e-6)


def test_film_markers_and_sticks_are_in_the_recording_frame_by_frame(run: Path) -> None:
    found = read_back(run / "recording.rrd")
    markers = pd.read_csv(run / "markers.csv")
    positions = [row for row in found["/film/markers"]["Points2D:positions"] if row]
    assert len(positions) == len(markers)
    whole = [name for name in MARKERS if markers[f"{name}_valid"][10]]
    expected = [[markers[f"{name}_x_px"][10], markers[f"{name}_y_px"][10]] for name in whole]
    np.testing.assert_allclose(positions[10], expected, rtol=1e-5)
    frames = [frame for frame in found["/film/picture"][view_layout.FRAME] if frame is not None]
    assert frames == list(range(len(markers)))
    assert any(found["/film/picture"]["AssetVideo:blob"])


def test_events_and_summary_tell_the_run(run: Path) -> None:
    found = read_back(run / "recording.rrd")
    texts = " | ".join(row[0] for row in found["/events"]["TextLog:text"])
    for words in (
        "moving_outer is covered",
        "moving_outer is found again",
        "offset 12.31 s",
        "The model lacks an effect",
    ):
        assert words in texts
    summary = next(row[0] for row in found["/summary"]["TextDocument:text"] if row)
    assert "0.793 mN·m (95 %: 0.771 to 0.815)" in summary


def test_the_arrangement_of_the_panes_is_in_the_file(run: Path) -> None:
    from rerun.chunk import RrdReader

    assert len(RrdReader(str(run / "recording.rrd")).blueprints()) == 1


def test_without_a_film_or_later_results_the_rest_is_shown(tmp_path: Path) -> None:
    write_made_up_run(tmp_path, half_cycles=1, rate_hz=2.0)
    for name in ("curves.csv", "merged.csv", "fit.json", "discovery.json", "sync.json"):
        (tmp_path / name).unlink()
    found = read_back(write_recording(tmp_path))
    assert "/film/markers" in found
    assert "/angle/measured" in found
    assert "Scalars:scalars" not in found["/angle/plain"]
    assert not found["/film/picture"]


def test_a_film_that_cannot_be_read_is_named_and_leaves_no_recording(tmp_path: Path) -> None:
    write_made_up_run(tmp_path, half_cycles=1, rate_hz=2.0)
    (tmp_path / "film.mp4").write_bytes(b"no film" * 50)
    with pytest.raises(InputError, match=r"film\.mp4"):
        write_recording(tmp_path, film=tmp_path / "film.mp4")
    assert not (tmp_path / "recording.rrd").exists()


def test_the_preview_holds_the_films_pictures_in_order(tmp_path: Path) -> None:
    import av

    folder = tmp_path / "pictures"
    folder.mkdir()
    levels = [30, 90, 150, 210]
    for index, level in enumerate(levels):
        cv2.imwrite(str(folder / f"{index:03d}.png"), np.full((301, 1203), level, np.uint8))
    preview = write_preview(folder, tmp_path / "preview.mp4", frame_count=len(levels))
    assert preview.frame.tolist() == [0, 1, 2, 3]
    assert preview.size_px == (640, 160)
    assert preview.scale == pytest.approx(640 / 1203)
    with av.open(str(preview.path)) as container:
        seen = [frame.to_ndarray(format="gray").mean() for frame in container.decode(video=0)]
    # An encoder at this quality keeps flat pictures to a few grey levels.
    np.testing.assert_allclose(seen, levels, atol=4.0)


def test_the_viewers_settings_do_not_make_this_process_import_it_early() -> None:

    code = "import sys, torsight.viewer, torsight.viewer.view_layout; sys.exit('rerun' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == 0


# ----------------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def panes(run: Path) -> dict[str, np.ndarray]:
    """Pictures of the panes with the cursor in the middle of a stroke."""
    try:
        pictures = take_pictures(run / "recording.rrd", time_s=46.0)
    except OutputError as error:
        pytest.skip(f"no graphics driver here: {error}")
    return {
        name: cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
        for name, png in pictures.items()
    }


def share_of(picture: np.ndarray, colour: tuple[int, int, int], *, within: float = 60.0) -> float:
    """Share of the picture's pixels whose colour is near the given one."""
    distance = np.linalg.norm(picture.astype(float) - np.array(colour, float), axis=2)
    return float((distance < within).mean())


def columns_with(picture: np.ndarray, colour: tuple[int, int, int], *, within: float = 60.0) -> float:
    """Share of the picture's width over which a curve of this colour runs."""
    distance = np.linalg.norm(picture.astype(float) - np.array(colour, float), axis=2)
    return float((distance < within).any(axis=0).mean())


@pytest.mark.graphics
def test_every_pane_is_there(panes: dict[str, np.ndarray]) -> None:
    assert set(panes) == {
        WHOLE,
        "Film",
        "Summary",
        "Events",
        "Angle (°)",
        "Residual: measured − model (°)",
        "Temperature (°C)",
    }
    assert panes[WHOLE].shape == (800, 1280, 3)


@pytest.mark.graphics
@pytest.mark.parametrize("pane", ["angle", "residual", "temperature"])
def test_every_curve_is_drawn_across_its_pane(panes: dict[str, np.ndarray], pane: str) -> None:
    picture = next(image for name, image in panes.items() if name.lower().startswith(pane))
    for series in view_layout.SERIES:
        if series.entity.startswith(pane):
            # Where two curves coincide one covers the other; in the strokes, a quarter of the width, both show.
            assert columns_with(picture, series.colour) > 0.15, series.name


@pytest.mark.graphics
def test_the_film_is_shown_with_dots_sticks_and_arc(panes: dict[str, np.ndarray]) -> None:
    film = panes["Film"]
    assert share_of(film, (150, 150, 150), within=25.0) > 0.3
    assert share_of(film, (20, 20, 20), within=25.0) > 0.001
    for colour in (BASE_COLOUR, MOVING_COLOUR, ARC_COLOUR):
        assert share_of(film, colour) > 0.0005


@pytest.mark.graphics
def test_the_moving_stick_is_drawn_where_the_film_shows_its_dots(panes: dict[str, np.ndarray]) -> None:
    """The dots of the video are dark rings around the drawn markers: both are about the same centres."""
    film = panes["Film"].astype(float)
    grey = np.linalg.norm(film - 150.0, axis=2) < 30.0
    rows, columns = np.nonzero(grey)
    inside = film[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    for colour in (BASE_COLOUR, MOVING_COLOUR):
        drawn = (np.linalg.norm(inside - np.array(colour, float), axis=2) < 60.0).astype(np.uint8)
        blobs, _, stats, centres = cv2.connectedComponentsWithStats(
            cv2.morphologyEx(drawn, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
        )
        assert blobs >= 3
        for k in np.argsort(stats[1:, cv2.CC_STAT_AREA])[-2:] + 1:
            x, y = centres[k].astype(int)
            around = inside[max(0, y - 12) : y + 13, max(0, x - 12) : x + 13]
            assert share_of(around, (20, 20, 20), within=40.0) > 0.1


@pytest.mark.graphics
@pytest.mark.parametrize("pane", ["Summary", "Events"])
def test_words_are_drawn(panes: dict[str, np.ndarray], pane: str) -> None:
    """Bright letters on the dark ground, in several lines."""
    lines = (panes[pane].min(axis=2) > 150).any(axis=1)
    assert np.count_nonzero(np.diff(lines.astype(int)) == 1) >= 4
