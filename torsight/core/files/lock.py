"""One writer at a time: a folder of results is filled by one process, however many are started on it."""

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
    """Be the only process that fills ``folder`` while the block lasts; such blocks may be nested.

    The lock ends with the process: one that was killed holds nothing. Another process that holds it is waited for, as
    long as the workers of a killed campaign may take to end; then this one is refused.
    """
    path = folder.resolve() / _NAME
    lock = FileLock(path, is_singleton=True)
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
            # While it is held: who waits for it notices, and locks a new one. Windows removes no open file.
            with contextlib.suppress(PermissionError):
                path.unlink(missing_ok=True)
        lock.release()
