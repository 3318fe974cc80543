"""A Dask scheduler and workers as processes of their own, which a test may kill."""

import contextlib
import json
import subprocess
import sys
import time
from pathlib import Path

from commands import environment


@contextlib.contextmanager
def dask_site(folder, workers=2):
    """Start them; yields the scheduler's address, its process, and the workers' processes."""
    with contextlib.ExitStack() as stack:
        address_file = Path(folder) / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder, "env": environment()}

        def start(*words):
            process = subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], **quiet)
            stack.callback(_end, process)
            return process

        common = ("--scheduler-file", str(address_file), "--no-dashboard")
        scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", *common)
        several = [
            start(
                "worker",
                "--nthreads",
                "1",
                "--no-nanny",
                "--death-timeout",
                "120",
                "--local-directory",
                folder,
                *common,
            )
            for _ in range(workers)
        ]
        yield _address(address_file, scheduler), scheduler, several


def _address(file, scheduler):
    while scheduler.poll() is None:
        with contextlib.suppress(FileNotFoundError, ValueError):
            return json.loads(file.read_text())["address"]
        time.sleep(0.05)
    raise AssertionError("The scheduler has ended.")


def _end(process):
    process.kill()
    process.wait()
