"""The axis from a board on the disk, against rigs of known geometry."""

import cv2
import numpy as np
import pytest
from made_up_views import CHESSBOARD, LENS, exact_view

from calibration.axis import pose_on_disk
from calibration.boards.board_file import Board
from torsight.core.errors import InputError, NoResultError
from torsight.core.optics.geometry import rotation_matrix

DIRECTION = np.array([0.17, -0.11, -1.0]) / np.linalg.norm([0.17, -0.11, -1.0])
CENTRE_MM = np.array([4.0, -3.0, 160.0])


def flat_board():
    """Return a rotation of a board whose face is across the axis: its z axis points away from the camera."""
    x = np.cross([0.1, 1.0, 0.2], -DIRECTION)
    x /= np.linalg.norm(x)
    return np.stack((x, np.cross(-DIRECTION, x), -DIRECTION), axis=1)


def on_disk(turns_rad, *, lean=0.0, offset_mm=(0.0, 0.0), sigma_px=0.0, seed=0, board=CHESSBOARD):
    rng = np.random.default_rng(seed)
    views = []
    for index, turn in enumerate(turns_rad):
        spin = cv2.Rodrigues(DIRECTION * turn)[0]
        rotation = spin @ flat_board() @ cv2.Rodrigues(np.array([lean, 0.0, 0.0]))[0]
        place = CENTRE_MM + spin @ flat_board() @ np.array([*offset_mm, 0.0])
        pose = np.concatenate((cv2.Rodrigues(rotation)[0].ravel(), place))
        views.append(exact_view(pose, index, sigma_px=sigma_px, rng=rng, board=board))
    return views


def direction_of(disk):
    return rotation_matrix(disk.pose.rvec)[:, 2]


def off_axis_mm(point):
    return np.linalg.norm(np.cross(point - CENTRE_MM, DIRECTION))


def test_one_picture_gives_the_plane_and_the_middle():
    disk = pose_on_disk(on_disk([0.3]), LENS, CHESSBOARD, base_z_mm=2.0, moving_z_mm=5.0)
    assert direction_of(disk) == pytest.approx(DIRECTION, abs=1e-7)
    assert disk.pose.tvec_mm == pytest.approx(CENTRE_MM, abs=1e-5)
    assert (disk.pose.base_z_mm, disk.pose.moving_z_mm) == (2.0, 5.0)
    toward = -CENTRE_MM / np.linalg.norm(CENTRE_MM)
    assert disk.tilt_deg == pytest.approx(np.degrees(np.arccos(toward @ DIRECTION)), abs=1e-5)


def test_one_picture_takes_the_axis_where_the_board_file_says():
    board = Board("chessboard", 9, 6, 10.0, axis_mm=(12.0, -7.0))
    disk = pose_on_disk(on_disk([0.3], offset_mm=(-12.0, 7.0)), LENS, board)
    assert disk.pose.tvec_mm == pytest.approx(CENTRE_MM, abs=1e-5)


@pytest.mark.parametrize("turns", [[0.0, 0.5], [0.0, 0.8, 2.5, 4.0]])
def test_turned_disk_gives_the_axis_wherever_and_however_the_board_lies(turns):
    disk = pose_on_disk(on_disk(turns, lean=0.06, offset_mm=(9.0, -5.0)), LENS, CHESSBOARD)
    assert direction_of(disk) == pytest.approx(DIRECTION, abs=1e-6)
    assert off_axis_mm(disk.pose.tvec_mm) < 1e-4
    assert disk.wobble_deg == pytest.approx(np.degrees(0.06), abs=1e-4)
    expected = (np.degrees(turns) + 180) % 360 - 180
    assert disk.turned_deg == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("turns", [[0.0], [0.0, 0.9, 2.0]])
def test_axis_lies_within_its_sigma(turns):
    scaled, places = [], []
    for seed in range(16):
        disk = pose_on_disk(on_disk(turns, sigma_px=0.15, seed=seed), LENS, CHESSBOARD)
        error_deg = np.degrees(np.arccos(min(1.0, direction_of(disk) @ DIRECTION)))
        scaled.append(error_deg / disk.direction_sigma_deg)
        places.append(off_axis_mm(disk.pose.tvec_mm) / disk.place_sigma_mm if len(turns) > 1 else np.nan)
    # Two tilts, none wider than sigma.
    assert 0.5 < np.mean(np.square(scaled)) < 2.0 + 5 * 2 * np.sqrt(2 / 32)
    if len(turns) > 1:
        assert 0.5 < np.mean(np.square(places)) < 2.0 + 5 * 2 * np.sqrt(2 / 32)


def test_disk_that_was_not_turned_is_refused():
    with pytest.raises(NoResultError, match=r"turned by 5\.7°"):
        pose_on_disk(on_disk([0.0, 0.1]), LENS, CHESSBOARD)


def test_board_that_moved_on_the_disk_or_another_camera_is_refused():
    first, second = on_disk([0.0, 0.9])
    third = on_disk([1.8], offset_mm=(6.0, 0.0))[0]
    with pytest.raises(InputError, match="does not fit this camera"):
        pose_on_disk([first, second, third], LENS, CHESSBOARD)
