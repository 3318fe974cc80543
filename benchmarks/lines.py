"""Lines of the tables, and the measurement of their times."""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from jerkbench.arrays import FloatArray

T = TypeVar("T")


class Line(NamedTuple):
    """One line of the table.

    Attributes:
        name: name of the entrant.
        seconds: time of one run. The time of a batch is divided by its number of runs.
        ratio: time of the first entrant divided by the time of this entrant.
        difference: largest difference between the results of this entrant and of the reference implementation.
    """

    name: str
    seconds: float
    ratio: float
    difference: float

    def __str__(self) -> str:
        """Return the name, the time, the ratio and the difference."""
        return f"{self.name:<34}{self.seconds * 1e3:>10.2f} ms{self.ratio:>9.1f} x{self.difference:>12.1e}"


class Entrant(NamedTuple):
    """An implementation that is timed.

    Attributes:
        name: name in the table.
        run: function that is timed.
        often: number of repetitions in a round. The time is the median of the repetitions, because the caches contain
            the data of other entrants at the first repetition.
        runs: number of runs in a batch. If ``runs`` is greater than 1, the time is the mean of all repetitions except
            for the first, as in a long sweep: the operating system may assign a second core only to a long task.
        difference: as in `Line`.
    """

    name: str
    run: Callable[[], object]
    often: int
    runs: int
    difference: float


class Absent(NamedTuple):
    """Line of the table for a library that is not installed."""

    name: str
    package: str

    def __str__(self) -> str:
        """Return the name and the command that installs the library."""
        return f"{self.name:<34}not installed: pip install {self.package}"


def in_rounds(entrants: Sequence[Entrant], rounds: int) -> list[Line]:
    """Return the times of all entrants, and their ratios to the first entrant.

    Each of the ``rounds`` times all entrants one after the other. A line contains the median elapsed time, and the
    median over the rounds of the ratio in the same round. Therefore, a change in the speed of the machine between
    rounds has the same effect on all entrants.
    """
    for entrant in entrants:
        entrant.run()  # compiles before the first measurement
    seconds = np.array([[_elapsed(entrant) for entrant in entrants] for _ in range(rounds)])
    ratios = np.median(seconds[:, :1] / seconds, axis=0)
    return [
        Line(entrant.name, float(time_s), float(ratio), entrant.difference)
        for entrant, time_s, ratio in zip(entrants, np.median(seconds, axis=0), ratios, strict=True)
    ]


def _elapsed(entrant: Entrant) -> float:
    times = []
    for _ in range(entrant.often):
        begin = time.perf_counter()
        entrant.run()
        times.append(time.perf_counter() - begin)
    return float(np.median(times) if entrant.runs == 1 else np.mean(times[1:] or times)) / entrant.runs


def timed(run: Callable[[], T], repeats: int) -> tuple[float, T]:
    """Return the minimum CPU time of ``run`` [s] over the repeats, and the result of the last repeat."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        result = run()
        times.append(time.process_time() - begin)
    return min(times), result


def apart(got: FloatArray, wanted: FloatArray) -> float:
    """Return the largest absolute difference."""
    return float(np.abs(got - wanted).max())
