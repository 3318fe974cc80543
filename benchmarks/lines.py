"""A line of the tables, and how its time is taken."""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from jerkbench.arrays import FloatArray

T = TypeVar("T")


class Line(NamedTuple):
    """One line of the table.

    Attributes:
        name: what ran.
        seconds: its time; of many at once: divided by their number.
        ratio: how many times faster than what it is compared with.
        difference: the largest difference of its results from that one's.
    """

    name: str
    seconds: float
    ratio: float
    difference: float

    def __str__(self) -> str:
        """Name, time, ratio, agreement."""
        return f"{self.name:<34}{self.seconds * 1e3:>10.2f} ms{self.ratio:>9.1f} x{self.difference:>12.1e}"


class Entrant(NamedTuple):
    """What is timed.

    Attributes:
        name: what stands in the table.
        run: runs it.
        often: how often in a round. The median of these counts, because the first finds the caches full of others.
        runs: how many runs it makes at once. Of more than one, the mean of all but the first counts, if there are
            others: a sweep lasts, and a system may give a second core only to what lasts.
        difference: as in `Line`.
    """

    name: str
    run: Callable[[], object]
    often: int
    runs: int
    difference: float


class Absent(NamedTuple):
    """Stands in the table for a library that is not installed."""

    name: str
    package: str

    def __str__(self) -> str:
        """Name, and what to type."""
        return f"{self.name:<34}not installed: pip install {self.package}"


def in_rounds(entrants: Sequence[Entrant], rounds: int) -> list[Line]:
    """Time all ``entrants``, one after the other, ``rounds`` times; the first is what the others are compared with.

    A line has the medians over the rounds of the time that passed and of the ratio to the first in the same round: so
    the machine may be now fast, now slow, and nobody gains from it.
    """
    for entrant in entrants:
        entrant.run()  # nothing is compiled in between
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
    """Return the smallest CPU time of ``run`` [s], and what it returned the last time."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        result = run()
        times.append(time.process_time() - begin)
    return min(times), result


def apart(got: FloatArray, wanted: FloatArray) -> float:
    """Return the largest difference."""
    return float(np.abs(got - wanted).max())
