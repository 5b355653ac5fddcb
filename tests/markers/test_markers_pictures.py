"""Pictures of a film's markers: track.png, the preview, and what is drawn where detection fails."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from tests.command_line import leave
from tests.tracker.films import Cover, Rig, write_film
from tests.tracker.flat_films import FlatFilm, Sprite, tag
from torsight.core.errors import NoResultError
from torsight.core.words.colours import BASE_COLOUR, MOVING_COLOUR
from torsight.markers.track_picture import chosen_frames
from tracker.angle.orient import orient
from tracker.detect.marker_file import read_markers
from tracker.frames.source import open_source
from tracker.track import track_film

COVERED = replace(Rig(lambda t: 60.0 + 50.0 * t, frames=60), covers=[Cover(0.5, 0.9, "moving")])


def coloured(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Return where a picture (BGR) has a colour, within the rounding of its drawing."""
    return (np.abs(picture.astype(int) - np.array(colour[::-1])) < 12).all(axis=-1)


def read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture


def place(picture: np.ndarray, x_px: float, y_px: float) -> tuple[int, int]:
    """Return the row and column of a place of the frame of 320 × 240, which is drawn three times as large."""
    # The frame's border is black, over nearly its whole height and width.
    black = (picture < 40).all(axis=-1)
    top = int(np.argmax(black.sum(axis=1) > 900))
    left = int(np.argmax(black.sum(axis=0) > 650))
    return int(top + 3 * (y_px + 0.5)), int(left + 3 * (x_px + 0.5))


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tracked")
    write_film(COVERED, folder / "film.mkv")
    assert leave("track", folder / "film.mkv", "--out", folder / "out") == 0
    return folder


