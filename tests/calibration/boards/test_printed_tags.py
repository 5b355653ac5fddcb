"""The printed pair of tags: true size, found by OpenCV's detector, and taken by the tracker as it is described."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.boards.printing import draw_tags, tag_pair, write_board
from torsight.cli.main import command_line
from torsight.core.errors import ConfigError
from tracker.detect.marker_file import read_markers


@pytest.mark.parametrize(("family", "ids", "page"), [("4X4_50", (0, 1), "a4"), ("APRILTAG_36h11", (8, 500), "a5")])
def test_tags_are_found_at_true_size_with_their_border(
    family: str, ids: tuple[int, int], page: str, tmp_path: Path
) -> None:
    pair = tag_pair(family, base_id=ids[0], moving_id=ids[1], side_mm=40.0)
    dpi = 127.0
    write_board(tmp_path / "tags.png", draw_tags(pair, page=page), dpi=dpi)
    grey = cv2.imread(str(tmp_path / "tags.png"), cv2.IMREAD_GRAYSCALE)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{family}")))
    corners, numbers, _ = detector.detectMarkers(grey)
    assert sorted(np.ravel(numbers)) == sorted(ids)
    for four in corners:
        sides = np.hypot(*(four[0] - np.roll(four[0], 1, axis=0)).T)
        # The detector names the outermost black pixels: a side is one pixel longer.
        np.testing.assert_allclose(sides + 1.0, 40.0 * dpi / 25.4, atol=1.0)
        x0, y0 = np.floor(four[0].min(axis=0)).astype(int)
        module = round(float(sides[0]) / 10.0)
        assert grey[y0 - module : y0 - 2, x0 - module : x0 + round(float(sides[0])) + module].min() == 255


def test_the_command_writes_what_track_reads(tmp_path: Path) -> None:
    out = tmp_path / "tags.pdf"
    command = ["board", "--tags", "--family", "5X5_50", "--side-mm", "25", "--out", str(out), "--json"]
    result = CliRunner().invoke(command_line(), command)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["result"]["family"] == "5X5_50"
    assert {path.name for path in tmp_path.iterdir()} == {"tags.pdf", "tags.png", "tags.toml"}
    hints = read_markers(tmp_path / "tags.toml")
    assert (hints.kind, hints.ids, dict(hints.length_mm)) == ("tag", (0, 1), {"base": 25.0, "moving": 25.0})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"family": "4X5_50"}, "no family"),
        ({"base_id": 1}, "one number"),
        ({"moving_id": 50}, "0 to 49"),
    ],
)
def test_pairs_that_there_are_not(change: dict, words: str) -> None:
    given = {"family": "4X4_50", "base_id": 0, "moving_id": 1} | change
    with pytest.raises(ConfigError, match=words):
        tag_pair(given.pop("family"), **given, side_mm=20.0)


def test_tags_that_do_not_fit_are_refused() -> None:
    pair = tag_pair("4X4_50", base_id=0, moving_id=1, side_mm=300.0)
    with pytest.raises(ConfigError, match="do not fit on a page a4"):
        draw_tags(pair)
