"""``torsight calibrate``: pictures or films of a board to a camera file, for one camera or a stereo pair."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from torsight.cli.answer import Answer
from torsight.core.errors import ConfigError
from torsight.core.progress import Progress, silent

if TYPE_CHECKING:
    from calibration.boards.board_file import Board
    from calibration.stage import Calibration
    from torsight.core.optics.camera import Camera

_LISTS = ("--right", "--pose")


class Command(TyperCommand):
    """Lets ``--right`` and ``--pose`` take several files in a row, as a shell's wildcard gives them."""

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
        typer.Argument(
            metavar="IMAGES...", help="Pictures, folders or globs of them, or films, of the board.", show_default=False
        ),
    ] = None,
    *,
    board: Annotated[
        Path | None, typer.Option(metavar="BOARD.toml", help="The board; 'torsight board' makes one.")
    ] = None,
    out: Annotated[Path, typer.Option(metavar="CAMERA.toml", help="The camera file to write.")],
    right: Annotated[
        list[Path] | None,
        typer.Option(metavar="IMAGES...", help="The right camera's pictures or film, in the same order."),
    ] = None,
    pose: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="IMAGES...",
            help="The board lying on the disk: one picture, or several with the disk turned in between.",
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(metavar="CAMERA.toml", help="A camera that is known, to add a pose to; then without IMAGES."),
    ] = None,
    tracks: Annotated[
        Path | None,
        typer.Option(
            metavar="MARKERS.csv", help="With --camera: the axis from the markers' circles in a 'torsight track'."
        ),
    ] = None,
    stick_mm: Annotated[
        float | None, typer.Option(min=1e-3, help="With --tracks: distance of the moving stick's markers.")
    ] = None,
    base_z_mm: Annotated[float, typer.Option(help="Height of the base stick's markers above the board.")] = 0.0,
    moving_z_mm: Annotated[float, typer.Option(help="Height of the moving stick's markers above the board.")] = 0.0,
) -> Answer:
    """Calibrate one camera or two from pictures of a board, and find the pose of the rotation axis.

    Files in a row after --right and --pose belong to them: name IMAGES first. Beside the camera file a picture shows
    which parts of the view the board has covered. The camera file keeps the board, the pictures' hashes, the errors
    and a plain verdict.

    Example: torsight calibrate left*.jpg --board board.toml --right right*.jpg --out camera.toml
    """
    from torsight.cli.console import progress_bar, say
    from torsight.core.files.storage import read_toml

    if tracks is not None:
        for line in add_circles(tracks, camera, stick_mm=stick_mm, heights_mm=(base_z_mm, moving_z_mm), out=out):
            say(line)
        return Answer(read_toml(out), files=(out,))
    with progress_bar() as progress:
        lines = calibrate_to_file(
            images or [],
            board=board,
            right=right or [],
            pose=pose or [],
            camera=camera,
            heights_mm=(base_z_mm, moving_z_mm),
            out=out,
            progress=progress,
        )
    for line in lines:
        say(line)
    coverage = out.with_suffix(".coverage.png")
    return Answer(read_toml(out), files=(out, *([coverage] if images else [])))


