"""Boards seen by cameras of known geometry: as exact corners with noise, or as pictures.

Nothing of the code under test is used but its records: the lens is applied by OpenCV or by this file's own inverse, the
pattern is drawn by the formula of a chessboard or by OpenCV's own ChArUco picture.
"""

from functools import lru_cache

import cv2
import numpy as np

from calibration.boards.board_file import Board
from calibration.views.detect import View
from torsight.core.optics.camera import Intrinsics

CHESSBOARD = Board("chessboard", columns=9, rows=6, square_mm=10.0)
CHARUCO = Board("charuco", columns=8, rows=6, square_mm=12.0, marker_mm=8.4, dictionary="DICT_4X4_50")
SIZE_PX = (400, 300)
LENS = Intrinsics(
    SIZE_PX,
    np.array([[433.0, 0.0, 196.0], [0.0, 436.0, 152.5], [0.0, 0.0, 1.0]]),
    np.array([-0.22, 0.08, 0.0008, -0.0006, 0.0]),
)
RIGHT_LENS = Intrinsics(
    SIZE_PX,
    np.array([[442.0, 0.0, 203.0], [0.0, 441.0, 147.0], [0.0, 0.0, 1.0]]),
    np.array([-0.19, 0.05, -0.0005, 0.0007, 0.0]),
)
RIGHT_RVEC, RIGHT_TVEC_MM = np.array([0.01, 0.12, -0.015]), np.array([-30.0, 0.6, 2.5])


def poses(count, seed, *, distance_mm=(120.0, 190.0), tilt_deg=40.0):
    """Return rvec and tvec (n, 6): board facing the camera, tilted to all sides, spread over the picture."""
    rng = np.random.default_rng(seed)
    found = []
    for place in range(count):
        tilt = np.radians(rng.uniform(0.3, 1.0) * tilt_deg)
        side = 2 * np.pi * (place + rng.uniform(0, 0.5)) / count * 3
        lean = tilt * np.array([np.cos(side), np.sin(side), 0.0])
        spin = np.array([0.0, 0.0, rng.uniform(-0.4, 0.4)])
        rotation = cv2.Rodrigues(lean)[0] @ cv2.Rodrigues(spin)[0]
        depth = rng.uniform(*distance_mm)
        where = rng.uniform(-0.16, 0.16, 2) * depth
        found.append(np.concatenate((cv2.Rodrigues(rotation)[0].ravel(), [*where, depth])))
    return np.array(found)


def whole(where, board=CHESSBOARD):
    """Return those poses at which the picture holds all of the board, its border too."""
    reach = 1.7 * board.square_mm
    points = board.points_mm() + np.sign(board.points_mm()) * reach * np.array([1, 1, 0])
    kept = []
    for pose in where:
        pixels, _ = cv2.projectPoints(points, pose[:3], pose[3:], LENS.matrix, LENS.distortion)
        pixels = pixels.reshape(-1, 2)
        if pixels.min() > 0 and np.all(pixels.max(axis=0) < SIZE_PX):
            kept.append(pose)
    return kept


def in_right(pose):
    """Return the same board's pose for the right camera."""
    rotation = cv2.Rodrigues(RIGHT_RVEC)[0]
    turned = rotation @ cv2.Rodrigues(pose[:3])[0]
    return np.concatenate((cv2.Rodrigues(turned)[0].ravel(), rotation @ pose[3:] + RIGHT_TVEC_MM))


def corners_px(pose, lens=LENS, board=CHESSBOARD):
    pixels, _ = cv2.projectPoints(board.points_mm(), pose[:3], pose[3:], lens.matrix, lens.distortion)
    return pixels.reshape(-1, 2)


