"""Figures of matplotlib as files: format by suffix, identical bytes for identical figures."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from torsight.core.files.storage import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNDATED: Final = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {"Software": None}}
"""Metadata on matplotlib and the date that are left out, by format."""


def write_figure(path: Path, figure: Figure, **options: Any) -> None:
    """Write a figure; options are those of its ``savefig``."""
    suffix = path.suffix.lower()
    drawn = io.BytesIO()
    figure.savefig(drawn, format=suffix.removeprefix("."), metadata=UNDATED.get(suffix), **options)
    write_bytes(path, drawn.getvalue())
