"""From files to views: detection of the board in every picture, and selection among a film's frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from calibration.boards.board_file import Board
from calibration.views.detect import View, board_normals, find_board, goes_on, other_boards_seen
from calibration.views.picture_files import (
    MOST_FILM_VIEWS,
    Picture,
    expand,
    film_step,
    is_film,
    read_pictures,
    require_same_camera,
)
from torsight.core.errors import InputError, NoResultError
from torsight.core.files.paths import AnyPath
from torsight.core.parallel.threads import one_thread
from torsight.core.progress import Progress, silent
from torsight.core.units import Floats
from torsight.core.words.shown import Shown

_BLURRED: Final = 1.5
"""Width of edges, relative to that of the sharpest fifth, above which frames are skipped: at this limit corners err by
a tenth more, with edges of twice the width 2.2 times as much (boards of benchmarks/calibration/constants.py)."""
_LEAST_DIFFERENCE: Final = 0.05
"""Least difference of a frame from the chosen ones: a twentieth of the picture's width, or 3° of tilt."""
_LOOKED_AT_FOR_OTHER_BOARDS: Final = 2
"""Number of pictures that are searched for another board, some seconds each, before the board is reported as not found:
in total about as long as a person waits (:data:`~torsight.core.progress.ATTENTION_S`)."""
_BEYOND_THE_BOARD: Final = 0.25
"""Largest share of views in which a chessboard may seem to continue, because the background can look like squares. Of
drawn boards 97 % of the larger ones seem to continue and no complete one (benchmarks/calibration/constants.py)."""


@dataclass(frozen=True, slots=True)
class Source:
    """A picture that was searched: its name, the hash of its file, and the outcome.

    ``index`` is its index in the list of pictures; ``note`` is empty where the board was found and may be used.
    """

    name: str
    sha256: str
    index: int
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Seen(Shown):
    """All views of a board in one camera's pictures, in the order of the pictures.

    ``sources`` are all pictures that were searched, of a film only the chosen frames; every ``step``-th frame was
    searched. ``size_px`` is the pictures' size, ``device`` camera and focal length, if the files state them.
    """

    views: tuple[View, ...]
    sources: tuple[Source, ...]
    size_px: tuple[int, int]
    device: str
    step: int

    def facts(self) -> dict[str, str]:
        """Return the number of pictures that show the board, their size and their camera."""
        facts = {
            "views": f"{len(self.views)} of {len(self.sources)} pictures",
            "size": f"{self.size_px[0]} × {self.size_px[1]} px",
        }
        return facts | ({"camera": self.device} if self.device else {})

    def _columns(self) -> dict[str, Any]:
        """Return one row per picture: its name, the number of its corners, and the note on it."""
        corners = {view.index: len(view.corners_px) for view in self.views}
        return {
            "picture": [source.name for source in self.sources],
            "corners": [corners.get(source.index, 0) for source in self.sources],
            "note": [source.note for source in self.sources],
        }

    def _draw(self, axes: Any) -> None:
        for view in self.views:
            axes.plot(*np.reshape(view.corners_px, (-1, 2)).T, ".", markersize=2)
        axes.set(xlim=(0.0, self.size_px[0]), ylim=(self.size_px[1], 0.0))
        axes.set(xlabel="x, px", ylabel="y, px", aspect="equal")


