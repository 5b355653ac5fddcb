"""One writer at a time: a folder of results is filled by one process, however many are started on it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from torsight.core.errors import OutputError
from torsight.core.files.storage import not_written

try:
    import fcntl
except ImportError:  # a system without these locks: as before, the last writer wins
    fcntl = None  # type: ignore[assignment]

_NAME: Final = ".lock"
_LOOK_AGAIN_S: Final = 0.2
"""How often a lock that another process holds is asked for: a person does not notice the wait."""
_held: set[Path] = set()


@contextlib.contextmanager
def only_writer(folder: Path, *, patience_s: float = 10.0) -> Iterator[None]:
    """Be the only process that fills ``folder`` while the block lasts; inside another such block of it, do nothing.

    The lock goes with the process: one that was killed holds nothing.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    patience_s : float
        How long to wait for another process to end; long enough for what a killed campaign leaves behind.

    Raises
    ------
    OutputError
        When the folder cannot be written, or another process still fills it.
    """
    place = folder.resolve()
    if fcntl is None or place in _held:
        yield
        return
    handle = _locked(folder, patience_s=patience_s)
    _held.add(place)
    try:
        yield
    finally:
        _held.discard(place)
        (folder / _NAME).unlink(missing_ok=True)
        os.close(handle)


def _locked(folder: Path, *, patience_s: float) -> int:
    """Return an open file that holds the lock."""
    path = folder / _NAME
    until = time.monotonic() + patience_s
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise not_written(folder, error) from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
        except OSError:
            return handle  # a file system without locks
        else:
            # The one before may have removed the file between its being opened and locked here.
            with contextlib.suppress(FileNotFoundError):
                if path.stat().st_ino == os.fstat(handle).st_ino:
                    return handle
            os.close(handle)
            continue
        if time.monotonic() > until:
            raise OutputError(
                "is being filled by another torsight",
                where=str(folder),
                limit="one at a time",
                do="wait for it to end, or choose another --out folder",
            )
        time.sleep(_LOOK_AGAIN_S)
