"""Work in a process beside this one, which leaves its result on the disk."""

import subprocess
import sys


def run_beside(code: str) -> None:
    """Start a process that runs ``code``, and do not wait for it; what it says is not shown.

    It outlives this one and its Ctrl-C: what it compiles is kept all the same.
    """
    nothing = subprocess.DEVNULL
    words = [sys.executable, "-c", code]
    subprocess.Popen(words, stdin=nothing, stdout=nothing, stderr=nothing, start_new_session=True)  # noqa: S603 - our own code
