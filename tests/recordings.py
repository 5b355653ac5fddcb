"""Whether two recordings hold the same data; ids of rows and chunks, and times of logging, are stamps and left out."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from pathlib import Path

import pyarrow as pa
from rerun.chunk import RrdReader

STAMPS = ("log_time", "log_tick", "RecordingInfo:start_time")


def fingerprint(path: Path) -> dict[str, str]:
    """Return a hash per entity and column of a recording's data, however it was cut into chunks."""
    parts: dict[str, list[tuple[bytes, pa.Array]]] = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if name not in STAMPS and "RowId" not in name:
                parts[f"{chunk.entity_path} {name}"].append((chunk.id.encode(), column))
    found = {}
    for name, columns in sorted(parts.items()):
        digest = hashlib.sha256()
        for _, column in sorted(columns, key=lambda item: item[0]):
            for value in column:
                digest.update(repr(value.as_py()).encode())
        found[name] = digest.hexdigest()
    return found


def same_recording(one: Path, two: Path) -> bool:
    """Return whether two recordings hold the same data."""
    return fingerprint(one) == fingerprint(two)
