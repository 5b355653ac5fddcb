"""numba's ``njit``, with machine code on the disk that is never older than the sources.

Compiled functions are put into their callers, and numba asks only whether the caller's own file has changed: after an
update in place, callers would go on with the old code of what they call. So whoever imports this looks whether any
source of a compiled function has changed since the code on the disk was made, and throws all of it away if so.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from numba import njit

__all__ = ["njit"]

_TORSIGHT: Final = Path(__file__).resolve().parents[1]
_FOLDERS: Final = (*(_TORSIGHT / name for name in ("actuator", "synthetic")), _TORSIGHT.parent / "tracker")
_WORDS: Final = (b"njit", b"compiled import")


def drop_outdated(folders: Iterable[Path], stamp: Path) -> bool:
    """Delete machine code below folders where their compiled sources are not those of the stamp; return whether."""
    folders = list(folders)
    made_of = hashlib.sha256()
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        content = path.read_bytes()
        if any(word in content for word in _WORDS):
            made_of.update(path.name.encode() + b"\0" + content)
    with contextlib.suppress(OSError):
        if stamp.read_text(encoding="ascii") == made_of.hexdigest():
            return False
    # Where nothing can be written nothing was kept either. Another process may be doing the same.
    with contextlib.suppress(OSError):
        for path in [path for folder in folders for path in folder.rglob("*.nb[ic]")]:
            path.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(made_of.hexdigest(), encoding="ascii")
    return True


drop_outdated(_FOLDERS, _TORSIGHT / "core" / "__pycache__" / "compiled.stamp")
