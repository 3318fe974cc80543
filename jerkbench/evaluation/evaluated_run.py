"""One run -> its numbers: the sums of its errors, when it counts as diverged, and the columns of its row."""

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
from jerkbench.estimate import ErrorWeights, Estimate, Streamed, Sums
from jerkbench.evaluation.counted_rows import (
    Rows,
    counted_rows,
    counting,
    known_axes,
    nothing_counts,
    position_error_m,
    rows_at,
)
from jerkbench.kinematic.trajectory_score import scored_trajectory
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline


@dataclass(frozen=True, eq=False)
class PreparedReference:
    """The reference of a recording, prepared for the runs over one timeline, or for one trajectory.

    Attributes:
        scoring: what errors count for, for the engine.
        rows: which rows count for what.
        counted: (k,) which rows count at all.
        outline: an estimate of which ``index`` and ``euler_rad`` are known at least.
    """

    scoring: ErrorWeights
    rows: Rows
    counted: BoolArray
    outline: Estimate

    @cached_property
    def errors_alone(self) -> ErrorWeights:
        """What the engine scores where no metric reads covariances."""
        return replace(self.scoring, marks=self.rows.outages.ravel(), consistency=False)

    @cached_property
    def positions_alone(self) -> ErrorWeights:
        """The same where none reads velocities either: no row counts for them."""
        return replace(self.errors_alone, moving=np.zeros_like(self.scoring.moving))

    @cached_property
    def constant_sums(self) -> dict[str, Any]:
        """The parts of `Sums` that are the same for every run: how many rows count, and the outages."""
        rows = self.rows
        return {
            "position_rows": rows.position.sum(axis=1).astype(np.float64),
            "velocity_rows": rows.velocity.sum(axis=1).astype(np.float64),
            "whole_rows": float(rows.whole.sum()),
            "nees_rows": float(rows.both.sum()),
            "outage_rows": float(rows.outage.sum()),
            "outage_driven_m": rows.outages_driven_m,
        }


def sums_of(estimate: Estimate, recording: Recording, counted: BoolArray) -> Sums:
    """Return the sums of a trajectory; ``counted`` (k,) says which of its rows count."""
    rows = counting(estimate.index, recording, counted)
    prepared = PreparedReference(error_weights(recording, estimate.index, rows), rows, counted, estimate)
    sums = sums_from(scored_trajectory(estimate, prepared.scoring), prepared, recording)
    if (rows.position == rows.position[0]).all() and (rows.velocity == rows.velocity[0]).all():
        return sums
    errors = [scored_trajectory(estimate, replace(prepared.scoring, counted=on)) for on in rows.position.astype(float)]
    speeds = [scored_trajectory(estimate, replace(prepared.scoring, moving=on)) for on in rows.velocity.astype(float)]
    return sums._replace(
        position_m2=np.diagonal([_over_axes(own.position_m2) for own in errors]),
        velocity_m2ps2=np.diagonal([_over_axes(own.velocity_m2ps2)[_MOVING] for own in speeds]),
    )


class Summed(ABC):
    """A metric that needs the sums of a run alone, whether or not its trajectory was stored."""

    reads_covariance: ClassVar[bool] = True
    """Whether it reads sums of e' P^-1 e, or any of the ``sampled`` errors: without it these are empty."""
    reads_velocity: ClassVar[bool] = True
    """Whether it reads sums of the velocity: without it they are NaN."""

    @abstractmethod
    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the values by column name."""

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the same of a trajectory."""
        return self.summarise(sums_of(estimate, recording, counted))


def sums_from(streamed: Streamed, prepared: PreparedReference, recording: Recording) -> Sums:
    """Return the sums of a run; the reference knows all axes at the same stamps, of position and of velocity."""
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
"""Sums that are part of both; those of position and velocity are of each axis in `Streamed`."""


def error_weights(recording: Recording, index: IntArray, rows: Rows) -> ErrorWeights:
    """Return the weights of the errors at the rows ``index`` (k,) of the reference, which count for ``rows``."""
    reference = recording.reference
    truth = np.zeros((len(index), 6))
    if reference.enu_m is not None:
        truth[:, :3] = np.nan_to_num(rows_at(reference.enu_m, index))
    if reference.velocity_mps is not None:
        truth[:, 3:] = np.nan_to_num(rows_at(reference.velocity_mps, index))
    return ErrorWeights(
        truth,
        rows.position[0].astype(np.float64),
        rows.whole.astype(np.float64),
        rows.velocity[0].astype(np.float64),
        rows.outage.astype(np.float64),
        np.concatenate([rows.outages.ravel(), rows.sampled]),
        rows.start_s,
    )


def _over_axes(squares: FloatArray) -> FloatArray:
    """(5,) from (3,) of each axis: over the axes of each of POSITION_AXES."""
    east, north, up = squares.tolist()
    return np.array([east + north + up, east + north, east, north, up])