def find_views(
    paths: Sequence[AnyPath],
    board: Board,
    *,
    step: int | None = None,
    only: frozenset[int] | None = None,
    progress: Progress = silent,
) -> Seen:
    """Return the views of the board in pictures, films, folders or globs.

    Of films every ``step``-th frame is searched, by default a number that depends on their length; ``only`` restricts
    the search to some indices in the list of pictures, for the second camera of a pair.

    Raises InputError when a file cannot be read or two pictures differ in size or camera; NoResultError when no picture
    shows the board; the message names another board that is seen instead.
    """
    files = expand(paths)
    films = any(is_film(path) for path in files)
    step = step or film_step(files)
    total = None if films else len(files)
    found: list[View] = []
    sources: list[Source] = []
    suspects: list[Picture] = []
    beyond = 0
    first: Picture | None = None
    hashes: dict[str, str] = {}
    with one_thread():
        for index, picture in enumerate(read_pictures(files, step=step)):
            first = first or picture
            require_same_camera(first, picture)
            progress("looking for the board", index + 1, total)
            if only is not None and index not in only:
                continue
            if not picture.group and picture.sha256 in hashes:
                note = f"the same picture as {hashes[picture.sha256]}"
                sources.append(Source(picture.name, picture.sha256, index, note))
                continue
            hashes[picture.sha256] = picture.name
            view = find_board(picture.grey, board, name=picture.name, index=index, quick=bool(picture.group))
            if view is not None:
                found.append(view)
                beyond += goes_on(picture.grey, board)
            elif len(suspects) < _LOOKED_AT_FOR_OTHER_BOARDS:
                suspects.append(picture)
            if view is not None or not picture.group:
                note = "" if view is not None else "the board was not found"
                sources.append(Source(picture.name, picture.sha256, index, note))
    if first is None:
        raise InputError("holds no frame", where=str(files[0]), do="record it again")
    if not found and only is None:
        raise _no_board(board, suspects, files)
    if beyond > _BEYOND_THE_BOARD * len(found):
        raise _does_not_fit(board, "the chessboard goes on beyond the corners that are counted", beyond)
    views = _chosen(found) if films else found
    kept = {view.index for view in views}
    return Seen(
        views=tuple(views),
        sources=tuple(source for source in sources if source.note or source.index in kept),
        size_px=first.size_px,
        device=first.device,
        step=step,
    )


def _no_board(board: Board, pictures: Sequence[Picture], files: Sequence[Path]) -> NoResultError:
    for picture in pictures:
        other = other_boards_seen(picture.grey, board)
        if other is not None:
            return _does_not_fit(board, f"{picture.name} shows {other}", None)
    return NoResultError(
        "no picture shows the board",
        where=f"{files[0]}{f' and {len(files) - 1} more' if len(files) > 1 else ''}",
        limit=f"{board.describe()}, whole and with its white border"
        if board.kind == "chessboard"
        else board.describe(),
        do="check BOARD.toml, light and focus; show the board larger, unobstructed, without glare",
    )


def _does_not_fit(board: Board, seen: str, count: int | None) -> NoResultError:
    return NoResultError(
        "the board does not fit BOARD.toml",
        value=seen + (f" (in {count} pictures)" if count else ""),
        limit=board.describe(),
        do="count again (chessboard: inner corners; ChArUco: squares) and mend columns, rows or dictionary",
    )


def _chosen(views: Sequence[View]) -> list[View]:
    """Return sharp frames that differ most from each other, in the order of the film.

    Starting from the sharpest frame, the next is always the one farthest from all frames chosen so far, by position and
    size in the picture and by the board's tilt.
    """
    edges = np.array([view.edge_px for view in views])
    # The sharpest fifth: a single frame may look sharper than the lens is.
    sharp = [view for view in views if view.edge_px <= _BLURRED * np.quantile(edges, 0.2)]
    traits = _traits(sharp)
    chosen = [int(np.argmin([view.edge_px for view in sharp]))]
    while len(chosen) < min(MOST_FILM_VIEWS, len(sharp)):
        distance = np.linalg.norm(traits[:, None] - traits[chosen], axis=2).min(axis=1)
        if distance.max() < _LEAST_DIFFERENCE:
            break
        chosen.append(int(np.argmax(distance)))
    return [sharp[place] for place in sorted(chosen)]


def _traits(views: Sequence[View]) -> Floats:
    """Return position, size and tilt (n, 5) in comparable units: picture widths, powers of two, sines."""
    width = np.ptp(np.concatenate([view.corners_px for view in views]), axis=0).max()
    centre = np.array([view.corners_px.mean(axis=0) for view in views]) / width
    size = np.array([np.linalg.norm(np.ptp(view.corners_px, axis=0)) for view in views]) / width
    return np.concatenate((centre, np.log2(size)[:, None], board_normals(views)[:, :2]), axis=1)
