"""A line of the tables, and how its time is taken."""

import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from jerkbench.arrays import FloatArray

T = TypeVar("T")


class Line(NamedTuple):
    """One line of the table.

    Attributes:
        name: what ran.
        seconds: the smallest time; of many at once: divided by their number.
        base: that of the loop that it is compared with.
        difference: the largest difference of its results from that loop's.
    """

    name: str
    seconds: float
    base: float
    difference: float

    def __str__(self) -> str:
        """Name, time, ratio, agreement."""
        return (
            f"{self.name:<34}{self.seconds * 1e3:>10.2f} ms{self.base / self.seconds:>9.1f} x{self.difference:>12.1e}"
        )


class Absent(NamedTuple):
    """Stands in the table for a library that is not installed."""

    name: str
    package: str

    def __str__(self) -> str:
        """Name, and what to type."""
        return f"{self.name:<34}not installed: pip install {self.package}"


def smallest(run: Callable[[], object], repeats: int) -> float:
    """Return the smallest CPU time of ``run`` [s]; it ran once before, so that nothing is compiled in between."""
    run()
    return timed(run, repeats)[0]


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
