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
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    tasks: dict[str, TaskID] = {}
    reached: dict[str, float] = {}
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:

        def report(step: str, done: float, total: float | None) -> None:
            if step not in tasks:
                tasks[step] = bars.add_task(step, total=total)
            elif done < reached[step]:
                # The same kind of work begins once more: its time left starts anew, too.
                bars.reset(tasks[step])
            reached[step] = done
            bars.update(tasks[step], completed=done, total=total)

        yield report


def say(text: str) -> None:
    """Print one line for the person at the terminal (standard error; results go to files)."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
