"""The calibration board: the content of ``BOARD.toml``, and the positions of the corners."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, cast

import cv2
import numpy as np

from torsight.core.errors import ConfigError
from torsight.core.files.config import get_number, get_numbers, get_switch, get_table, get_text, get_whole
from torsight.core.files.paths import AnyPath
from torsight.core.files.storage import check_keys, read_toml
from torsight.core.units import Floats

KINDS: Final = ("chessboard", "charuco")
DICTIONARIES: Final = tuple(f"DICT_{bits}X{bits}_{count}" for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000))
_KEYS: Final = ("kind", "columns", "rows", "square_mm", "marker_mm", "dictionary", "legacy", "axis_mm")
_CHARUCO_KEYS: Final = ("marker_mm", "dictionary", "legacy")


@dataclass(frozen=True, slots=True)
class Board:
    """A flat board with a known pattern.

    ``columns`` and ``rows`` count the inner corners of a chessboard, the squares of a ChArUco board; ``square_mm`` is
    the side of a square, as measured on the print. Only a ChArUco board has markers, with the side ``marker_mm`` from
    OpenCV's ``dictionary`` of this name; ``legacy``: in the pattern of OpenCV before version 4.6. ``axis_mm`` is the
    point at which the rotation axis passes a board on the disk, to the right of and below the board's middle.
    """

    kind: Literal["chessboard", "charuco"]
    columns: int
    rows: int
    square_mm: float
    marker_mm: float = 0.0
    dictionary: str = ""
    legacy: bool = False
    axis_mm: tuple[float, float] = (0.0, 0.0)

    @property
    def squares(self) -> tuple[int, int]:
        """Number of printed squares across and down."""
        extra = 1 if self.kind == "chessboard" else 0
        return self.columns + extra, self.rows + extra

    @property
    def corners(self) -> tuple[int, int]:
        """Number of inner corners across and down."""
        across, down = self.squares
        return across - 1, down - 1

    @property
    def turned_looks_the_same(self) -> bool:
        """Whether the pattern is symmetric under half a turn."""
        across, down = self.corners
        return self.kind == "chessboard" and (across + down) % 2 == 0

    def points_mm(self) -> Floats:
        """Return the inner corners (n, 3) row by row, relative to the board's middle: x right, y down, z into it."""
        across, down = self.corners
        x = (np.arange(across) - 0.5 * (across - 1)) * self.square_mm
        y = (np.arange(down) - 0.5 * (down - 1)) * self.square_mm
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return np.concatenate((grid, np.zeros((len(grid), 1))), axis=1)

    def describe(self) -> str:
        """Return the board in words."""
        if self.kind == "chessboard":
            return f"a chessboard of {self.columns} × {self.rows} inner corners"
        return f"a ChArUco board of {self.columns} × {self.rows} squares ({self.dictionary})"

    def content(self) -> dict[str, Any]:
        """Return the board as keys of ``BOARD.toml``."""
        names = ("kind", "columns", "rows", "square_mm")
        content: dict[str, Any] = {name: getattr(self, name) for name in names}
        if self.kind == "charuco":
            content |= {"marker_mm": self.marker_mm, "dictionary": self.dictionary}
            content |= {"legacy": True} if self.legacy else {}
        if self.axis_mm != (0.0, 0.0):
            content["axis_mm"] = list(self.axis_mm)
        return content

    def charuco(self) -> cv2.aruco.CharucoBoard:
        """Return the ChArUco board as OpenCV's object."""
        dictionary = dictionary_of(self.dictionary)
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_mm, self.marker_mm, dictionary)
        board.setLegacyPattern(self.legacy)
        return board


def dictionary_of(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of markers with the given name."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def read_board(path: AnyPath) -> Board:
    """Read ``BOARD.toml``, with the errors of :func:`torsight.core.read_camera`.

    The keys are at the top level or in a table ``[board]``.
    """
    path = Path(path)
    content = read_toml(path, kind="board")
    where = str(path)
    if "board" in content:
        check_keys(content, ("board",), where=where)
        content, where = dict(get_table(content, "board", where=where)), f"{path}, [board]"
    return board_from(content, where=where)


def board_from(table: Mapping[str, Any], *, where: str) -> Board:
    """Return the board that a table of keys describes."""
    check_keys(table, _KEYS, where=where)
    kind = get_text(table, "kind", where=where, choices=KINDS)
    x_mm, y_mm = get_numbers(table, "axis_mm", 2, where=where, default=(0.0, 0.0))
    board = Board(
        kind=cast("Literal['chessboard', 'charuco']", kind),
        columns=get_whole(table, "columns", where=where, lower=3, upper=100),
        rows=get_whole(table, "rows", where=where, lower=3, upper=100),
        square_mm=_get_side(table, "square_mm", where=where),
        axis_mm=(x_mm, y_mm),
    )
    if kind == "chessboard":
        strangers = [key for key in _CHARUCO_KEYS if key in table]
        if strangers:
            raise ConfigError(
                f"'{strangers[0]}' belongs to a ChArUco board",
                where=where,
                value="kind = 'chessboard'",
                do="set kind = 'charuco', or remove it",
            )
        return board
    board = replace(
        board,
        marker_mm=_get_side(table, "marker_mm", where=where),
        dictionary=get_text(table, "dictionary", where=where, default="DICT_4X4_50", choices=DICTIONARIES),
        legacy=get_switch(table, "legacy", where=where),
    )
    if board.marker_mm >= board.square_mm:
        raise ConfigError(
            "'marker_mm' does not fit into a square",
            where=where,
            value=f"{board.marker_mm:g}",
            limit=f"below square_mm = {board.square_mm:g}",
            do="measure both on the print",
        )
    needed, held = board.columns * board.rows // 2, int(board.dictionary.rsplit("_", 1)[1])
    if needed > held:
        raise ConfigError(
            f"'dictionary' {board.dictionary} has too few markers",
            where=where,
            value=f"{needed} needed for {board.columns} × {board.rows} squares",
            limit=f"{held}",
            do="take a larger dictionary or fewer squares",
        )
    return board


def _get_side(table: Mapping[str, Any], key: str, *, where: str) -> float:
    """Return the side of a square or of a marker, mm."""
    # Printed ones have 5 to 60 mm, 0.005 to 0.06 in metres, those on glass 0.25 mm and more.
    return get_number(table, key, where=where, lower=0.1, upper=1e4, hint="give it in millimetres, not in metres")
