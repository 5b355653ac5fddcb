"""Corners in drawn pictures against where they were drawn."""

import cv2
import numpy as np
import pytest
from made_up_views import CHARUCO, CHESSBOARD, corners_px, picture

from calibration.boards.board_file import Board
from calibration.views.detect import find_board, goes_on, other_boards_seen

FACING = np.array([0.25, -0.1, 0.05, 3.0, -2.0, 150.0])


def test_corners_are_where_they_were_drawn(drawn):
    board, where, pictures = drawn
    error = []
    for pose, grey in zip(where, pictures, strict=True):
        view = find_board(grey, board)
        assert view is not None
        error.append(view.corners_px - corners_px(pose, board=board)[view.corner])
    error = np.concatenate(error)
    # A corner between 185 grey levels under noise of 1.5, blurred over 1 px: a tenth of a pixel is far above its bound
    # (some hundredths) and far below one wrong corner; the mean over 300 corners shows a shift of the coordinates.
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.12
    assert np.abs(error.mean(axis=0)).max() < 0.01


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_first_corner_is_the_boards_own_however_the_camera_is_turned(turns):
    grey = np.ascontiguousarray(np.rot90(picture(FACING), k=turns))
    view = find_board(grey, CHESSBOARD)
    expected = corners_px(FACING)
    for turn in range(turns):
        width = 400 if turn % 2 == 0 else 300
        # A quarter turn counter-clockwise: what was at the right end of a row comes to the top.
        expected = np.stack((expected[:, 1], width - 1 - expected[:, 0]), axis=1)
    assert view.corners_px == pytest.approx(expected, abs=0.3)


@pytest.mark.parametrize("corners", [(7, 7), (7, 5), (6, 6)])
def test_board_that_looks_the_same_turned_starts_at_the_left(corners):
    board = Board("chessboard", *corners, 10.0)
    assert board.turned_looks_the_same
    view = find_board(picture(FACING, board=board), board)
    first, last = view.corners_px[0], view.corners_px[corners[0] - 1]
    assert last[0] - first[0] > abs(last[1] - first[1])


def test_part_of_a_charuco_board_is_enough():
    grey = picture(FACING, board=CHARUCO)
    grey[:, :190] = 120
    view = find_board(grey, CHARUCO)
    assert 8 <= len(view.corner) < 35
    truth = corners_px(FACING, board=CHARUCO)[view.corner]
    # Corners next to the cut may have lost one of their four squares.
    assert np.median(np.linalg.norm(view.corners_px - truth, axis=1)) < 0.12


def test_large_picture_is_searched_small_and_measured_whole():
    factor = 6
    grey = cv2.resize(picture(FACING), None, fx=factor, fy=factor, interpolation=cv2.INTER_LINEAR)
    view = find_board(grey, CHESSBOARD)
    expected = (corners_px(FACING) + 0.5) * factor - 0.5
    # The same tenth of a pixel as in the small picture, six times as large.
    assert np.sqrt(np.mean(np.sum((view.corners_px - expected) ** 2, axis=1))) < 0.12 * factor
    assert np.abs((view.corners_px - expected).mean(axis=0)).max() < 0.02 * factor


def test_no_board_is_none():
    noise = np.random.default_rng(0).integers(0, 255, (120, 160)).astype(np.uint8)
    for board in (CHESSBOARD, CHARUCO):
        assert find_board(noise, board) is None
        assert find_board(np.full((120, 160), 128, np.uint8), board) is None


def test_wrong_count_of_corners_is_told_from_no_board():
    grey = picture(FACING)
    assert other_boards_seen(grey, Board("chessboard", 10, 7, 10.0)) == "a chessboard of 9 × 6 inner corners"
    assert other_boards_seen(np.full((300, 400), 128, np.uint8), CHARUCO) is None
    markers = picture(FACING, board=CHARUCO)
    said = other_boards_seen(markers, Board("charuco", 8, 6, 12.0, 8.4, "DICT_6X6_50"))
    assert "DICT_4X4" in said


def test_part_of_a_larger_chessboard_is_known_by_what_lies_beyond():
    grey = picture(FACING)
    assert not goes_on(grey, CHESSBOARD)
    assert goes_on(grey, Board("chessboard", 7, 4, 10.0))


def test_blur_shows_in_the_width_of_the_edges():
    sharp = picture(FACING)
    dull = cv2.GaussianBlur(sharp, (0, 0), 1.2)
    assert find_board(dull, CHESSBOARD).edge_px > 1.5 * find_board(sharp, CHESSBOARD).edge_px
