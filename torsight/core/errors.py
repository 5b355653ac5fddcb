"""The kinds of failure and how each is reported.

Every error that a user can cause is a :class:`TorsightError`. Its message states what is wrong, where, which value was
found, which is allowed and what to do. The command line prints it on one line and exits with its exit code.
"""

from __future__ import annotations

import functools
import os
import unicodedata
from typing import Any, ClassVar, Final

_MOST_OF_A_VALUE: Final = 160
"""Characters of a value that a message shows: two lines of a terminal."""


class TorsightError(Exception):
    """Base of all errors that Torsight raises on purpose.

    Parameters
    ----------
    what : str
        What is wrong, as a clause.
    where : str, optional
        File, line, row, frame, column or key.
    value : object, optional
        The value that was found.
    limit : str, optional
        The value or range that is allowed.
    do : str, optional
        What the user can do about it.
    """

    exit_code: ClassVar[int] = 4

    def __init__(
        self,
        what: str,
        *,
        where: str | None = None,
        value: object = None,
        limit: str | None = None,
        do: str | None = None,
    ) -> None:
        self.what = what
        self.where = where
        self.value = value
        self.limit = limit
        self.do = do
        super().__init__(what)

    def __str__(self) -> str:
        parts = [f"{self.where}: {self.what}" if self.where else self.what]
        if self.value is not None:
            found = str(self.value)
            parts.append(f"found {found if len(found) <= _MOST_OF_A_VALUE else f'{found[:_MOST_OF_A_VALUE]}…'}")
        if self.limit is not None:
            parts.append(f"allowed {self.limit}")
        if self.do is not None:
            parts.append(self.do)
        # Control characters of a damaged file would move the cursor or colour the terminal.
        return "".join("�" if unicodedata.category(one).startswith("C") else one for one in "; ".join(parts))

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        # Errors are pickled by worker processes: keep the keyword-only fields.
        kept = {name: getattr(self, name) for name in ("where", "value", "limit", "do")}
        return functools.partial(type(self), self.what, **kept), ()


class ConfigError(TorsightError, ValueError):
    """Wrong usage or configuration: an unknown key, a value out of range, a missing option (exit code 2)."""

    exit_code: ClassVar[int] = 2


class InputError(TorsightError, ValueError):
    """An input file that cannot be used: missing, unreadable, without a needed column (exit code 3)."""

    exit_code: ClassVar[int] = 3


class OutputError(TorsightError, OSError):
    """An output that cannot be written: no right to the folder, a full disk (exit code 3)."""

    exit_code: ClassVar[int] = 3


def reason_of(error: Any) -> str:
    """Return the reason in the message of an OSError, or of an error of PyAV, without number and path."""
    return str(error.strerror or error)


def refused_by_system(error: OSError) -> InputError:
    """Return an :class:`InputError` for an error of the system (a name too long, no right to a file, a full disk)."""
    refused = InputError(
        f"the system refuses it ({reason_of(error)})",
        where=str(error.filename) if error.filename is not None else None,
        do="check the path, the rights and the free space; earlier files are untouched",
    )
    refused.__cause__ = error
    return refused


def require_kind(value: object, kind: type, *, where: str, do: str) -> None:
    """Refuse an argument of a call in Python that is no object of the class ``kind``, such as a path instead."""
    if not isinstance(value, kind):
        met = repr(value) if isinstance(value, (str, os.PathLike)) else type(value).__name__
        raise ConfigError(f"is no {kind.__name__}", where=where, value=met, limit=kind.__name__, do=do)


class NoResultError(TorsightError, RuntimeError):
    """Valid inputs without a result: no marker, no motion, no convergence (exit code 4)."""
