"""The processes of loky."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from jerkbench.clusters.connection import Connection
from jerkbench.clusters.executing import Executing
from jerkbench.clusters.extras import required


@dataclass(frozen=True)
class Loky(Executing):
    """Processes of this machine that loky starts; one that dies takes those beside it along, and new ones go on."""

    @contextmanager
    def connect(self, workers: int) -> Iterator[Connection]:
        """Start the processes."""
        loky = required("loky", "loky")
        yield _LokyConnection(partial(loky.ProcessPoolExecutor, workers, initializer=_ignore_interrupts), workers)


class _LokyConnection(Connection):
    executor: Any

    def close(self) -> None:
        """End the processes at once; what is done is stored."""
        self.executor.shutdown(wait=True, kill_workers=True)


def _ignore_interrupts() -> None:
    """Ctrl-C is for the sweep, which ends its processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
