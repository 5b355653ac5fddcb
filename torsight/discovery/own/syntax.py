"""Whether a model file is Python, before the modules that use it are imported, which takes seconds."""

from __future__ import annotations

import ast
from pathlib import Path

from torsight.core.errors import InputError
from torsight.core.files.storage import read_bytes


def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a model file.

    Raises InputError when the file is missing, no Python file by its name, or not Python, with the line.
    """
    source = read_bytes(path)
    if path.suffix != ".py":
        raise InputError("is no Python file", where=str(path), limit="a name that ends in .py")
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) and error.lineno else ""
        what = f"cannot be imported: {type(error).__name__}: {error.args[0]}"
        raise InputError(what, where=f"{path}{line}", do="correct the file") from error
