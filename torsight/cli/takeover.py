"""Angles that are there already, as those of a live record, in the place of a track."""

from __future__ import annotations

import shutil
from pathlib import Path

from torsight.core.files.storage import atomic_path
from torsight.core.files.tables import read_angles, write_angles


def take_over(angle: Path, *, out: Path) -> None:
    """Bring ``angle.csv``, and ``markers.csv`` and ``track.json`` where they lie beside it, into a run's folder.

    That may be the folder in which the angles lie.
    """
    if angle.resolve() != (out / "angle.csv").resolve():
        write_angles(out / "angle.csv", read_angles(angle))
    for name in ("markers.csv", "track.json"):
        beside, target = angle.parent / name, out / name
        if beside.is_file() and beside.resolve() != target.resolve():
            with atomic_path(target) as temporary:
                shutil.copyfile(beside, temporary)
