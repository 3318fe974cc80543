"""The mean of one sample with its interval."""

from typing import NamedTuple

from jerkbench.evaluation.intervals import Samples, mean_intervals


class Interval(NamedTuple):
    """A mean with the ends of its interval."""

    mean: float
    low: float
    high: float


def mean_interval(values, confidence=0.95):
    """The mean of independent values and its interval."""
    return Interval(*(float(of[0]) for of in mean_intervals(Samples.of([values]), confidence)))
