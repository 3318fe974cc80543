"""Comparison of clusters: CPU time, identical rows, and sweeps whose workers are killed.

    python benchmarks/clusters.py engines [CLUSTER ...]   experiment=paper, 20 seeds of 30 s, two workers: rows, CPU
    python benchmarks/clusters.py kills [COUNT]           SIGKILL of one of two Dask workers at random moments

The CPU time is the sum over all processes of a sweep. A sweep of two short combinations, one for each worker, measures
the CPU time of the start.
"""

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from pathlib import Path

MARK = "JERKBENCH_BENCHMARK"
TICKS = os.sysconf("SC_CLK_TCK")
PAPER = ("experiment=paper", "seeds=20", "dataset.duration_s=30", "report=false")
FAILED = 1
"""Exit code of a sweep with failed runs: the outages of `experiment=paper` start after 30 s."""
CELLS = 200
MANY = (f"noise.accel_mps2=range(0.1,{CELLS / 10 + 0.1:g},0.1)", "filter=jerk", "dataset.duration_s=30", "seeds=4")
SHORT = ("filter=gnss_only", "adaptation=none", "disturbance=none,imu_bias", "dataset.duration_s=12", "seeds=1")
"""A sweep with one combination for each of two workers."""


def start(folder: Path, *words: str, **environment: str) -> subprocess.Popen[bytes]:
    """Start a sweep in ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "jerkbench", "run", "-m", *words, "figures=false", "study=s", "results=."]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(command, cwd=folder, env={**os.environ, **environment}, **quiet)  # noqa: S603 - fixed


def swept(folder: Path, *words: str) -> tuple[float, float]:
    """Run a sweep, and return its CPU time and its elapsed time [s].

    Raises:
        RuntimeError: the sweep ended with an unexpected exit code.
    """
    mark, began, spent = uuid.uuid4().hex, time.monotonic(), {}
    process = start(folder, *words, **{MARK: mark})
    while process.poll() is None:
        spent |= spending(mark)
        time.sleep(0.5)
    if process.returncode not in (0, FAILED):
        raise RuntimeError(f"{' '.join(words)} ended with {process.returncode}")
    return sum(spent.values()), time.monotonic() - began


def spending(mark: str) -> dict[int, float]:
    """Return the CPU time [s] of each process that has ``mark`` in its environment."""
    spent = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes():
                    numbers = (folder / "stat").read_text().rpartition(")")[2].split()
                    spent[int(folder.name)] = (int(numbers[11]) + int(numbers[12])) / TICKS
            except OSError:
                continue
    return spent


def digest(folder: Path) -> str:
    """Return a hash of the rows of a sweep."""
    return hashlib.sha256((folder / "s" / "rows.csv").read_bytes()).hexdigest()[:16]


def compared(folder: Path, place: Path) -> str:
    """Return a text that states whether the rows are identical to the rows of the undisturbed sweep."""
    return "identical" if digest(folder) == digest(place / "whole") else "DIFFERENT"


def stored(folder: Path) -> int:
    """Return the number of stored files with combinations."""
    return len(list((folder / "s" / "cells").glob("*.parquet")))


def engines(place: Path, clusters: list[str]) -> None:
    """Compare each cluster with the local process pool."""
    swept(place / "warm", *PAPER, "cluster=local", "workers=2")  # caches the recordings and the machine code
    print("cluster      CPU [s]     start [s]    without start / local elapsed [s]   rows")
    own = 0.0
    for name in ("local", *clusters):
        begin, _ = swept(place / f"{name}1", *SHORT, f"cluster={name}", "workers=2")
        cpu_s, clock_s = swept(place / name, *PAPER, f"cluster={name}", "workers=2")
        own = own or cpu_s - begin
        rows = digest(place / name)
        print(
            f"{name:<8} {cpu_s:11.1f} {begin:13.1f} {(cpu_s - begin) / own:24.2f} {clock_s:11.1f}   {rows}", flush=True
        )


def kills(place: Path, count: int) -> None:
    """Kill one of two workers at a random moment of a sweep, ``count`` times."""
    swept(place / "whole", *MANY, "cluster=local", "workers=2")
    chance = random.Random(1)  # noqa: S311 - not for cryptography
    for number in range(count):
        folder = place / f"kill{number}"
        at = chance.randrange(1, CELLS // 2)
        with dask_site(folder) as (address, workers):
            process = start(folder, *MANY, "cluster=dask", f"cluster.address={address}")
            while process.poll() is None and stored(folder) < at:
                time.sleep(0.005)
            done = stored(folder)
            os.kill(workers[number % 2].pid, signal.SIGKILL)
            code = process.wait()
        same = digest(folder) == digest(place / "whole")
        print(
            f"killed after {done} stored files: exit code {code}, rows {'identical' if same else 'DIFFERENT'}",
            flush=True,
        )


class dask_site:  # noqa: N801 - used as a function
    """A Dask scheduler and two workers."""

    def __init__(self, folder: Path) -> None:
        """Set the working folder of the processes."""
        self.folder, self.processes = folder, []
        folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> tuple[str, list[subprocess.Popen[bytes]]]:
        """Start the processes, and return the address of the scheduler and the workers."""
        file = self.folder / "scheduler.json"
        common = ("--scheduler-file", str(file), "--no-dashboard")
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", *common)
        for _ in range(2):
            self._start("worker", "--nthreads", "1", "--no-nanny", *common)
        while not file.exists() or not file.read_text().strip().endswith("}"):
            time.sleep(0.05)
        return json.loads(file.read_text())["address"], self.processes[1:]

    def __exit__(self, *_: object) -> None:
        """Kill the processes."""
        for process in self.processes:
            process.kill()
            process.wait()

    def _start(self, kind: str, *words: str) -> None:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words]
        self.processes.append(subprocess.Popen(command, cwd=self.folder, **quiet))  # noqa: S603 - fixed


def main(kind: str, *more: str) -> None:
    """Run the benchmark ``kind``."""
    with tempfile.TemporaryDirectory() as place:
        if kind == "engines":
            engines(Path(place), list(more) or ["dask"])
        else:
            kills(Path(place), int(more[0]) if more else 5)


if __name__ == "__main__":
    main(*(sys.argv[1:] or ["engines"]))
