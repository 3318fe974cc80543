"""Display of the progress of a sweep and of the estimated remaining time."""

import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from time import monotonic
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from jerkbench.errors import plain_output, styled

FIRST_S = 15.0
"""Time from the start until the first line is printed [s]."""

EVERY_S = 60.0
"""Interval between all later lines [s]."""


@contextmanager
def pulse(line: Callable[[float], str], write: Callable[[str], object] | None = None) -> Iterator[None]:
    """Print a line at intervals while the body of ``with`` runs, to show that the program is working.

    Args:
        line: Function that receives the elapsed time [s] and returns the line to print.
        write: Function that prints a line (by default, on standard error).
    """
    show = write or partial(print, file=sys.stderr, flush=True)
    ended, began = threading.Event(), monotonic()

    def beat() -> None:
        wait_s = FIRST_S
        while not ended.wait(wait_s):
            show(line(monotonic() - began))
            wait_s = EVERY_S

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def duration(seconds: float) -> str:
    """Return a duration as text in seconds, minutes or hours: "40 s", "3 min" or "2.5 h"."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 99.5 * 60 else f"{seconds / 3600:.1f} h"


class Progress:
    """A progress bar on standard error, with the number of runs that diverged or failed.

    If standard error is not a terminal, a line of text is printed after 15 s and then every minute, instead of the bar.
    """

    def __init__(self, count: int, doing: str = "Sweep", unit: str = "combinations") -> None:
        self._counts: Counter[str] = Counter()
        self._doing, self._things = doing, unit
        done = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
        times = (TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
        trouble, console = TextColumn("{task.fields[trouble]}"), Console(file=styled(sys.stderr))
        # A higher refresh rate would slow down the process, which also stores the rows.
        self._bar = Bar(*done, *times, trouble, console=console, refresh_per_second=2)
        self._stack = ExitStack()
        self._count = self._left = count
        self._task = self._bar.add_task(doing, total=self._left, trouble="")

    def advance(self, statuses: Sequence[str] = (), count: int = 1) -> None:
        """Advance the bar by ``count`` units (such as combinations), and count the statuses of the finished runs."""
        self._counts.update(statuses)
        trouble = ", ".join(f"{self._counts[s]} runs {s}" for s in ("diverged", "failed") if self._counts[s])
        self._bar.update(self._task, advance=count, trouble=trouble)

    def skip(self, count: int) -> None:
        """Subtract ``count`` units that are already complete from the total, and print a message with this number."""
        if count and self._left:
            self._left -= count
            self._bar.update(self._task, total=self._left)
            self._bar.console.print(f"{count} of {self._count} {self._things} are already complete.")

    def __enter__(self) -> Self:
        """Start the display of the progress bar. If all units are already complete, nothing is displayed."""
        if self._left:
            self._bar.start()  # without remaining units, the bar would print an empty line
            self._stack.callback(self._bar.stop)
            self._stack.enter_context(plain_output())  # rich prints other output above the bar
            if not self._bar.console.is_terminal:
                self._stack.enter_context(pulse(self._line, self._write))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _line(self, seconds: float) -> str:
        """Return the progress as a line of text, for output to a file or a pipe."""
        task = self._bar.tasks[self._task]
        done = int(task.completed)
        # an estimate from a few units would be inaccurate
        left = f", about {duration(seconds / done * (self._left - done))} left" if done > 0.05 * self._left else ""
        trouble = f"; {task.fields['trouble']}" if task.fields["trouble"] else ""
        return f"{self._doing}: {done} of {self._left} {self._things} after {duration(seconds)}{left}{trouble}."

    def _write(self, line: str) -> None:
        self._bar.console.print(line, highlight=False, soft_wrap=True)
