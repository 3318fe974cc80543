"""A run as its metrics see it, and what they say of it: the columns of its row in rows.csv.

A new column is a new metric, one file in `metrics`, also where nothing of the estimate enters (`position_bound`); here
the answers are only put together. What a row says of the run itself, `RUN`, is filled by
`jerkbench.jobs.rows`, and asked for of stored rows by `jerkbench.results.parts`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from jerkbench.arrays import BoolArray
from jerkbench.contracts import Metric, Summarising
from jerkbench.errors import PluginError, RecordingError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import counted_rows, nothing_counts
from jerkbench.evaluation.divergence import why_stopped
from jerkbench.evaluation.sums import sums_of
from jerkbench.recording import Recording
from jerkbench.sums import Sums

RUN = ("seed", "replicate", "status", "reason")
"""The columns of a run's row between its labels and its metrics."""

Evaluate = Callable[[Metric, Estimate, Recording, BoolArray], Mapping[str, float]]


def evaluated(metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray) -> Mapping[str, float]:
    """Return what ``metric`` says, in the units of its columns' names."""
    return metric.evaluate(estimate, recording, counted)


def evaluate_run(
    estimate: Estimate,
    recording: Recording,
    burn_in_s: float,
    metrics: Sequence[Metric],
    evaluate: Evaluate = evaluated,
) -> dict[str, float]:
    """Return the values of all metrics by column name; of a run that stopped before a row counted, they are NaN.

    Args:
        estimate: what the filter made of the recording.
        recording: with the reference.
        burn_in_s: errors count from then on [s].
        metrics: which.
        evaluate: asks a metric that needs more than sums; a caller may know some answers already.

    Raises:
        RecordingError: no row counts, though the run did not stop early.
        PluginError: two metrics give the same column.
    """
    counted = counted_rows(estimate, recording, burn_in_s)
    if not counted.any() and not why_stopped(estimate):
        raise RecordingError(nothing_counts(recording, burn_in_s))
    summarised = any(isinstance(metric, Summarising) for metric in metrics)
    sums = sums_of(estimate, recording, counted) if summarised else None
    return values_of(metrics, Summary(estimate, counted, sums), recording, evaluate)


class Summary(NamedTuple):
    """A run as metrics see it, whether its trajectory was kept or not.

    Attributes:
        estimate: as much of it as was kept.
        counted: (k,) which of its rows count.
        sums: of the run; None where no metric asks for them.
    """

    estimate: Estimate
    counted: BoolArray
    sums: Sums | None


def values_of(
    metrics: Iterable[Metric], summary: Summary, recording: Recording, evaluate: Evaluate
) -> dict[str, float]:
    """Return the values of all metrics by column name, each from the least that it needs.

    Raises:
        PluginError: two metrics give the same column.
    """
    estimate, counted, sums = summary

    def columns(metric: Metric) -> Mapping[str, float]:
        """Return the columns of one metric, from the sums where it can."""
        if sums is not None and isinstance(metric, Summarising):
            return metric.summarise(sums)
        return evaluate(metric, estimate, recording, counted)

    return gathered((metric, columns(metric)) for metric in metrics)


def gathered(results: Iterable[tuple[Metric, Mapping[str, float]]]) -> dict[str, float]:
    """Return the columns of all metrics.

    Raises:
        PluginError: two metrics give the same column.
    """
    values: dict[str, float] = {}
    owners: dict[str, str] = {}
    for metric, columns in results:
        for column, value in columns.items():
            if column in values:
                raise PluginError(_taken(column, owners[column], type(metric).__name__))
            values[column], owners[column] = float(value), type(metric).__name__
    return values


def _taken(column: str, owner: str, second: str) -> str:
    return (
        f"The metrics {owner} and {second} both give the column '{column}'; rename it in one of them, or leave one out."
    )
