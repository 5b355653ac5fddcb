"""How long work reports where it stands.

Stages take a callable and know nothing of terminals; the command line draws the bars.
"""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called by long work with what it does, how much is done and how much there is.

    ``total`` is None where the amount of work is not known beforehand.
    """

    def __call__(self, step: str, done: float, total: float | None) -> None:
        """Report that ``done`` of ``total`` units of ``step`` are finished."""


def silent(step: str, done: float, total: float | None) -> None:
    """Report nothing; the default of every stage."""
