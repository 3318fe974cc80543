"""Evaluation of a run: the sums of its errors, its status, and the metrics in its row of rows.csv."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.contracts import Metric, Summarising, has_methods, part_read
from jerkbench.errors import PluginError, RecordingError
from jerkbench.estimate import ErrorWeights, Estimate, Streamed, Sums, scored_trajectory
from jerkbench.evaluation.counted_rows import (
    Rows,
    counted_rows,
    counting,
    known_axes,
    nothing_counts,
    position_error_m,
    rows_at,
)
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline


@dataclass(frozen=True, eq=False)
class PreparedReference:
    """The reference of a recording, prepared for all runs over one timeline, or for a single trajectory.

    Attributes:
        scoring: weights of the errors, which the engine reads.
        rows: rows that count for each metric.
        counted: (k,) whether each row counts.
        outline: estimate with known ``index`` and ``euler_rad``. Its other values may be NaN.
    """

    scoring: ErrorWeights
    rows: Rows
    counted: BoolArray
    outline: Estimate

    @cached_property
    def errors_only(self) -> ErrorWeights:
        """The weights for runs in which no metric reads covariances."""
        return replace(self.scoring, marks=self.rows.outages.ravel(), consistency=False)

    @cached_property
    def positions_only(self) -> ErrorWeights:
        """The weights for runs in which no metric reads covariances or velocities."""
        return replace(self.errors_only, moving=np.zeros_like(self.scoring.moving))

    @cached_property
    def constant_sums(self) -> dict[str, Any]:
        """The fields of `Sums` that are equal for all runs: numbers of counted rows, distances covered in outages."""
        rows = self.rows
        return {
            "position_rows": rows.position.sum(axis=1).astype(np.float64),
            "velocity_rows": rows.velocity.sum(axis=1).astype(np.float64),
            "rows_with_burn_in": float(rows.with_burn_in.sum()),
            "nees_rows": float(rows.both.sum()),
            "outage_rows": float(rows.outage.sum()),
            "outage_driven_m": rows.outages_driven_m,
        }


def sums_of(estimate: Estimate, recording: Recording, counted: BoolArray) -> Sums:
    """Return the sums of the errors of a trajectory over its ``counted`` (k,) rows."""
    rows = counting(estimate.index, recording, counted)
    prepared = PreparedReference(error_weights(recording, estimate.index, rows), rows, counted, estimate)
    sums = sums_from(scored_trajectory(estimate, prepared.scoring), prepared, recording)
    if (rows.position == rows.position[0]).all() and (rows.velocity == rows.velocity[0]).all():
        return sums
    errors = [scored_trajectory(estimate, replace(prepared.scoring, counted=on)) for on in rows.position.astype(float)]
    speeds = [scored_trajectory(estimate, replace(prepared.scoring, moving=on)) for on in rows.velocity.astype(float)]
    return sums._replace(
        position_m2=np.diagonal([_over_axes(sums_of_axis.position_m2) for sums_of_axis in errors]),
        velocity_m2ps2=np.diagonal([_over_axes(sums_of_axis.velocity_m2ps2)[_MOVING] for sums_of_axis in speeds]),
    )


class Summed(ABC):
    """A metric that is computed from the sums of the errors of a run, without the trajectory."""

    reads_covariance: ClassVar[bool] = True
    """True if the metric reads sums of e' P^-1 e or sampled errors. If False, these values may be NaN or empty."""
    reads_velocity: ClassVar[bool] = True
    """True if the metric reads sums of velocity errors. If False, these sums may be NaN."""

    @abstractmethod
    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the values of the metric by column name."""

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the values of the metric for a trajectory, by column name."""
        return self.summarise(sums_of(estimate, recording, counted))


def sums_from(streamed: Streamed, prepared: PreparedReference, recording: Recording) -> Sums:
    """Return the sums of a run. All axes of the reference must be known at the same rows, for position and velocity."""
    rows, constant = prepared.rows, prepared.constant_sums
    ends = rows.outages.size
    pairs = streamed.marked_m[:ends].reshape(-1, 2, 3)
    return Sums(
        **constant,
        **{name: getattr(streamed, name) for name in _SAME_SUMS},
        position_m2=_over_axes(streamed.position_m2),
        position_max_m=math.sqrt(streamed.largest_m2) if constant["position_rows"][0] else float("nan"),
        velocity_m2ps2=_over_axes(streamed.velocity_m2ps2)[_MOVING],
        outage_ends_m=_lengths_m(pairs[:, 1]) if ends else np.empty(0),
        outage_drifts_mps=_drifts_mps(pairs, rows.outages_s) if ends else np.empty(0),
        outages=len(recording.outages_s),
        sampled_m=streamed.marked_m[ends:],
        sampled_m2=streamed.marked_m2[ends:],
    )


