"""A disk that is full, for tests: no file grows beyond a limit, as where that much is left."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from numba.core.caching import Cache


@contextmanager
def full_disk(limit_bytes: int) -> Iterator[None]:
    """Let no file grow beyond a limit while the block lasts; holds for root, too.

    Machine code is kept all the same: what is looked at is what the commands themselves write. Byte code is not written
    meanwhile: Python keeps a file that was cut off, and fails on it ever after.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    save = Cache.save_overload

    def save_all_the_same(cache: Cache, *arguments: Any) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        save(cache, *arguments)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, hard))

    resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, hard))
    try:
        with (
            patch.object(Cache, "save_overload", save_all_the_same),
            patch.object(sys, "dont_write_bytecode", new=True),
            patch.dict(os.environ, PYTHONDONTWRITEBYTECODE="1"),
        ):
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
