"""``torsight calibrate``: pictures or films of a board to a camera file, for one camera or a stereo pair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option
from typer.core import TyperCommand

from torsight.cli.answer import Answer
from torsight.cli.console import progress_bar, say
from torsight.core.errors import ConfigError
from torsight.core.files.paths import require_apart
from torsight.core.files.storage import read_toml, write_text
from torsight.core.optics.camera import Camera, camera_content, read_camera
from torsight.core.progress import Progress

if TYPE_CHECKING:
    from calibration.stage import Calibration

_LISTS = ("--right", "--pose")
_WHERE = "torsight calibrate"


class TakesRows(TyperCommand):
    """Parser that lets ``--right`` and ``--pose`` take several files in a row, as a shell expands a wildcard."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option before every file that follows it."""
        return super().parse_args(ctx, _spread(args))


def _spread(words: list[str]) -> list[str]:
    """Return the words with ``--right a b`` written as ``--right a --right b``."""
    spread: list[str] = []
    option, taken = "", False
    for word in words:
        if word.startswith("-"):
            name = word.split("=", 1)[0]
            option, taken = (name if name in _LISTS else ""), "=" in word
            spread.append(word)
        elif option and taken:
            spread += [option, word]
        else:
            spread.append(word)
            taken = bool(option)
    return spread


