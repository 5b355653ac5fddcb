"""The interface by which long computations report their progress, and the waiting times that a person notices.

Stages take a callable and do not depend on terminals; the command line draws the progress bars.
"""

from __future__ import annotations

from typing import Final, Protocol

AT_ONCE_S: Final = 0.1
THOUGHT_S: Final = 10.0 * AT_ONCE_S
ATTENTION_S: Final = 10.0 * THOUGHT_S
"""A response within the first time seems immediate, within the second it does not interrupt a thought, and beyond the
third a person turns to something else (R. B. Miller, Proc. AFIPS Fall Joint Computer Conference 33 (1968) 267; J.
Nielsen, Usability Engineering, 1993, chapter 5: a tenth of a second, one and ten)."""
STUCK_S: Final = 6.0 * ATTENTION_S
"""Timeout after which a process of Torsight without a sign of life counts as hung: each of its steps takes
milliseconds, and a busy computer delays it by seconds."""


class Progress(Protocol):
    """Callable that long computations call with the name of the step, the finished units and their total.

    ``total`` is None where the amount of work is not known beforehand.
    """

    def __call__(self, step: str, done: float, total: float | None) -> None:
        """Report that ``done`` of ``total`` units of ``step`` are finished."""


def silent(step: str, done: float, total: float | None) -> None:
    """Report nothing; the default of every stage."""