def exact_view(pose, index, *, lens=LENS, board=CHESSBOARD, sigma_px=0.0, rng=None, wide_px=0.0):
    """Return a view with Gaussian noise; ``wide_px`` shifts the wide window's corners by a checked pattern."""
    corners = corners_px(pose, lens, board)
    if rng is not None:
        corners = corners + rng.normal(0, sigma_px, corners.shape)
    pattern = np.where(np.arange(len(corners))[:, None] % 2, wide_px, -wide_px) / np.sqrt(2)
    return View(
        name=f"view{index:02d}",
        index=index,
        corner=np.arange(len(corners)),
        points_mm=board.points_mm(),
        corners_px=corners,
        wide_px=corners + pattern,
    )


SAMPLES = 13
"""Places per pixel at which the pattern is looked up: a lattice in which no two share a row or a column, so that an
edge along the pixels' rows is shaded in 13 steps."""


@lru_cache(maxsize=4)
def _rays(lens_key):
    """Return the rays (two of (samples, h, w)) of every sample; the lens is undone by fixed-point iteration."""
    size_px, matrix, distortion = lens_key
    fx, fy, cx, cy = matrix
    step = np.arange(SAMPLES)
    across, down = (step + 0.5) / SAMPLES - 0.5, (step * 5 % SAMPLES + 0.5) / SAMPLES - 0.5
    u = np.arange(size_px[0]) + across[:, None, None]
    v = np.arange(size_px[1])[:, None] + down[:, None, None]
    bent_x, bent_y = np.broadcast_arrays((u - cx) / fx, (v - cy) / fy)
    k1, k2, p1, p2, k3 = distortion
    x, y, moved = bent_x, bent_y, np.inf
    while moved > 1e-9:
        r2 = x * x + y * y
        gain = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        before = x
        x, y = (
            (bent_x - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / gain,
            (bent_y - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / gain,
        )
        moved = np.abs(x - before).max()
    return x.astype(np.float32), y.astype(np.float32)


def picture(pose, *, lens=LENS, board=CHESSBOARD, noise=1.5, seed=0, blur_px=0.6):
    """Return a grey picture (h, w) of the board on a grey background, slightly blurred, with noise."""
    key = (
        lens.size_px,
        (lens.matrix[0, 0], lens.matrix[1, 1], lens.matrix[0, 2], lens.matrix[1, 2]),
        tuple(lens.distortion),
    )
    ray_x, ray_y = _rays(key)
    rotation = cv2.Rodrigues(pose[:3])[0]
    # Board coordinates of where each line of sight meets its plane: [r1 r2 t]⁻¹ applied to (x, y, 1).
    plane = np.linalg.inv(np.stack((rotation[:, 0], rotation[:, 1], pose[3:]), axis=1)).astype(np.float32)
    x, y, w = (row[0] * ray_x + row[1] * ray_y + row[2] for row in plane)
    grey = _pattern(board, x / w, y / w).mean(axis=0)
    grey = cv2.GaussianBlur(grey, (0, 0), blur_px) + np.random.default_rng(seed).normal(0, noise, grey.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def _pattern(board, x_mm, y_mm):
    across, down = board.squares
    side = board.square_mm
    column, row = x_mm / side + across / 2, y_mm / side + down / 2
    border = 0.6
    on_board = (column >= -border) & (column < across + border) & (row >= -border) & (row < down + border)
    inside = (column >= 0) & (column < across) & (row >= 0) & (row < down)
    if board.kind == "charuco":
        art = _charuco_art(board)
        scale = art.shape[1] / across
        rows = np.clip(row * scale, 0, art.shape[0] - 1).astype(np.int32)
        dark = art[rows, np.clip(column * scale, 0, art.shape[1] - 1).astype(np.int32)] < 128
    else:
        dark = (column.astype(np.int32) + row.astype(np.int32)) & 1 == 0
    return np.where(on_board, np.where(inside & dark, np.float32(30), np.float32(215)), np.float32(120))


@lru_cache(maxsize=2)
def _charuco_art(board):
    return board.charuco().generateImage((board.columns * 120, board.rows * 120), marginSize=0)
