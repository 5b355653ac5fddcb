"""What a board file says, and what is refused in it."""

import numpy as np
import pytest
import tomli_w

from calibration.boards.board_file import Board, board_from, read_board
from torsight.core.errors import ConfigError, InputError

CHESSBOARD = {"kind": "chessboard", "columns": 9, "rows": 6, "square_mm": 25.0}
CHARUCO = {"kind": "charuco", "columns": 8, "rows": 6, "square_mm": 30, "marker_mm": 21, "dictionary": "DICT_5X5_50"}


@pytest.mark.parametrize("table", [CHESSBOARD, CHARUCO, CHESSBOARD | {"axis_mm": [3.0, -2.0]}])
@pytest.mark.parametrize("nested", [False, True])
def test_board_is_read_and_written_alike(tmp_path, table, nested):
    path = tmp_path / "board.toml"
    path.write_text(tomli_w.dumps({"board": table} if nested else table))
    board = read_board(path)
    assert board.content() == table
    assert board_from(board.content(), where="x") == board


def test_corners_lie_about_the_middle():
    points = board_from(CHESSBOARD, where="x").points_mm()
    assert points.shape == (54, 3)
    assert points.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert points[1] - points[0] == pytest.approx([25, 0, 0])
    assert points[9] - points[0] == pytest.approx([0, 25, 0])


def test_charuco_counts_squares_and_chessboard_corners():
    assert Board("charuco", 8, 6, 30.0, 21.0, "DICT_5X5_50").corners == (7, 5)
    assert Board("chessboard", 8, 6, 30.0).corners == (8, 6)
    assert Board("chessboard", 8, 6, 30.0).squares == (9, 7)


def test_charuco_corners_are_opencvs():
    board = board_from(CHARUCO, where="x")
    theirs = np.array(board.charuco().getChessboardCorners())
    ours = board.points_mm()
    assert ours - ours[0] == pytest.approx(theirs - theirs[0], abs=1e-5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"colums": 9}, "did you mean 'columns'"),
        ({"kind": "checkerboard"}, "chessboard, charuco"),
        ({"columns": 2}, "3 to 100"),
        ({"columns": 8.5}, "whole number"),
        ({"rows": "six"}, "not a number"),
        ({"square_mm": 0}, "out of range"),
        ({"square_mm": 0.025}, "in millimetres, not in metres"),
        ({"square_mm": None}, "has no key 'square_mm'"),
        ({"marker_mm": 12}, "belongs to a ChArUco board"),
        ({"axis_mm": 3}, "list of 2 numbers"),
    ],
)
def test_what_a_chessboard_cannot_be_is_refused(change, said):
    table = {key: value for key, value in (CHESSBOARD | change).items() if value is not None}
    with pytest.raises(ConfigError, match=said):
        board_from(table, where="board.toml")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"marker_mm": 30}, "below square_mm = 30"),
        ({"dictionary": "DICT_9X9_50"}, "DICT_4X4_50"),
        ({"columns": 12, "rows": 9}, "54 needed"),
        ({"legacy": 1}, "true or false"),
    ],
)
def test_what_a_charuco_board_cannot_be_is_refused(change, said):
    with pytest.raises(ConfigError, match=said):
        board_from(CHARUCO | change, where="board.toml")


def test_missing_file_and_bad_toml_are_told_apart(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_board(tmp_path / "board.toml")
    (tmp_path / "board.toml").write_text("kind = chessboard")
    with pytest.raises(ConfigError, match="is not TOML"):
        read_board(tmp_path / "board.toml")
