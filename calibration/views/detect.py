"""Detection of the board in a picture and measurement of its corners, in two windows.

A corner is measured by OpenCV's gradient method in a square window. A wide window averages noise, but where squares
appear small or oblique it includes the next edges, which bias the result. So each corner is measured twice: in a narrow
window, which the calibration uses, and in a wide one (half of the smallest square, at most the customary 11 px). Where
the two results differ, the corners depend on the window and are uncertain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from calibration.boards.board_file import DICTIONARIES, Board, dictionary_of
from torsight.core.files.small_pictures import shrunk
from torsight.core.units import Floats, Ints

Grey = NDArray[np.uint8]

# benchmarks/calibration/constants.py measures the effect of half and twice of these constants.
_DETECTION_SIDE_PX: Final = 1600
_QUICK_SIDE_PX: Final = 640
"""Longer side to which pictures, and frames of a film, are shrunk for detection; the corners are then measured in the
full picture. The same chessboards are found with half and with twice of either. A ChArUco board is found where a module
of its markers has about 2.5 px then: with half of either one that is small in the picture is not."""
_NARROW_SHARE: Final = 0.3
_WIDE_SHARE: Final = 0.5
"""Half side of the narrow and of the wide window, as shares of the smallest square; half a square reaches the next
edges of an oblique board. Corners err by 0.06 px in the narrow window, by 0.51 px with half this value; by 0.04 px in
the wide window, 0.08 px with half and 3.4 px with twice this value."""
_WIDEST_PX: Final = 11
"""Half side of the window that is customary in OpenCV's calibration sample. With half and twice this value corners err
by 3 % more and 1 % less."""
_WINDOW_PER_EDGE: Final = 3.0
"""Half side of the window in widths of the edge: it includes the whole slope and the level parts on both sides. With
half this value corners err by a sixth more, with twice by 1 % less."""
FEWEST_CORNERS: Final = 8
"""Least number of corners in a picture, or in both of a pair: twice those that determine a plane's pose."""
_STOP: Final = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """The board in one picture, with the picture's name and its index in the list of pictures, from 0.

    ``corner`` (n,) are the numbers of the inner corners that were found, ``points_mm`` (n, 3) their positions on the
    board, ``corners_px`` and ``wide_px`` (n, 2) those in the picture, measured in the narrow and in the wide window;
    pixel centres are at whole numbers. ``edge_px`` is the width of the edges at the corners (contrast over steepest
    slope), which grows with blur.
    """

    name: str
    index: int
    corner: Ints
    points_mm: Floats
    corners_px: Floats
    wide_px: Floats
    edge_px: float = 1.0


def find_board(grey: Grey, board: Board, *, name: str = "", index: int = 0, quick: bool = False) -> View | None:
    """Return the board's view in a picture (h, w), or None where the whole board (ChArUco: enough of it) is not found.

    ``name`` and ``index`` are stored in the view; ``quick`` searches a smaller picture, for the many frames of a film.
    """
    side_px = _QUICK_SIDE_PX if quick else _DETECTION_SIDE_PX
    scale, small = max(1.0, max(grey.shape) / side_px), shrunk(grey, side_px)
    found = _charuco(small, board) if board.kind == "charuco" else _chessboard(small, board)
    if found is None:
        return None
    corner, rough = found
    # Pixel centres are at whole numbers, so that scaling is about the picture's edge, half a pixel before the first.
    rough = (rough + 0.5) * scale - 0.5
    points = board.points_mm()[corner]
    square_px = _smallest_square_px(points, rough, board.square_mm)
    narrow, wide = _NARROW_SHARE * square_px, _WIDE_SHARE * square_px
    if board.kind == "charuco":
        # The markers' edges are nearer than the next corner; allow one pixel for their blur.
        room = square_px * (board.square_mm - board.marker_mm) / (2.0 * board.square_mm)
        narrow, wide = min(narrow, room - 1.0), min(wide, room)
    edge_px = _edge_px(grey, rough, narrow)
    # Edges that are wider than usual, as in a large, slightly blurred picture, need a wider window.
    widest = max(_WIDEST_PX, _WINDOW_PER_EDGE * edge_px)
    corners = _measured(grey, rough, min(narrow, widest))
    return View(
        name=name,
        index=index,
        corner=corner,
        points_mm=points,
        corners_px=corners,
        wide_px=_measured(grey, rough, min(wide, widest)),
        edge_px=edge_px,
    )


def _chessboard(grey: Grey, board: Board) -> tuple[Ints, Floats] | None:
    size = (board.columns, board.rows)
    found, corners, kinds = cv2.findChessboardCornersSBWithMeta(grey, size, cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not found:
        return None
    grid = np.asarray(corners, np.float64).reshape(board.rows, board.columns, 2)
    # OpenCV marks a corner that is the top left one of a black cell by 1; the square before it is black, too.
    grid = _oriented(grid, board, dark=bool(kinds[0, 0] == 1))
    return np.arange(grid.size // 2, dtype=np.int64), grid.reshape(-1, 2)


def _oriented(grid: Floats, board: Board, *, dark: bool) -> Floats:
    """Return the grid, which is never mirrored, turned so that it starts at the board's first corner.

    The colours decide where a turn changes them: the board's first square is black, as that at the grid's first corner
    if it is ``dark``. For a symmetric board the picture's right decides.
    """
    if not board.turned_looks_the_same:
        return grid if dark else np.rot90(grid, 2)
    turns = range(4) if board.columns == board.rows else (0, 2)
    return max((np.rot90(grid, turn) for turn in turns), key=lambda one: float(np.mean(one[:, -1, 0] - one[:, 0, 0])))


def _charuco(grey: Grey, board: Board) -> tuple[Ints, Floats] | None:
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board.charuco()).detectBoard(grey)
    if corners is None or ids is None or len(ids) < FEWEST_CORNERS:
        return None
    corner = np.asarray(ids, np.int64).reshape(-1)
    points = board.points_mm()[corner, :2]
    # Corners of a single row do not determine the board's tilt.
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=0.5 * board.square_mm) < 2:
        return None
    return corner, np.asarray(corners, np.float64).reshape(-1, 2)


