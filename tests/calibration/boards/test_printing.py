"""Printed boards against OpenCV's own pictures and detectors, and at true scale."""

import re
import xml.etree.ElementTree as ET
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from calibration.boards.board_file import Board
from calibration.boards.printing import PAGES_MM, draw_board, usual_board, write_board
from torsight.core.errors import ConfigError

CHARUCO = Board("charuco", 8, 6, 25.0, 18.0, "DICT_6X6_250")
CHESSBOARD = Board("chessboard", 9, 6, 25.0)


def raster(drawing, *, dpi, folder):
    write_board(folder / "page.png", drawing, dpi=dpi)
    return cv2.imread(str(folder / "page.png"), cv2.IMREAD_GRAYSCALE)


@pytest.mark.parametrize(
    "board",
    [
        CHARUCO,
        Board("charuco", 8, 6, 25.0, 18.0, "DICT_6X6_250", legacy=True),
        Board("charuco", 7, 5, 30.0, 22.5, "DICT_4X4_50"),
        Board("charuco", 7, 5, 30.0, 22.5, "DICT_4X4_50", legacy=True),
    ],
)
def test_charuco_is_the_picture_that_opencv_draws(board, tmp_path):
    pixels = 80
    theirs = board.charuco().generateImage((board.columns * pixels, board.rows * pixels), marginSize=0)
    ours = raster(draw_board(board), dpi=25.4 * pixels / board.square_mm, folder=tmp_path)
    left = round((297 - board.columns * board.square_mm) / 2 * pixels / board.square_mm)
    top = round((200 - board.rows * board.square_mm) / 2 * pixels / board.square_mm)
    ours = ours[top : top + theirs.shape[0], left : left + theirs.shape[1]]
    # Inside the modules there is no difference; at their edges the two round differently by up to a pixel.
    kernel = np.ones((5, 5), np.uint8)
    sure = (cv2.dilate(theirs, kernel) == cv2.erode(theirs, kernel)).nonzero()
    assert len(sure[0]) > 0.6 * theirs.size
    assert np.array_equal(ours[sure] > 127, theirs[sure] > 127)


@pytest.mark.parametrize(
    "board", [CHESSBOARD, CHARUCO, usual_board("charuco"), usual_board("chessboard", page="letter")]
)
def test_detector_finds_all_corners_where_they_were_drawn(board, tmp_path):
    page = "letter" if board.square_mm == 25 and board == usual_board("chessboard", page="letter") else "a4"
    scale = 150 / 25.4
    grey = raster(draw_board(board, page=page), dpi=150, folder=tmp_path)
    if board.kind == "chessboard":
        found, corners = cv2.findChessboardCorners(grey, board.corners)
        assert found
        middle = corners.reshape(-1, 2).mean(axis=0)
    else:
        corners, ids, _, _ = cv2.aruco.CharucoDetector(board.charuco()).detectBoard(grey)
        assert ids.ravel().tolist() == list(range(len(board.points_mm())))
        middle = corners.reshape(-1, 2).mean(axis=0)
    width_mm, height_mm = PAGES_MM[page]
    assert middle == pytest.approx([width_mm / 2 * scale - 0.5, (height_mm - 10) / 2 * scale - 0.5], abs=0.5)


def test_svg_is_at_true_scale(tmp_path):
    write_board(tmp_path / "board.svg", draw_board(CHESSBOARD))
    root = ET.parse(tmp_path / "board.svg").getroot()  # noqa: S314 - our own text
    # 72 points are an inch in CSS, too.
    size_mm = [float(root.get(side).removesuffix("pt")) * 25.4 / 72 for side in ("width", "height")]
    assert size_mm == pytest.approx([297, 210], abs=1e-3)
    (shapes,) = [item.get("d") for item in root.iter() if (item.get("d") or "").count("z") > 1]
    assert _sizes_mm(re.findall(r"[ML] ([\d.]+) ([\d.]+)", shapes)) == pytest.approx(
        np.array([*35 * [(25, 25)], (100, 1)]), abs=1e-4
    )


def test_pdf_holds_the_same_shapes_at_true_scale(tmp_path):
    drawing = draw_board(CHARUCO)
    write_board(tmp_path / "board.pdf", drawing)
    content = (tmp_path / "board.pdf").read_bytes()
    page_pt = [float(side) for side in re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", content).groups()]
    assert np.array(page_pt) * 25.4 / 72 == pytest.approx([297, 210], abs=1e-3)
    streams = (found.group(1) for found in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL))
    text = zlib.decompress(next(streams)).decode("latin-1")
    shapes = re.findall(r"^([\d.]+) ([\d.]+) [ml]$", text[text.index("re W n") :], re.MULTILINE)
    expected = [(item.width_mm, item.height_mm) for item in drawing.rectangles]
    assert _sizes_mm(shapes) == pytest.approx(np.array(expected), abs=1e-4)


def _sizes_mm(corners_pt):
    """Return width and height of rectangles from the four corners of each, in points."""
    return np.ptp(np.array(corners_pt, float).reshape(-1, 4, 2), axis=1) * 25.4 / 72


def test_pixel_that_is_covered_in_part_is_grey_in_proportion(tmp_path):
    drawing = replace(draw_board(Board("chessboard", 3, 3, 10.0)), texts=())
    # 20 dpi: 0.787 px per mm, so nearly no edge falls on a pixel's edge; the ink must be that of the shapes.
    ink = (255.0 - raster(drawing, dpi=20, folder=tmp_path).astype(float)).sum() / 255.0 * (25.4 / 20) ** 2
    area = sum(item.width_mm * item.height_mm for item in drawing.rectangles)
    # Rounding to 256 levels: a quarter of a level on each of some hundred edge pixels.
    assert ink == pytest.approx(area, rel=2e-3)


@pytest.mark.parametrize("suffix", [".svg", ".pdf", ".png"])
def test_board_is_written_by_suffix(tmp_path, suffix):
    path = tmp_path / f"board{suffix}"
    write_board(path, draw_board(CHESSBOARD), dpi=100)
    start = {".svg": b"<?xml", ".pdf": b"%PDF", ".png": b"\x89PNG"}[suffix]
    assert path.read_bytes().startswith(start)
    if suffix == ".png":
        with Image.open(path) as image:
            assert image.info["dpi"] == pytest.approx((100, 100), abs=0.1)
            assert image.size == (round(297 / 25.4 * 100), round(210 / 25.4 * 100))


def test_board_larger_than_the_page_is_refused_with_the_size_that_fits():
    with pytest.raises(ConfigError, match=r"squares of up to 26\.2 mm"):
        draw_board(Board("chessboard", 9, 6, 40.0))
    with pytest.raises(ConfigError, match=r"\.svg, \.pdf, \.png"):
        write_board(Path("board.jpg"), draw_board(CHESSBOARD))
