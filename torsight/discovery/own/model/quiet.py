"""Text that a model prints: reported once, and not written to the terminal at each of thousands of calls."""

from __future__ import annotations

import contextlib
import io
import sys
import threading
from collections.abc import Iterator

from torsight.core.progress import Progress

_progress = threading.local()


class Heard(io.TextIOBase):
    """A text stream that keeps the first line."""

    def __init__(self) -> None:
        super().__init__()
        self.beginning = ""
        self._before = sys.stdout

    def write(self, text: str) -> int:
        """Capture a text; what a progress callable prints is passed on."""
        if getattr(_progress, "tells", False):
            return self._before.write(text)
        if "\n" not in self.beginning.lstrip():
            self.beginning += text
        return len(text)

    def note(self, *, elsewhere: str = "") -> str | None:
        """Return a warning with the first line that was printed, None where nothing was."""
        text = self.beginning.strip() or elsewhere.strip()
        if not text:
            return None
        first = text.splitlines()[0]
        return f"the model prints ('{first}', …): that was kept from the terminal, and it takes time in every call"


@contextlib.contextmanager
def heard() -> Iterator[Heard]:
    """Capture what is printed within the block."""
    stream = Heard()
    with contextlib.redirect_stdout(stream):
        yield stream


def aloud(progress: Progress) -> Progress:
    """Return a progress callable whose printing is not captured."""

    def reported(step: str, done: float, total: float | None) -> None:
        # Of this thread alone: the model may print in others meanwhile.
        _progress.tells = True
        try:
            progress(step, done, total)
        finally:
            _progress.tells = False

    return reported