def _smallest_square_px(points_mm: Floats, corners_px: Floats, square_mm: float) -> float:
    """Return the smallest width of a square, px, from the Jacobian of the homography at every corner."""
    matrix, _ = cv2.findHomography(points_mm[:, :2], corners_px, 0)
    plane = np.concatenate((points_mm[:, :2], np.ones((len(points_mm), 1))), axis=1)
    image = plane @ matrix.T
    derivative = (matrix[:2, :2] - (image[:, :2] / image[:, 2:])[..., None] * matrix[2, :2]) / image[:, 2, None, None]
    area = np.abs(np.linalg.det(derivative))
    longer = np.linalg.norm(derivative, axis=1).max(axis=1)
    return float((area / longer).min() * square_mm)


def _measured(grey: Grey, rough: Floats, half_side_px: float) -> Floats:
    half = max(round(half_side_px), 1)
    start = rough.astype(np.float32).reshape(-1, 1, 2)
    return np.asarray(cv2.cornerSubPix(grey, start, (half, half), (-1, -1), _STOP), np.float64).reshape(-1, 2)


def _edge_px(grey: Grey, corners_px: Floats, half_side_px: float) -> float:
    half = int(np.clip(round(half_side_px), 1, _WIDEST_PX)) + 1
    widths = []
    for column, row in corners_px.round().astype(int):
        patch = grey[max(row - half, 0) : row + half + 1, max(column - half, 0) : column + half + 1].astype(np.float64)
        if min(patch.shape) < 3:
            continue
        slopes = np.gradient(patch)
        widths.append(np.ptp(patch) / max(float(np.hypot(*slopes).max()), 1e-6))
    return float(np.median(widths)) if widths else np.inf


def board_normals(views: Sequence[View]) -> Floats:
    """Return the board's normals (n, 3) in all views, for a camera of usual focal length.

    The true focal length is not known yet; a wrong one distorts all normals similarly and does not hide differences.
    """
    extent = np.concatenate([view.corners_px for view in views])
    focal_px = 1.2 * float(np.ptp(extent, axis=0).max())
    matrix = np.array([[focal_px, 0, extent[:, 0].mean()], [0, focal_px, extent[:, 1].mean()], [0, 0, 1.0]])
    normals = []
    for view in views:
        plane, _ = cv2.findHomography(view.points_mm[:, :2], view.corners_px, 0)
        first, second, _ = (np.linalg.inv(matrix) @ plane).T
        normal = np.cross(first, second)
        normals.append(normal / np.linalg.norm(normal))
    return np.array(normals)


def goes_on(grey: Grey, board: Board) -> bool:
    """Return whether a picture shows a chessboard with more corners than ``BOARD.toml`` declares."""
    seen = _chessboard_size(grey)
    if board.kind != "chessboard" or seen is None:
        return False
    more = np.subtract(sorted(seen), sorted(board.corners))
    return bool((more >= 0).all() and more.any())


def other_boards_seen(grey: Grey, board: Board) -> str | None:
    """Return in words another board that a picture shows; None without one. It indicates a wrong ``BOARD.toml``."""
    small = shrunk(grey, _QUICK_SIDE_PX)
    if board.kind == "charuco":
        return _other_dictionary(small) or _other_chessboard(small, board)
    return _other_chessboard(small, board) or _other_dictionary(small)


def _other_chessboard(grey: Grey, board: Board) -> str | None:
    seen = _chessboard_size(grey)
    if seen is None or sorted(seen) == sorted(board.corners):
        return None
    across, down = sorted(seen, reverse=board.columns > board.rows)
    return f"a chessboard of {across} × {down} inner corners"


def _chessboard_size(grey: Grey) -> tuple[int, int] | None:
    """Return the numbers of inner corners of the largest chessboard in a picture, in either order; None without any."""
    small, flags = shrunk(grey, _QUICK_SIDE_PX), cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_LARGER
    found, _, grid = cv2.findChessboardCornersSBWithMeta(small, (3, 3), flags)
    return (grid.shape[1], grid.shape[0]) if found else None


def _other_dictionary(grey: Grey) -> str | None:
    best, most = None, 3
    for name in DICTIONARIES:
        if not name.endswith("_1000"):
            continue
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary_of(name)).detectMarkers(grey)
        if ids is not None and len(ids) > most:
            best, most = f"{len(ids)} markers of {name[:-5]}_…, numbers {ids.min()} to {ids.max()}", len(ids)
    return best
