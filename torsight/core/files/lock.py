"""A lock on folders of results: only one process at a time fills a folder."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from filelock import FileLock, Timeout

from torsight.core.errors import OutputError
from torsight.core.files.storage import not_written

_NAME: Final = ".lock"


@contextlib.contextmanager
def only_writer(folder: Path, *, patience_s: float = 10.0) -> Iterator[None]:
    """Lock ``folder`` for this process within the block; such blocks may be nested.

    The lock ends with the process, also if it is killed. If another process holds the lock, this one waits for
    ``patience_s``, as long as the workers of a killed campaign may take to end, and then raises OutputError.
    """
    path = folder.resolve() / _NAME
    lock = FileLock(path, is_singleton=True)
    was_there = path.parent.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire(timeout=patience_s)
    except Timeout as error:
        raise OutputError(
            "is being filled by another torsight",
            where=str(folder),
            limit="one at a time",
            do="wait for it to end, or choose another --out folder",
        ) from error
    except OSError as error:
        raise not_written(folder, error) from error
    try:
        yield
    finally:
        if lock.lock_counter == 1:
            # Removed while it is held: a waiting process notices and locks a new file. Windows removes no open file.
            with contextlib.suppress(PermissionError):
                path.unlink(missing_ok=True)
            if not was_there:
                # A command that failed leaves no empty folder.
                with contextlib.suppress(OSError):
                    path.parent.rmdir()
        lock.release()
