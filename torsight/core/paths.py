"""Paths that are refused before anything is read or written: nothing is there, it is no file, or it is an input."""

from __future__ import annotations

import contextlib
import difflib
import stat
from collections.abc import Iterable
from pathlib import Path

from torsight.core.errors import ConfigError, InputError


def missing_file(path: Path) -> InputError:
    """Return the error for a file that is not there, naming the nearest name in its folder."""
    near: list[str] = []
    with contextlib.suppress(OSError):
        names = [item.name for item in path.parent.iterdir() if item.name != path.name]
        near = difflib.get_close_matches(path.name, names, n=1)
    if path.is_symlink():
        return InputError("is a link that leads nowhere", where=str(path), do="mend the link, or name the file itself")
    hint = f"did you mean {near[0]}?" if near else "check the path"
    return InputError("no such file", where=str(path), do=hint)


def require_ordinary(path: Path) -> None:
    """Refuse a pipe, a socket or a device: reading it might never end. What is missing is told by who reads it.

    Raises
    ------
    InputError
        Saying that it is none of the files that can be read twice.
    """
    try:
        mode = path.stat().st_mode
    except OSError:
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError("is no ordinary file", where=str(path), do="save it to a file, and name that")


def require_apart(outputs: Iterable[Path], inputs: Iterable[Path | None]) -> None:
    """Refuse to write over a file that is read: an input is never replaced, by whatever name it is reached.

    Raises
    ------
    ConfigError
        Naming the first output that is an input.
    """
    read = [path for path in inputs if path is not None and path.exists()]
    for output in outputs:
        if output.exists() and any(output.samefile(path) for path in read):
            raise ConfigError(
                "would be written over, and it is an input",
                where=str(output),
                do="choose another --out, or give the input another name",
            )