def calibrate_to_file(
    images: list[Path],
    *,
    board: Path | None,
    out: Path,
    right: list[Path] | None = None,
    pose: list[Path] | None = None,
    camera: Path | None = None,
    heights_mm: tuple[float, float] = (0.0, 0.0),
    progress: Progress = silent,
) -> list[str]:
    """Write the camera file and the picture of the coverage; return what there is to say.

    ``heights_mm`` are those of the base and the moving stick's markers above a board on the disk.
    """
    from dataclasses import replace

    import tomli_w

    from calibration.boards.board_file import read_board
    from calibration.quality.camera_report import account, summary
    from calibration.quality.view_coverage import draw_coverage
    from calibration.stage import camera_of
    from torsight.core.files.paths import require_apart
    from torsight.core.files.storage import write_text
    from torsight.core.optics.camera import camera_content, read_camera

    _check_usage(images, right or [], pose or [], camera)
    if board is None:
        raise ConfigError(
            "needs --board BOARD.toml", where="torsight calibrate", do="make one with 'torsight board --out board.pdf'"
        )
    require_apart([out, out.with_suffix(".coverage.png")], [board, camera, *images, *(right or []), *(pose or [])])
    chosen = read_board(board)
    known = read_camera(camera) if camera else None
    result = _calibrated(images, right or [], chosen, progress=progress)
    result = _with_axis(result, pose or [], known, heights_mm=heights_mm, progress=progress)
    made = camera_of(result, known)
    made = replace(made, extra=account(result, earlier=dict(known.extra) if known else None))
    write_text(out, tomli_w.dumps(camera_content(made)))
    lines = summary(result)
    if result.left is not None:
        picture = out.with_suffix(".coverage.png")
        sides = [("left" if result.right else "camera", result.left)]
        draw_coverage(picture, sides + ([("right", result.right)] if result.right else []))
        lines.append(f"Coverage        {picture}")
    return [*lines, f"Camera file     {out}"]


def add_circles(
    tracks: Path, camera: Path | None, *, stick_mm: float | None, heights_mm: tuple[float, float], out: Path
) -> list[str]:
    """Write the known camera with the pose that the markers' circles show; return what there is to say."""
    from dataclasses import replace

    import tomli_w

    from calibration.axis.marker_circles import pose_from_tracks
    from torsight.core.files.paths import require_apart
    from torsight.core.files.storage import write_text
    from torsight.core.optics.camera import camera_content, read_camera

    if camera is None:
        raise ConfigError("needs a known --camera with --tracks", where="torsight calibrate")
    require_apart([out], [camera, tracks])
    known = read_camera(camera)
    found = pose_from_tracks(tracks, known, stick_mm=stick_mm, base_above_moving_mm=heights_mm[0] - heights_mm[1])
    account = dict(known.extra) | {"axis": found.account(tracks)}
    write_text(out, tomli_w.dumps(camera_content(replace(known, pose=found.pose, extra=account))))
    axis = account["axis"]
    lines = [
        f"Rotation axis   tilted by {axis['tilt_deg']:.2f}° to the line of sight, ± {axis['direction_sigma_deg']:.2f}°",
        f"  from          {axis['turned_deg']:.0f}° of the markers' circles",
    ]
    return [*lines, *(f"  note          {note}" for note in found.notes), f"Camera file     {out}"]


def _check_usage(images: list[Path], right: list[Path], pose: list[Path], camera: Path | None) -> None:
    where = "torsight calibrate"
    if images and camera:
        raise ConfigError("takes IMAGES or a known --camera, not both", where=where)
    if not images and not (camera and pose):
        raise ConfigError("needs IMAGES of a board, or a known --camera with --pose or --tracks", where=where)
    if right and (pose or camera):
        raise ConfigError(
            "takes no --pose for a stereo pair",
            where=where,
            do="leave it away: the axis of a pair is found from the tracks",
        )


def _calibrated(images: list[Path], right: list[Path], board: Board, *, progress: Progress) -> Calibration:
    from calibration.stage import Calibration, calibrate_one, calibrate_two

    if not images:
        return Calibration(board)
    if right:
        return calibrate_two(images, right, board, progress=progress)
    return calibrate_one(images, board, progress=progress)


def _with_axis(
    result: Calibration, pose: list[Path], known: Camera | None, *, heights_mm: tuple[float, float], progress: Progress
) -> Calibration:
    from dataclasses import replace

    from calibration.stage import camera_of, measure_axis

    if not pose:
        return result
    disk, seen = measure_axis(
        pose,
        result.board,
        camera_of(result, known).intrinsics,
        device=result.left.seen.device if result.left else str(_lens_account(known).get("device", "")),
        base_z_mm=heights_mm[0],
        moving_z_mm=heights_mm[1],
        progress=progress,
    )
    return replace(result, disk=disk, disk_seen=seen)


def _lens_account(known: Camera | None) -> Mapping[str, Any]:
    account = known.extra.get("left", {}) if known else {}
    return account if isinstance(account, Mapping) else {}
