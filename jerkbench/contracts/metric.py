"""The contract of a metric."""

from typing import ClassVar, Literal, Protocol, runtime_checkable

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.recording import Recording
from jerkbench.sums import Sums


class Metric(Protocol):
    """A number, or a few, from one run; optional: `Summarising`, `Reading`, `OnRequest`.

    A cell all of whose metrics are `Summarising` or `Reading` runs without storing trajectories, which is many times
    faster.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the values by column name (unit included); NaN where it does not apply.

        ``counted`` (k,) says which rows of the estimate count: the reference is scored there, after the burn-in.
        """
        ...


@runtime_checkable
class Summarising(Protocol):
    """A metric that needs no more of a run than its sums."""

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return what `Metric.evaluate` does, from sums over the run alone."""
        ...


@runtime_checkable
class Reading(Protocol):
    """A metric that looks at less than all of the estimate: ``index`` and ``euler_rad``, or these and ``updates``."""

    reads: ClassVar[Literal["attitude", "updates"]]


@runtime_checkable
class OnRequest(Protocol):
    """A metric that is only computed where it is asked for (``metrics=[name]``), if the attribute is False."""

    default: ClassVar[bool]
