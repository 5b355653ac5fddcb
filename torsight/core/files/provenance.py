"""Provenance of a result: versions, inputs by hash, configuration as used, seed."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from torsight.core.errors import ConfigError
from torsight.core.files.paths import named_from, require_ordinary, unreadable

_PACKAGES: Final = (
    "torsight", "opencv-contrib-python-headless", "numpy", "scipy", "pandas", "numba", "av", "rerun-sdk",
)  # fmt: skip


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, read in blocks."""
    require_ordinary(path)
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def require_each_once(records: Iterable[Path]) -> None:
    """Refuse a record that is given twice, under whatever name."""
    seen: dict[str, Path] = {}
    for path in records:
        found = file_hash(path)
        if found in seen:
            raise ConfigError(
                "is the same record as another one",
                where=str(path),
                value=str(seen[found]),
                do="give every record once: the same one twice would count as two",
            )
        seen[found] = path


def versions() -> dict[str, str]:
    """Return the versions of Python, Torsight and the libraries that its numbers depend on."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def provenance(*, inputs: Iterable[Path], configuration: Mapping[str, Any], seed: int, folder: Path) -> dict[str, Any]:
    """Return the content of ``provenance.json`` in the ``folder`` of a run's results.

    Every input is hashed, folders file by file in the order of their names; the configuration is the one that was used,
    with defaults filled in. Paths are relative to ``folder``.
    """
    files: list[Path] = []
    for path in inputs:
        files += sorted(filter(Path.is_file, path.iterdir())) if path.is_dir() else [path]
    return {
        "command": "torsight run",
        "versions": versions(),
        "inputs": {named_from(folder, path): file_hash(path) for path in files},
        "configuration": dict(configuration),
        "seed": seed,
    }
