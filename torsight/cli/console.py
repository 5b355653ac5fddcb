"""What the terminal shows: progress bars with the time left where someone watches, only the last lines where not."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator

from torsight.core.progress import Progress


@contextlib.contextmanager
def progress_bar() -> Iterator[Progress]:
    """Give a progress callable that draws bars with the time left on a terminal and is quiet elsewhere."""
    if not sys.stderr.isatty():
        yield lambda _step, _done, _total: None
        return
    from torsight.cli.bars import Bars

    bars = Bars()
    with bars.shown:
        yield bars.report


def say(text: str) -> None:
    """Print one line for the person at the terminal (standard error; results go to files)."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
