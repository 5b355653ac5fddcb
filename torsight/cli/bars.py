"""Progress bars for a terminal: the step, the elapsed time, and the time left at the mean pace."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TaskID, TextColumn
from rich.progress import TimeElapsedColumn as ElapsedColumn
from rich.text import Text

_UNKNOWN = "-:--:-- left"


class LeftColumn(ProgressColumn):
    """The time left, from the mean pace since the step began: rich's own estimate fails for updates a minute apart."""

    def render(self, task: Task) -> Text:
        """Return hours, minutes and seconds, counting down between two reports; empty for a finished step."""
        if task.finished:
            return Text("")
        now_s, total = task.elapsed, task.total
        if now_s is None or total is None or task.completed <= 0.0:
            return Text(_UNKNOWN)
        reported_s = task.fields["reported_s"]
        left_s = round(max(0.0, reported_s * (total / task.completed - 1.0) - (now_s - reported_s)))
        return Text(f"{left_s // 3600}:{left_s // 60 % 60:02d}:{left_s % 60:02d} left")


class Bars:
    """One bar for each step that has been reported; ``now`` gives the time, s."""

    def __init__(self, *, now: Callable[[], float] = time.monotonic) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), ElapsedColumn(), LeftColumn())
        self.shown = Progress(*columns, console=Console(stderr=True), transient=True, get_time=now)
        self._tasks: dict[str, TaskID] = {}

    def report(self, step: str, done: float, total: float | None) -> None:
        """Move the bar of a step."""
        if step not in self._tasks:
            self._tasks[step] = self.shown.add_task(step, total=total, reported_s=0.0)
        place = self._tasks[step]
        task = next(one for one in self.shown.tasks if one.id == place)
        if done < task.completed:
            # The same kind of work begins again: the estimate of its time left starts anew, too.
            self.shown.reset(place)
        self.shown.update(place, completed=done, total=total, reported_s=task.elapsed or 0.0)
