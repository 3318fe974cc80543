"""The progress of a sweep, with the time left."""

import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from jerkbench.execution.pulse import Pulse, duration
from jerkbench.plain import plain_output, styled


class Progress:
    """A bar over the cells of a sweep (or other things), on standard error; says how many runs diverged or failed.

    Where standard error is no terminal, a line a minute stands for it.
    """

    def __init__(self, count: int, already: int = 0, doing: str = "Sweep", unit: str = "cells") -> None:
        """Prepare a bar for ``count`` ``things``, of which ``already`` many are done."""
        self._counts: Counter[str] = Counter()
        self._doing, self._things = doing, unit
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(unit),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[trouble]}"),
        )
        self._bar = Bar(*columns, console=Console(file=styled(sys.stderr)))
        self._plain = ExitStack()
        self._left = count - already
        self._task = self._bar.add_task(doing, total=self._left, trouble="")
        self._pulse = None if self._bar.console.is_terminal else Pulse(self._line, self._write)
        if already:
            self._bar.console.print(f"{already} of {count} {unit} are done already.")

    def advance(self, statuses: Sequence[str] = ()) -> None:
        """Count one more, whose runs ended with ``statuses``."""
        self._counts.update(statuses)
        trouble = ", ".join(f"{self._counts[s]} runs {s}" for s in ("diverged", "failed") if self._counts[s])
        self._bar.update(self._task, advance=1, trouble=trouble)

    def __enter__(self) -> Self:
        """Start drawing, unless nothing is left to do."""
        if self._left:
            self._bar.start()
            self._plain.enter_context(plain_output())  # what is printed meanwhile goes through the bar
            if self._pulse:
                self._pulse.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop drawing."""
        if self._left:  # a bar that was never there would leave an empty line
            if self._pulse:
                self._pulse.__exit__(kind, error, trace)
            self._plain.close()
            self._bar.stop()

    def _line(self, seconds: float) -> str:
        """Return the progress as a line, for a reader of a file or a pipe."""
        task = self._bar.tasks[self._task]
        done = int(task.completed)
        remaining = f", about {duration(seconds / done * (self._left - done))} left" if done else ""
        trouble = f"; {task.fields['trouble']}" if task.fields["trouble"] else ""
        return f"{self._doing}: {done} of {self._left} {self._things} after {duration(seconds)}{remaining}{trouble}."

    def _write(self, line: str) -> None:
        self._bar.console.print(line, highlight=False, soft_wrap=True)
