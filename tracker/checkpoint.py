"""Checkpoints of an unfinished track on disk: rows that are appended, and the follower's state.

The state is replaced atomically after its rows are flushed to the disk, and rows beyond it are truncated when a track
is resumed; so a track that was killed at any moment resumes from a consistent state.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from torsight.core.errors import OutputError, reason_of
from torsight.core.files.storage import write_json
from torsight.core.progress import THOUGHT_S
from tracker.rows import ROW

EVERY_S: Final = THOUGHT_S
"""Least time between two checkpoints: a kill costs as much, and to write one takes milliseconds."""
_SAMPLE: Final = 1 << 20
"""Bytes at either end of a file that its fingerprint covers."""


def source_key(paths: list[Path], *, settings: dict[str, Any]) -> str:
    """Return a fingerprint of the inputs: names, sizes, the ends of the first and the last file, and the settings.

    It includes the tracker's own code, with which the state of the follower may change its meaning.
    """
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    for number, path in enumerate(paths):
        size = path.stat().st_size if path.exists() else 0
        digest.update(f"{path.name}:{size};".encode())
        if size == 0 or 0 < number < len(paths) - 1:
            continue
        with path.open("rb") as file:
            digest.update(file.read(_SAMPLE))
            if size > 2 * _SAMPLE:
                file.seek(-_SAMPLE, os.SEEK_END)
                digest.update(file.read(_SAMPLE))
    return digest.hexdigest()


class Kept:
    """An object whose attributes named in ``kept`` are stored exactly in a checkpoint."""

    kept: ClassVar[tuple[str, ...]] = ()

    def to_state(self) -> dict[str, Any]:
        """Return the complete state for :meth:`restore`."""
        return {name: _packed(getattr(self, name)) for name in self.kept}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a saved state exactly; the object has to be made from the same first frames."""
        for name in self.kept:
            setattr(self, name, _unpacked(state[name], getattr(self, name)))


def _packed(value: Any) -> Any:
    """Return a value serialised for JSON: arrays as their bytes, without loss of precision."""
    if isinstance(value, Kept):
        return value.to_state()
    if isinstance(value, np.ndarray):
        return {"type": value.dtype.str, "shape": value.shape, "bytes": base64.b64encode(value.tobytes()).decode()}
    return [_packed(one) for one in value] if isinstance(value, (list, tuple)) else value


def _unpacked(value: Any, now: Any) -> Any:
    """Return a value from its serialised form; ``now`` is the present value, which gives the type of records.

    An object of :class:`Kept` is restored in place.
    """
    if isinstance(now, Kept):
        now.restore(value)
        return now
    if isinstance(value, dict):
        records = isinstance(now, np.ndarray) and now.dtype.names
        array = np.frombuffer(base64.b64decode(value["bytes"]), now.dtype if records else value["type"])
        return array.reshape(value["shape"]).copy()
    if isinstance(value, list):
        before = now if isinstance(now, list) and len(now) == len(value) else [None] * len(value)
        return [_unpacked(*pair) for pair in zip(value, before, strict=True)]
    return value


class RowStore:
    """Rows of a film that is being tracked; in memory, or in a folder from which the track can be resumed.

    A checkpoint of other inputs, whose fingerprint is not ``key``, is not resumed.
    """

    def __init__(self, folder: Path | None, *, key: str = "") -> None:
        self._folder = folder
        self._key = key
        self._last_s = time.monotonic()
        self._rows = bytearray()
        self.saved = 0

    def resume(self) -> dict[str, Any] | None:
        """Return the state of the last checkpoint of the same inputs, and truncate the rows to it; None without one."""
        if self._folder is None:
            return None
        try:
            content = json.loads(self._state_path.read_text(encoding="utf-8"))
            rows = np.fromfile(self._rows_path, ROW, count=int(content["rows"]))
            state: dict[str, Any] = content["state"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if content.get("key") != self._key or len(rows) != content["rows"]:
            return None
        self.saved, self._rows = len(rows), bytearray(rows.tobytes())
        os.truncate(self._rows_path, self.saved * ROW.itemsize)
        return state

    def begin(self) -> None:
        """Start a new track: earlier checkpoints in the folder are deleted."""
        if self._folder is None:
            return
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._state_path.unlink(missing_ok=True)
            self._rows_path.write_bytes(b"")
        except OSError as error:
            raise _not_kept(self._folder, error) from error

    def add(self, row: NDArray[np.void]) -> None:
        """Add the row of the next frame."""
        self._rows += row.tobytes()

    @property
    def due(self) -> bool:
        """Whether it is time for a checkpoint."""
        return self._folder is not None and time.monotonic() - self._last_s >= EVERY_S

    def checkpoint(self, state: dict[str, Any]) -> None:
        """Write all rows so far, and the state, to the disk."""
        if self._folder is None:
            return
        try:
            with self._rows_path.open("ab") as file:
                file.write(self._rows[self.saved * ROW.itemsize :])
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise _not_kept(self._folder, error) from error
        self.saved = len(self._rows) // ROW.itemsize
        write_json(self._state_path, {"key": self._key, "rows": self.saved, "state": state})
        self._last_s = time.monotonic()

    def rows(self) -> NDArray[np.void]:
        """Return all rows in the order of the frames."""
        return np.frombuffer(bytearray(self._rows), ROW)

    @property
    def _state_path(self) -> Path:
        return (self._folder or Path()) / "state.json"

    @property
    def _rows_path(self) -> Path:
        return (self._folder or Path()) / "rows.bin"


def drop(folder: Path) -> None:
    """Remove the checkpoints of a finished track."""
    shutil.rmtree(folder, ignore_errors=True)


def _not_kept(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        f"checkpoints cannot be written ({reason_of(error)})",
        where=str(folder),
        do="choose another folder, or free space and rights there",
    )