_SAME_SUMS = tuple(name for name in Sums._fields if name in Streamed._fields[2:])
"""Fields that `Sums` and `Streamed` have in common, except the sums of position and velocity.

`Streamed` contains the sums of position and velocity separately for each axis.
"""


def error_weights(recording: Recording, index: IntArray, rows: Rows) -> ErrorWeights:
    """Return the weights of the errors at the rows ``index`` (k,) of the reference.

    ``rows`` defines which rows of ``index`` count for each metric.
    """
    reference = recording.reference
    truth = np.zeros((len(index), 6))
    if reference.enu_m is not None:
        truth[:, :3] = np.nan_to_num(rows_at(reference.enu_m, index))
    if reference.velocity_mps is not None:
        truth[:, 3:] = np.nan_to_num(rows_at(reference.velocity_mps, index))
    return ErrorWeights(
        truth,
        rows.position[0].astype(np.float64),
        rows.with_burn_in.astype(np.float64),
        rows.velocity[0].astype(np.float64),
        rows.outage.astype(np.float64),
        np.concatenate([rows.outages.ravel(), rows.sampled]),
        rows.start_s,
    )


def _over_axes(squares: FloatArray) -> FloatArray:
    """Return the sum of squares (5,) for each of POSITION_AXES, from the sums of squares (3,) of the single axes."""
    east, north, up = squares.tolist()
    return np.array([east + north + up, east + north, east, north, up])


_MOVING = np.array([0, 1, 4])
"""Index in POSITION_AXES of each of VELOCITY_AXES."""


def _lengths_m(error_m: FloatArray) -> FloatArray:
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.sqrt((error_m**2).sum(axis=1)))


