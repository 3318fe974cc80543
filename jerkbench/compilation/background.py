"""Work in a process beside this one, which leaves its result on the disk."""

import subprocess
import sys
from typing import Final

RUNNING: Final[list[subprocess.Popen[bytes]]] = []
"""Kept, for Python warns of a process whose object goes while it runs."""


def run_beside(code: str) -> None:
    """Start a process that runs ``code``, and do not wait for it; what it says is not shown.

    It outlives this one and its Ctrl-C: what it compiles is kept all the same.
    """
    nothing = subprocess.DEVNULL
    words = [sys.executable, "-c", code]
    process = subprocess.Popen(words, stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True)  # noqa: S603 - our own code
    RUNNING.append(process)