def calibrate(
    images: Annotated[
        list[Path] | None,
        Argument(
            metavar="IMAGES...", help="Pictures, folders or globs of them, or films, of the board.", show_default=False
        ),
    ] = None,
    *,
    board: Annotated[Path | None, Option(metavar="BOARD.toml", help="The board; 'torsight board' makes one.")] = None,
    out: Annotated[Path, Option(metavar="CAMERA.toml", help="The camera file to write.")],
    right: Annotated[
        list[Path] | None, Option(metavar="IMAGES...", help="The right camera's pictures or film, in the same order.")
    ] = None,
    pose: Annotated[
        list[Path] | None,
        Option(
            metavar="IMAGES...",
            help="The board lying on the disk: one picture, or several with the disk turned in between.",
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        Option(metavar="CAMERA.toml", help="A camera that is known, to add a pose to; then without IMAGES."),
    ] = None,
    tracks: Annotated[
        Path | None,
        Option(metavar="MARKERS.csv", help="With --camera: the axis from the markers' circles in a 'torsight track'."),
    ] = None,
    stick_mm: Annotated[
        float | None, Option(min=1e-3, help="With --tracks: distance of the moving stick's markers.")
    ] = None,
    base_z_mm: Annotated[float, Option(help="Height of the base stick's markers above the board.")] = 0.0,
    moving_z_mm: Annotated[float, Option(help="Height of the moving stick's markers above the board.")] = 0.0,
) -> Answer:
    """Calibrate one camera or two from pictures of a board.

    With --pose or --tracks the pose of the rotation axis is found, too. Files in a row after --right and --pose
    belong to them: name IMAGES first. Beside the camera file a picture shows which parts of the view the board has
    covered. The camera file keeps the board, the pictures' hashes, the errors and a plain verdict.

    Example: torsight calibrate left*.jpg --board board.toml --right right*.jpg --out camera.toml
    """
    heights_mm = (base_z_mm, moving_z_mm)
    if tracks is not None:
        lines = _add_circles(tracks, camera, stick_mm=stick_mm, heights_mm=heights_mm, out=out)
    else:
        lines = _calibrate_to_file(
            images or [], board, right=right or [], pose=pose or [], camera=camera, heights_mm=heights_mm, out=out
        )
    say(*lines, f"Camera file     {out}")
    made = [out, *([_coverage_of(out)] if images and tracks is None else [])]
    return Answer(read_toml(out), files=made)


def _coverage_of(out: Path) -> Path:
    """Return the path of the picture of the coverage, beside a camera file."""
    return out.with_suffix(".coverage.png")


def _calibrate_to_file(
    images: list[Path],
    board: Path | None,
    *,
    right: list[Path],
    pose: list[Path],
    camera: Path | None,
    heights_mm: tuple[float, float],
    out: Path,
) -> list[str]:
    """Write the camera file and the picture of the coverage; return the lines for the terminal.

    ``heights_mm`` are the heights of the base and the moving stick's markers above a board on the disk.
    """
    from calibration.boards.board_file import read_board
    from calibration.quality.camera_report import account, draw_coverage, summary
    from calibration.stage import Calibration, calibrate_one, calibrate_two, camera_of

    _check_usage(images, right, pose, camera)
    if board is None:
        raise ConfigError("needs --board BOARD.toml", where=_WHERE, do="make one with 'torsight board --out board.pdf'")
    picture = _coverage_of(out)
    require_apart([out, picture], [board, camera, *images, *right, *pose])
    chosen = read_board(board)
    known = read_camera(camera) if camera else None
    with progress_bar() as progress:
        if right:
            result = calibrate_two(images, right, chosen, progress=progress)
        else:
            result = calibrate_one(images, chosen, progress=progress) if images else Calibration(chosen)
        if pose:
            result = _with_axis(result, pose, known, heights_mm=heights_mm, progress=progress)
    _write_camera(out, camera_of(result, known), account(result, earlier=dict(known.extra) if known else None))
    lines = summary(result)
    if result.left is not None:
        sides = [("left" if result.right else "camera", result.left)]
        draw_coverage(picture, sides + ([("right", result.right)] if result.right else []))
        lines.append(f"Coverage        {picture}")
    return lines


def _write_camera(out: Path, camera: Camera, account: Mapping[str, Any]) -> None:
    import tomli_w

    write_text(out, tomli_w.dumps(camera_content(replace(camera, extra=account))))


def _add_circles(
    tracks: Path, camera: Path | None, *, stick_mm: float | None, heights_mm: tuple[float, float], out: Path
) -> list[str]:
    """Write the known camera with the pose estimated from the markers' circles; return the lines for the terminal."""
    from calibration.axis import pose_from_tracks

    if camera is None:
        raise ConfigError("needs a known --camera with --tracks", where=_WHERE)
    require_apart([out], [camera, tracks])
    known = read_camera(camera)
    found = pose_from_tracks(tracks, known, stick_mm=stick_mm, base_above_moving_mm=heights_mm[0] - heights_mm[1])
    axis = found.account(tracks)
    _write_camera(out, replace(known, pose=found.pose), {**known.extra, "axis": axis})
    return [
        f"Rotation axis   tilted by {axis['tilt_deg']:.2f}° to the line of sight, ± {axis['direction_sigma_deg']:.2f}°",
        f"  from          {axis['turned_deg']:.0f}° of the markers' circles",
        *(f"  note          {note}" for note in found.notes),
    ]


def _check_usage(images: list[Path], right: list[Path], pose: list[Path], camera: Path | None) -> None:
    if images and camera:
        raise ConfigError("takes IMAGES or a known --camera, not both", where=_WHERE)
    if not images and not (camera and pose):
        raise ConfigError("needs IMAGES of a board, or a known --camera with --pose or --tracks", where=_WHERE)
    if right and (pose or camera):
        raise ConfigError(
            "takes no --pose for a stereo pair",
            where=_WHERE,
            do="leave it out: the axis of a pair is found from the tracks",
        )


def _with_axis(
    result: Calibration, pose: list[Path], known: Camera | None, *, heights_mm: tuple[float, float], progress: Progress
) -> Calibration:
    from calibration.stage import camera_of, measure_axis

    lens_account = known.extra.get("left") if known else None
    device = lens_account.get("device", "") if isinstance(lens_account, Mapping) else ""
    disk, seen = measure_axis(
        pose,
        result.board,
        camera_of(result, known).intrinsics,
        device=result.left.seen.device if result.left else str(device),
        base_z_mm=heights_mm[0],
        moving_z_mm=heights_mm[1],
        progress=progress,
    )
    return replace(result, disk=disk, disk_seen=seen)
