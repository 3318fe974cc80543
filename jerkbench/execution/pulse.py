"""A sign of life from work that has nothing to show yet: a line after a quarter of a minute, then one a minute."""

import sys
import threading
from collections.abc import Callable
from time import monotonic
from types import TracebackType
from typing import Self

FIRST_S = 15.0
EVERY_S = 60.0


class Pulse:
    """Says from a thread of its own that the work inside ``with`` goes on."""

    def __init__(
        self,
        line: Callable[[float], str],
        write: Callable[[str], object] | None = None,
        first_s: float = FIRST_S,
        every_s: float = EVERY_S,
    ) -> None:
        """Prepare to say ``line`` of the seconds that have passed, on standard error or by ``write``."""
        self._line, self._write = line, write or _to_standard_error
        self._first_s, self._every_s = first_s, every_s
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Self:
        """Begin to count."""
        self._began = monotonic()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Say no more."""
        self._ended.set()
        self._thread.join()

    def _beat(self) -> None:
        wait_s = self._first_s
        while not self._ended.wait(wait_s):
            self._write(self._line(monotonic() - self._began))
            wait_s = self._every_s


def duration(seconds: float) -> str:
    """Return a time as a person says it: 40 s, 3 min, 2.5 h."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 99.5 * 60 else f"{seconds / 3600:.1f} h"


def _to_standard_error(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()