def test_the_picture_of_a_track_shows_what_was_read(tracked: Path) -> None:
    picture = read(tracked / "out" / "track.png")
    height, width = picture.shape[:2]
    # Three panels in a row and two rows above the plot of the angle.
    panels = [
        picture[int(top * height) : int(bottom * height), column * width // 3 : (column + 1) * width // 3]
        for top, bottom in ((0.06, 0.36), (0.38, 0.68))
        for column in range(3)
    ]
    moving = [int(coloured(panel, MOVING_COLOUR).sum()) for panel in panels]
    base = [int(coloured(panel, BASE_COLOUR).sum()) for panel in panels]
    assert min(moving[0], moving[3], moving[4]) > 50
    assert min(base[0], base[4]) > 50
    # The worst frame is one in which a hand lies over the moving stick: nothing was read there.
    assert moving[5] == 0


def test_the_worst_frame_is_amid_the_longest_gap_else_the_least_certain(tracked: Path) -> None:
    result = track_film(open_source(tracked / "film.mkv"))
    angles = orient(result.tracks, None).angles
    shown = chosen_frames(result, angles)
    assert [one.index for one in shown[:-1]] == [0, 15, 30, 44, 59]
    # The hand lies there from 0.5 to 0.9 s.
    assert abs(shown[-1].index - 0.7 * 30.0) <= 3
    assert "without an angle" in shown[-1].why
    known = np.where(angles.valid, angles.sigma_rad, np.nan)
    whole = replace(angles, valid=np.ones(60, bool), sigma_rad=np.where(np.isnan(known), 0.0, known))
    assert chosen_frames(result, whole)[-1].index == int(np.nanargmax(known))


def test_the_same_track_gives_the_same_bytes(tracked: Path, tmp_path: Path) -> None:
    assert leave("track", tracked / "film.mkv", "--out", tmp_path) == 0
    assert (tmp_path / "track.png").read_bytes() == (tracked / "out" / "track.png").read_bytes()


def test_where_detection_fails_a_picture_shows_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = replace(Rig(lambda t: 60.0 - 60.0 * t, frames=3), moving_px=(5000.0, 5100.0), hub_px=0.0, texture=0.0)
    write_film(far, tmp_path / "film.mkv")
    assert leave("track", tmp_path / "film.mkv", "--out", tmp_path / "out") == 4
    assert "track.png shows" in capsys.readouterr().err
    assert pd.read_csv(tmp_path / "out" / "angle.csv")["valid"].tolist() == [0, 0, 0]
    assert read(tmp_path / "out" / "track.png").shape[0] > 300


def test_positions_without_a_dot_are_drawn_as_given(tracked: Path, tmp_path: Path) -> None:
    from torsight.cli.track import track_to_folder

    given = {"base": [[30, 30], [60, 30]], "moving": [[30, 200], [290, 200]]}
    with pytest.raises(NoResultError, match="no round dot"):
        track_to_folder(tracked / "film.mkv", markers=given, out=tmp_path)
    picture = read(tmp_path / "track.png")
    yellow = coloured(picture, (240, 228, 66))
    for x, y in given["base"] + given["moving"]:
        row, column = place(picture, x, y)
        assert yellow[row - 11 : row + 12, column - 11 : column + 12].sum() > 30


def test_the_preview_shows_the_markers_where_they_are(tracked: Path, tmp_path: Path) -> None:
    film, out = tracked / "film.mkv", tmp_path / "markers.toml"
    out.write_text("base = [[1, 2], [3, 4]]\nmoving = [[5, 6], [7, 8]]\nbase_mm = 16.5\n", encoding="utf-8")
    assert leave("markers", film, "--preview", tmp_path / "seen.png", "--out", out) == 0
    # A length that was measured by hand is not lost.
    assert "base_mm = 16.5" in out.read_text(encoding="utf-8")
    truth = COVERED.marker_px(60.0)
    np.testing.assert_allclose(read_markers(out).position_px, truth, atol=0.05)
    picture = read(tmp_path / "seen.png")
    for (x, y), colour in zip(truth, [BASE_COLOUR] * 2 + [MOVING_COLOUR] * 2, strict=True):
        row, column = place(picture, x, y)
        ring = coloured(picture, colour)[row - 11 : row + 12, column - 11 : column + 12]
        rows, columns = np.nonzero(ring)
        assert len(rows) > 30
        # The ring of 13 points is round its marker: its drawn pixels have their middle there.
        assert abs(np.median(rows) - 11) <= 3
        assert abs(np.median(columns) - 11) <= 3


def test_the_preview_names_the_tags_by_their_motion(tmp_path: Path) -> None:
    base, moving = ([Sprite(**tag("5X5_50", number, side_mm=40.0, along_mm=70.0))] for number in (4, 3))
    film = FlatFilm(base, moving, lambda t: 60.0 + 90.0 * t, frames=36).write(tmp_path / "film.mkv")
    dots = "base = [[1, 2], [3, 4]]\nmoving = [[5, 6], [7, 8]]\nbase_mm = 16.5\n"
    (tmp_path / "m.toml").write_text(dots, encoding="utf-8")
    assert leave("markers", film, "--preview", tmp_path / "seen.png", "--out", tmp_path / "m.toml") == 0
    # A distance of dots is no side of a tag.
    assert "base_mm" not in (tmp_path / "m.toml").read_text(encoding="utf-8")
    hints = read_markers(tmp_path / "m.toml")
    assert (hints.family, hints.ids) == ("5X5_50", (4, 3))


def test_a_preview_without_markers_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((120, 160), 128, np.uint8))
    assert leave("markers", tmp_path / "plain.png", "--preview", tmp_path / "seen.png", "--json") == 4
    told = capsys.readouterr()
    assert "0 of at least 4 dots" in told.err
    assert json.loads(told.out)["result"]["candidates"] == []
    wanted = ("markers", tmp_path / "plain.png", "--preview", tmp_path / "seen.png", "--out", tmp_path / "m.toml")
    assert leave(*wanted) == 4
    assert not (tmp_path / "m.toml").exists()
