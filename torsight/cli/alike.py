"""Records that are to be explained together: each once, and all of one rig as far as their files say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from torsight.core.errors import ConfigError, InputError
from torsight.core.files.provenance import file_hash
from torsight.core.files.storage import read_json


def require_one_rig(records: Sequence[Path]) -> None:
    """Refuse a record that is given twice, and records whose runs used different actuator files.

    Which file a run used stands in the ``provenance.json`` beside its table, with the file's hash. Records without one
    are taken as they are. One file that all runs have used may have been edited since.
    """
    seen: dict[str, Path] = {}
    for path in records:
        found = file_hash(path)
        if found in seen:
            raise ConfigError(
                "is the same record as another one",
                where=str(path),
                value=str(seen[found]),
                do="give every record once: twice the same one would count as two witnesses",
            )
        seen[found] = path
    actuators = [(path, used) for path in records if (used := _actuator_of(path)) is not None]
    for path, (name, found) in actuators[1:]:
        first, (first_name, first_found) = actuators[0]
        if found != first_found:
            raise InputError(
                "is a record of another actuator",
                where=str(path),
                value=f"{name}, {found[:12]} (SHA-256)",
                limit=f"{first_name}, {first_found[:12]}, as {first}",
                do="give records of one rig; where it is one, run them again with one actuator file",
            )


def _actuator_of(record: Path) -> tuple[str, str] | None:
    """Return name and hash of the actuator file that a record's run has used; None where nothing says it."""
    path = record.parent / "provenance.json"
    if not path.is_file():
        return None
    content = read_json(path)
    configuration, inputs = content.get("configuration"), content.get("inputs")
    table = configuration.get("actuator") if isinstance(configuration, dict) else None
    name = table.get("file") if isinstance(table, dict) else None
    if not isinstance(name, str) or not isinstance(inputs, dict) or not isinstance(inputs.get(name), str):
        return None
    return name, inputs[name]
