"""When a run counts as diverged, and the evaluation of one run: its status, its metrics, the columns of its row."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.contracts import Metric, Summarising
from jerkbench.errors import PluginError, RecordingError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import counted_rows, nothing_counts, position_error_m
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins.optional import has_methods
from jerkbench.recording import Recording
from jerkbench.sums import Streamed, Sums

LIMIT_M = 1000.0
"""A larger position error is a divergence, unless `divergence_limit_m` says otherwise; the frozen suite has its own."""


def run_status(estimate: Estimate, recording: Recording, limit_m: float) -> tuple[str, str]:
    """Return ("ok", "") or ("diverged", why).

    A run diverged if it stopped early, reached none of the reference's stamps, has a position or velocity (of one that
    estimates the attitude only: an angle) that is not finite, or a position error over ``limit_m`` on the axes that the
    reference knows (also where it is not scored).
    """
    reason = why_stopped(estimate) or _too_far(estimate, recording, limit_m)
    return ("diverged", reason) if reason else ("ok", "")


def strays(result: Streamed, limit_m: float) -> bool:
    """Whether a position error of a run without a trajectory was over ``limit_m``.

    Such a run is run alone and judged by `run_status`: a stricter rule there is asked for here, too.
    """
    return result.farthest_m2 > limit_m**2


def why_stopped(estimate: Estimate) -> str:
    """Return why the run stopped early, or an empty string."""
    if estimate.failure or len(estimate.index):
        return estimate.failure
    return "The run reached none of the reference's stamps."


def _too_far(estimate: Estimate, recording: Recording, limit_m: float) -> str:
    t_s = recording.reference.t_s[estimate.index]
    state = estimate.position_m if estimate.position_only else np.hstack([estimate.position_m, estimate.velocity_mps])
    finite = np.isfinite(estimate.euler_rad if estimate.attitude_only else state).all(axis=1)
    if not finite.all():
        return f"The state is not finite at {t_s[np.argmin(finite)]:.2f} s."
    with np.errstate(over="ignore"):
        distance_m = np.sqrt(np.nansum(position_error_m(estimate, recording) ** 2, axis=1))
    far = distance_m > limit_m
    if not far.any():
        return ""
    first = int(np.argmax(far))
    return f"The position error is {distance_m[first]:.0f} m at {t_s[first]:.2f} s; the limit is {limit_m:g} m."


# A run as its metrics see it, and what they say of it: the columns of its row in rows.csv.
#
# A new column is a new metric, one file in `metrics`, also where nothing of the estimate enters (`position_bound`);
# here the answers are only put together. What a row says of the run itself, `RUN`, is filled by
# `jerkbench.jobs.rows`, and asked for of stored rows by `jerkbench.jobs.parts`.

RUN = ("seed", "replicate", "status", "reason")
"""The columns of a run's row between its labels and its metrics."""

DRAWN = "drawn."
"""The columns of what a random drive drew begin so; they are no metrics."""

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
    return metric_values(metrics, Summary(estimate, counted, sums), recording, evaluate)


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


def metric_values(
    metrics: Iterable[Metric], summary: Summary, recording: Recording, evaluate: Evaluate
) -> dict[str, float]:
    """Return the values of all metrics by column name, each from the least that it needs, and what the drive drew.

    Raises:
        PluginError: two metrics give the same column.
    """
    estimate, counted, sums = summary

    def columns(metric: Metric) -> Mapping[str, float]:
        """Return the columns of one metric, from the sums where it can."""
        if sums is not None and has_methods(metric, Summarising):
            return metric.summarise(sums)
        return evaluate(metric, estimate, recording, counted)

    return {**gathered((metric, columns(metric)) for metric in metrics), **recording.parameters}


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
                raise PluginError(
                    f"The metrics {owners[column]} and {type(metric).__name__} both give the column '{column}'; rename"
                    " it in one of them, or leave one out."
                )
            values[column], owners[column] = float(value), type(metric).__name__
    return values
