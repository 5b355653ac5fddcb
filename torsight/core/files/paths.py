"""Paths: order, suffixes, checks before reading or writing; and this computer's own address."""

from __future__ import annotations

import contextlib
import difflib
import glob
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from torsight.core.errors import ConfigError, InputError, reason_of

AnyPath = str | os.PathLike[str]
"""A path as a string or a path object."""

LOOPBACK: Final = "127.0.0.1"
"""The address under which a computer reaches itself and no other one reaches it: all servers listen here."""

PICTURE_SUFFIXES: Final = (
    ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".webp", ".jp2",
)  # fmt: skip
"""Suffixes of files that are read as pictures; another file is taken as a film, or ignored in a folder."""


def named_from(folder: Path, path: AnyPath) -> str:
    """Return the name of a file, or a glob, that a file in ``folder`` gives it: both may be moved together.

    Links in the folder's own path are followed, so that ``..`` leads up where the folder really lies.
    """
    return os.path.relpath(path, os.path.realpath(folder))


def is_glob(name: AnyPath) -> bool:
    """Return whether a name is a glob pattern."""
    return any(character in str(name) for character in "*?[")


def matching(pattern: Path) -> list[Path]:
    """Return the files and folders that match a glob, absolute or not, in the order of :func:`in_order`."""
    # glob.glob, not Path.glob: the pattern may be absolute, and hidden files are left out.
    return in_order(Path(name) for name in glob.glob(str(pattern)))  # noqa: PTH207


def files_named(source: AnyPath) -> list[Path]:
    """Return the pictures of a folder, the files that match a glob (both in order), or the one ordinary file.

    Raises InputError for a name that leads to none of them, and for what :func:`require_ordinary` refuses.
    """
    path = Path(source)
    if path.is_dir():
        return in_order(item for item in path.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES)
    if path.exists():
        require_ordinary(path)
        return [path]
    if is_glob(source):
        return matching(path)
    if "://" in str(source):
        do = "save the film to a file, and name that; 'torsight live' follows a stream of this computer"
        raise InputError("is an address, not a file", where=str(source), do=do)
    raise missing_file(path)


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Return paths sorted by name, with numbers in names sorted by value: ``img_2`` comes before ``img_10``."""

    def parts(path: Path) -> list[str | int]:
        # Text and digits alternate, so that text is compared with text and numbers with numbers.
        return [int(part) if turn % 2 else part for turn, part in enumerate(re.split(r"([0-9]+)", str(path)))]

    # First by name: paths that differ in leading zeros alone would keep the order of the disk.
    return sorted(sorted(paths), key=parts)


def missing_file(path: Path) -> InputError:
    """Return the error for a missing file; the message gives the most similar name in its folder."""
    near: list[str] = []
    with contextlib.suppress(OSError):
        names = [item.name for item in path.parent.iterdir() if item.name != path.name]
        # By stem, since equal suffixes are no likeness: one like it with the same suffix, or the same with another.
        alike = [name for name in names if Path(name).suffix == path.suffix or Path(name).stem == path.stem]
        stems = {Path(name).stem: name for name in alike}
        near = [stems[stem] for stem in difflib.get_close_matches(path.stem, stems, n=1)]
    if path.is_symlink():
        return InputError("is a link that leads nowhere", where=str(path), do="mend the link, or name the file itself")
    hint = f"did you mean {near[0]}?" if near else "check the path"
    return InputError("no such file", where=str(path), do=hint)


def unreadable(path: Path, error: OSError) -> InputError:
    """Return the error for a file that could not be read: that it is missing, or the reason."""
    if not path.exists():
        return missing_file(path)
    return InputError(f"cannot be read ({reason_of(error)})", where=str(path))


def require_file(path: Path) -> None:
    """Refuse a folder, and what :func:`require_ordinary` refuses."""
    if path.is_dir():
        raise InputError("is a folder, not a file", where=str(path), do="name the file in it")
    require_ordinary(path)


def require_ordinary(path: Path) -> None:
    """Refuse what has the name of a file but not its content; a missing file is left to its reader.

    That is a pipe, a socket or a device, whose reading might never end, and a Git LFS pointer.
    """
    try:
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise InputError("is no ordinary file", where=str(path), do="save it to a file, and name that")
        with path.open("rb") as file:
            head = file.read(len(_POINTER))
    except OSError:
        return
    if head == _POINTER:
        raise InputError(
            "is a Git LFS pointer: the file itself was not downloaded",
            where=str(path),
            value=f"a text of {path.stat().st_size} bytes",
            do="get it with 'git lfs pull' in the repository that it comes from",
        )


_POINTER: Final = b"version https://git-lfs.github.com/spec/"
"""Beginning of a Git LFS pointer: a text of some 130 bytes in place of a file that is stored elsewhere."""


def require_apart(outputs: Iterable[Path], inputs: Iterable[Path | None]) -> None:
    """Refuse to overwrite an input file, under whatever name the output reaches it."""
    read = [path for path in inputs if path is not None and path.exists()]
    for output in outputs:
        if output.exists() and any(output.samefile(path) for path in read):
            raise ConfigError(
                "would be written over, and it is an input",
                where=str(output),
                do="choose another --out, or give the input another name",
            )
