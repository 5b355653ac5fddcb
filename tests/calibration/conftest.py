"""Pictures of boards, drawn once for all tests of this folder."""

import cv2
import pytest
from made_up_views import CHARUCO, CHESSBOARD, picture, poses

BOARDS = {"chessboard": CHESSBOARD, "charuco": CHARUCO}


@pytest.fixture(scope="session", params=list(BOARDS))
def drawn(request):
    """Return a board, the true poses and the pictures of it."""
    board = BOARDS[request.param]
    where = poses(11, 3)
    return board, where, [picture(pose, board=board, seed=index) for index, pose in enumerate(where)]


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Return a folder with the pictures of a chessboard, board00.png and on."""
    path = tmp_path_factory.mktemp("pictures")
    for index, pose in enumerate(poses(11, 3)):
        cv2.imwrite(str(path / f"board{index:02d}.png"), picture(pose, seed=index))
    return path


@pytest.fixture(scope="session")
def board_toml(tmp_path_factory):
    path = tmp_path_factory.mktemp("board") / "board.toml"
    path.write_text('kind = "chessboard"\ncolumns = 9\nrows = 6\nsquare_mm = 10.0\n')
    return path