def _drifts_mps(error_m: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return |e_last - e_first|/(t_last - t_first) (j,) [m/s] of pairs of errors (j, 2, 3) at times (j, 2)."""
    with np.errstate(all="ignore"):
        grown = np.linalg.norm(error_m[:, 1] - error_m[:, 0], axis=1)
        return np.asarray(grown / np.where(t_s[:, 1] > t_s[:, 0], t_s[:, 1] - t_s[:, 0], np.nan))


def can_stream(metric: Metric) -> bool:
    """Return whether the metric can be computed without storing a trajectory."""
    return has_methods(metric, Summarising) or part_read(metric) != "everything"


def prepare_reference(
    recording: Recording, timeline: Timeline, burn_in_s: float, limit_m: float = math.inf
) -> PreparedReference | None:
    """Return the prepared reference for runs over ``timeline``, or None if their evaluation needs trajectories.

    A trajectory is needed if the reference has no position at a stamp, if some axes of its velocity are unknown at a
    counted row, or if no row counts. Errors count after ``burn_in_s`` [s]. A run diverges if its position error exceeds
    ``limit_m`` [m].
    """
    index = timeline.reference[timeline.reference >= 0]
    outline = outlined(index, timeline.euler_rad[index])
    counted = counted_rows(outline, recording, burn_in_s)
    rows = counting(outline.index, recording, counted)
    located = known_axes(recording.reference.enu_m, outline.index).all()
    if not (located and counted.any() and (rows.velocity == rows.velocity[0]).all()):
        return None
    scoring = replace(error_weights(recording, outline.index, rows), limit_m=float(limit_m))
    return PreparedReference(scoring, rows, counted, outline)


def outlined(index: IntArray, euler_rad: FloatArray) -> Estimate:
    """Return an estimate at rows ``index`` (k,) of the reference, with NaN as position, velocity and covariance."""
    unknown = np.broadcast_to(np.nan, (len(index), 6, 6))
    return Estimate(index, unknown[:, 0, :3], unknown[:, 0, :3], unknown, euler_rad)


LIMIT_M = 1000.0
"""Default of ``divergence_limit_m``: a run with a larger position error diverged.

The frozen suite uses a different limit.
"""


def run_status(estimate: Estimate, recording: Recording, limit_m: float) -> tuple[str, str]:
    """Return the status of a run and its reason: ("ok", "") or ("diverged", reason).

    A run diverged if it stopped early, or if it reached none of the stamps of the reference. A run also diverged if a
    position or velocity is not finite. For a filter that estimates only the attitude, the angles are checked instead. A
    run also diverged if the length of its position error exceeds ``limit_m`` at any row, even if this row is not
    scored. The length of the error includes only the axes on which the reference is known.
    """
    reason = why_stopped(estimate) or _too_far(estimate, recording, limit_m)
    return ("diverged", reason) if reason else ("ok", "")


def why_diverged(result: Streamed, prepared: PreparedReference, recording: Recording) -> str:
    """Return why a run without a trajectory diverged, as in `run_status`, or an empty text if it did not diverge."""
    if not result.rows_left:
        return ""
    t_s = recording.reference.t_s[prepared.outline.index[-int(result.rows_left)]]
    return _beyond(math.sqrt(result.diverged_m2), float(t_s), prepared.scoring.limit_m)


def _beyond(distance_m: float, t_s: float, limit_m: float) -> str:
    return f"The position error is {distance_m:.0f} m at {t_s:.2f} s; the limit is {limit_m:g} m."


def why_stopped(estimate: Estimate) -> str:
    """Return why the run stopped early or reached no stamp of the reference, or an empty text if neither is true."""
    return estimate.failure or ("" if len(estimate.index) else "The run reached none of the reference's stamps.")


def _too_far(estimate: Estimate, recording: Recording, limit_m: float) -> str:
    t_s = rows_at(recording.reference.t_s, estimate.index)
    angles, position, velocity = estimate.euler_rad, estimate.position_m, estimate.velocity_mps
    parts = [angles] if estimate.attitude_only else [position] if estimate.position_only else [position, velocity]
    if not all(np.isfinite(part).all() for part in parts):
        finite = np.isfinite(np.hstack(parts)).all(axis=1)
        return f"The state is not finite at {t_s[np.argmin(finite)]:.2f} s."
    error_m = np.nan_to_num(position_error_m(estimate, recording))
    with np.errstate(over="ignore"):
        distance_m = np.sqrt(np.einsum("ka,ka->k", error_m, error_m))
    first = int(np.argmax(distance_m > limit_m))
    return _beyond(float(distance_m[first]), float(t_s[first]), limit_m) if distance_m[first] > limit_m else ""


class Combination(NamedTuple):
    """The values of the six factors that identify a combination. The factors are in the order of the data flow."""

    dataset: str
    disturbance: str
    attitude: str
    filter: str
    adaptation: str
    noise: str


RUN_COLUMNS = ("seed", "replicate", "status", "reason")
"""Columns of a row between its labels and its metrics, written by `jerkbench.jobs.rows`.

Do not add a column here: stored files that lack one of these columns count as damaged. Define a metric instead.
"""

DRAWN = "drawn."
"""Prefix of the columns with drawn parameters of a random drive. These columns are not metrics."""

Evaluate = Callable[[Metric, Estimate, Recording, BoolArray], Mapping[str, float]]


def evaluate_run(
    estimate: Estimate, recording: Recording, burn_in_s: float, metrics: Sequence[Metric]
) -> dict[str, float]:
    """Return the values of all metrics by column name, which are NaN if the run stopped before the first counted row.

    Args:
        estimate: estimate of the filter.
        recording: recording with the reference.
        burn_in_s: time from which on errors count [s].
        metrics: metrics to compute.

    Raises:
        RecordingError: no row counts, although the run did not stop early.
        PluginError: two metrics return the same column.
    """
    counted = counted_rows(estimate, recording, burn_in_s)
    if not counted.any() and not why_stopped(estimate):
        raise RecordingError(nothing_counts(recording, burn_in_s))
    sums = sums_of(estimate, recording, counted) if any(isinstance(m, Summarising) for m in metrics) else None
    return metric_values(metrics, sums, (estimate, recording, counted))


def metric_values(
    metrics: Iterable[Metric],
    sums: Sums | None,
    run: tuple[Estimate, Recording, BoolArray],
    evaluate: Evaluate = lambda metric, *given: metric.evaluate(*given),
) -> dict[str, float]:
    """Return the values of all metrics by column name. Metrics are computed from the sums where this is possible.

    Args:
        metrics: metrics to compute.
        sums: sums of the run, or None if no metric reads sums.
        run: stored part of the estimate, recording, and whether each row counts (k,).
        evaluate: function that computes a metric that needs more than sums. A caller can pass a function that returns
            cached values.

    Raises:
        PluginError: two metrics return the same column.
    """
    values, owners = dict[str, float](), dict[str, str]()
    for m in metrics:
        columns = m.summarise(sums) if sums and has_methods(m, Summarising) else evaluate(m, *run)
        if twice := [column for column in columns if column in owners]:
            raise PluginError(
                f"The metrics {owners[twice[0]]} and {type(m).__name__} both return the column '{twice[0]}'; rename the"
                " column in one metric, or remove one metric."
            )
        values |= {column: float(value) for column, value in columns.items()}
        owners |= dict.fromkeys(columns, type(m).__name__)
    return values
