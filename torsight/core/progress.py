"""How long computations report their progress, and how long a person waits for a sign of it.

Stages take a callable and know nothing of terminals; the command line draws the bars.
"""

from __future__ import annotations

from typing import Final, Protocol

AT_ONCE_S: Final = 0.1
THOUGHT_S: Final = 10.0 * AT_ONCE_S
ATTENTION_S: Final = 10.0 * THOUGHT_S
"""What comes within the first seems to come at once, within the second no thought is broken off, and beyond the third a
person turns to something else (R. B. Miller, Proc. AFIPS Fall Joint Computer Conference 33 (1968) 267; J. Nielsen,
Usability Engineering, 1993, chapter 5: a tenth of a second, one and ten)."""
STUCK_S: Final = 6.0 * ATTENTION_S
"""A program of ours that shows no sign of life for so long has hung: each of its steps takes milliseconds, and a
computer that is busy with other things makes it wait for seconds."""


class Progress(Protocol):
    """Called by long work with what it does, how much is done and how much there is.

    ``total`` is None where the amount of work is not known beforehand.
    """

    def __call__(self, step: str, done: float, total: float | None) -> None:
        """Report that ``done`` of ``total`` units of ``step`` are finished."""


def silent(step: str, done: float, total: float | None) -> None:
    """Report nothing; the default of every stage."""