_MOVING = np.array([0, 1, 4])
"""The places of VELOCITY_AXES among POSITION_AXES."""


def _lengths_m(error_m: FloatArray) -> FloatArray:
    """(j,) |e|."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.sqrt((error_m**2).sum(axis=1)))


def _drifts_mps(error_m: FloatArray, t_s: FloatArray) -> FloatArray:
    """(j,) |e_last - e_first|/(t_last - t_first) of errors (j, 2, 3) at times (j, 2)."""
    with np.errstate(all="ignore"):
        grown = np.linalg.norm(error_m[:, 1] - error_m[:, 0], axis=1)
        return np.asarray(grown / np.where(t_s[:, 1] > t_s[:, 0], t_s[:, 1] - t_s[:, 0], np.nan))


def can_stream(metric: Metric) -> bool:
    """Whether the metric needs no trajectory."""
    return has_methods(metric, Summarising) or part_read(metric) != "everything"


def prepare_reference(
    recording: Recording, timeline: Timeline, burn_in_s: float, limit_m: float = math.inf
) -> PreparedReference | None:
    """Return the reference for runs over ``timeline``, or None where scoring them needs a trajectory.

    It does where the reference does not know a whole position at each of its stamps, or parts of a velocity, and where
    nothing counts. A run with a position error over ``limit_m`` strays.
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
    """Return an estimate without position, velocity and covariance (NaN) at rows ``index`` (k,) of the reference."""
    unknown = np.broadcast_to(np.nan, (len(index), 6, 6))
    return Estimate(index, unknown[:, 0, :3], unknown[:, 0, :3], unknown, euler_rad)


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


def why_strayed(result: Streamed, prepared: PreparedReference, recording: Recording) -> str:
    """Return what `run_status` says of a run without a trajectory that came to its end; empty: it is ok."""
    if not result.rows_left:
        return ""
    t_s = recording.reference.t_s[prepared.outline.index[-int(result.rows_left)]]
    return _beyond(math.sqrt(result.strayed_m2), float(t_s), prepared.scoring.limit_m)


def _beyond(distance_m: float, t_s: float, limit_m: float) -> str:
    return f"The position error is {distance_m:.0f} m at {t_s:.2f} s; the limit is {limit_m:g} m."


def why_stopped(estimate: Estimate) -> str:
    """Return why the run stopped early, or an empty string."""
    return estimate.failure or ("" if len(estimate.index) else "The run reached none of the reference's stamps.")


def _too_far(estimate: Estimate, recording: Recording, limit_m: float) -> str:
    t_s = rows_at(recording.reference.t_s, estimate.index)
    angles, place, pace = estimate.euler_rad, estimate.position_m, estimate.velocity_mps
    parts = [angles] if estimate.attitude_only else [place] if estimate.position_only else [place, pace]
    if not all(np.isfinite(part).all() for part in parts):
        finite = np.isfinite(np.hstack(parts)).all(axis=1)
        return f"The state is not finite at {t_s[np.argmin(finite)]:.2f} s."
    error_m = np.nan_to_num(position_error_m(estimate, recording))
    with np.errstate(over="ignore"):
        distance_m = np.sqrt(np.einsum("ka,ka->k", error_m, error_m))
    first = int(np.argmax(distance_m > limit_m))
    return _beyond(float(distance_m[first]), float(t_s[first]), limit_m) if distance_m[first] > limit_m else ""


class Combination(NamedTuple):
    """The value of each factor of a run, in the order of the data flow."""

    dataset: str
    disturbance: str
    attitude: str
    filter: str
    adaptation: str
    noise: str


RUN_COLUMNS = ("seed", "replicate", "status", "reason")
"""Columns of a row between its labels and its metrics; `jerkbench.jobs.rows` writes them. Define a metric instead of a
further column: stored files without one of these columns count as damaged.
"""

DRAWN = "drawn."
"""Prefix of the columns with the parameters of a random drive, which are not metrics."""

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
    sums = sums_of(estimate, recording, counted) if any(isinstance(own, Summarising) for own in metrics) else None
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
    """Return the values of all metrics by column name, each from the least that it needs.

    Raises:
        PluginError: two metrics give the same column.
    """
    estimate, counted, sums = summary
    values, owners = dict[str, float](), dict[str, str]()
    for m in metrics:
        own = m.summarise(sums) if sums and has_methods(m, Summarising) else evaluate(m, estimate, recording, counted)
        if twice := [column for column in own if column in owners]:
            raise PluginError(
                f"The metrics {owners[twice[0]]} and {type(m).__name__} both give the column '{twice[0]}'; rename it in"
                " one of them, or leave one out."
            )
        values |= {column: float(value) for column, value in own.items()}
        owners |= dict.fromkeys(own, type(m).__name__)
    return values
