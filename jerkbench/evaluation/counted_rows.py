"""Selection of the rows of an estimate that count for its metrics, and the errors at the selected rows."""

import math
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.geometry import vertical_in_body, wrap_angle
from jerkbench.recording import Recording, Reference

POSITION_AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_east": (0,), "_north": (1,), "_up": (2,)}
"""For each position error, the suffix of the column name and the axes of the error."""

VELOCITY_AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_up": (2,)}
"""For each velocity error, the suffix of the column name and the axes of the error."""

OLDEST = 2 + 1e-6
"""Maximum age of the last known error at the end of an outage, in intervals of the reference (2 plus rounding)."""


class Rows(NamedTuple):
    """The rows of an estimate that count for each metric, out of k rows.

    A row counts only if the reference is known on all axes that the metric reads.

    Attributes:
        position: (5, k) whether each row counts for the position error, for each entry of POSITION_AXES.
        velocity: (3, k) whether each row counts for the velocity error, for each entry of VELOCITY_AXES.
        both: (k,) whether each row counts for both position and velocity, over all axes.
        with_burn_in: (k,) whether each row counts for the position if the burn-in is included.
        outage: (k,) whether each row counts for the position and is inside an outage.
        outages: (j, 2) first and last row inside each outage, even if they are not scored. An outage is left out if its
            last row is not near the end of the outage.
        outages_s: (j, 2) times of the first and the last row inside each outage [s].
        outages_driven_m: (j,) distance that the reference covers from the first to the last row inside each outage [m].
        start_s: time of the first counted row [s], or infinity if no row counts.
        sampled: (s,) index of the first row in each second that counts for the position.
    """

    position: BoolArray
    velocity: BoolArray
    both: BoolArray
    with_burn_in: BoolArray
    outage: BoolArray
    outages: IntArray
    outages_s: FloatArray
    outages_driven_m: FloatArray
    start_s: float
    sampled: IntArray


def counting(index: IntArray, recording: Recording, counted: BoolArray) -> Rows:
    """Return the rows that count for each metric.

    ``index`` (k,) are the rows of the reference that an estimate reached. ``counted`` (k,) states which of them count.
    """
    reference = recording.reference
    located = known_axes(reference.enu_m, index)
    moving = known_axes(reference.velocity_mps, index)
    position = np.array([counted & on_all(located, axes) for axes in POSITION_AXES.values()])
    velocity = np.array([counted & on_all(moving, axes) for axes in VELOCITY_AXES.values()])
    t_s, complete = rows_at(reference.t_s, index), on_all(located, (0, 1, 2))
    start_s = first_counted_s(reference, index, counted)
    begin, end = recording.outages_s[:, :1], recording.outages_s[:, 1:]  # a fix may exist at the end of an outage
    inside = (t_s >= begin) & (t_s < end) & complete
    outages = _outages(inside & (t_s >= start_s), t_s, recording)
    return Rows(
        position,
        velocity,
        position[0] & velocity[0],
        rows_at(reference.scored, index) & complete,
        inside.any(axis=0) & counted,
        outages,
        t_s[outages],
        np.diff(driven_m(reference)[index[outages]], axis=1)[:, 0] if len(outages) else np.empty(0),
        start_s,
        once_a_second(t_s, position[0]),
    )


def once_a_second(t_s: FloatArray, counted: BoolArray) -> IntArray:
    """Return the first ``counted`` (k,) row of each full second (s,). The stamps ``t_s`` (k,) must increase."""
    places = np.flatnonzero(counted)
    _, first = np.unique(np.floor(t_s[places]), return_index=True)
    return np.asarray(places[first])


def first_counted_s(reference: Reference, index: IntArray, counted: BoolArray) -> float:
    """Return the time [s] of the first ``counted`` (k,) row of ``index`` (k,), or infinity if no row counts."""
    first = int(np.argmax(counted)) if len(counted) else 0
    return float(reference.t_s[index[first]]) if len(counted) and counted[first] else np.inf


def rows_at(values: Any, index: IntArray) -> Any:  # noqa: ANN401 - an array of the same type
    """Return ``values[index]`` for an increasing ``index``. The result is not a copy if ``index`` has no gaps."""
    if len(index) and index[-1] - index[0] + 1 == len(index):
        return values[index[0] : index[-1] + 1]
    return values[index]


def on_all(known: BoolArray, axes: tuple[int, ...]) -> BoolArray:
    """Return whether all ``axes`` of each row are ``known`` (k, 3). The loop is ten times as fast as `numpy.all`."""
    rows: BoolArray = known[:, axes[0]]
    for axis in axes[1:]:
        rows = rows & known[:, axis]
    return rows


def driven_m(reference: Reference) -> FloatArray:
    """Return the distance (k,) [m] that the reference covers up to each row, along straight lines between positions."""
    steps = np.zeros(len(reference.t_s))
    if reference.enu_m is not None:
        known = np.flatnonzero(np.isfinite(reference.enu_m).all(axis=1))
        steps[known[1:]] = np.linalg.norm(np.diff(reference.enu_m[known], axis=0), axis=1)
    return np.cumsum(steps)


def known_axes(truth: FloatArray | None, index: IntArray) -> BoolArray:
    """Return a mask (k, 3) of the axes of ``truth`` that are known (finite) at the rows ``index`` (k,)."""
    return np.zeros((len(index), 3), bool) if truth is None else np.asarray(np.isfinite(rows_at(truth, index)))


def _outages(inside: BoolArray, t_s: FloatArray, recording: Recording) -> IntArray:
    """Return the first and the last row inside each outage, if the last row is near the end of the outage.

    The mask ``inside`` (j, k) states which of k rows are inside each of j outages.
    """
    spans = [
        (np.flatnonzero(rows)[[0, -1]], end)
        for rows, (_, end) in zip(inside, recording.outages_s, strict=True)
        if rows.any()
    ]
    enu_m = recording.reference.enu_m
    known_s = recording.reference.t_s[np.isfinite(enu_m).all(axis=1)] if spans and enu_m is not None else np.empty(0)
    oldest_s = OLDEST * float(np.median(np.diff(known_s))) if len(known_s) > 1 else 0.0
    return np.array([pair for pair, end in spans if end - t_s[pair[1]] <= oldest_s], dtype=np.int64).reshape(-1, 2)


def counted_rows(estimate: Estimate, recording: Recording, burn_in_s: float) -> BoolArray:
    """Return a mask (k,) of the rows of an estimate that count for the metrics.

    A row counts if it is scored, if the burn-in [s] is over, and if at least one component of the reference is known.
    With an empty reference, rows count without known components, because the rows are used only for innovations.
    Estimates that are not finite also count, because a filter must not improve its metrics by failing.
    """
    reference = recording.reference
    truths = (reference.enu_m, reference.velocity_mps, reference.euler_rad)
    something = [known_axes(truth, estimate.index).any(axis=1) for truth in truths]
    late = reference.t_s[estimate.index] >= burn_in_s
    return np.asarray(reference.scored[estimate.index] & late & (reference.empty | np.any(something, axis=0)))


def require_begin(estimate: Estimate, recording: Recording, burn_in_s: float) -> None:
    """Check that an estimate starts early enough.

    The estimate must start before the burn-in [s] is over, or before the first fix if the first fix is later.

    Raises:
        RecordingError: the estimate starts too late.
    """
    fix_s = float(recording.position.t_s[0]) if recording.position is not None else 0.0
    stamps_s, latest_s = recording.reference.t_s, max(burn_in_s, fix_s)
    due = int(np.searchsorted(stamps_s, latest_s))
    if len(estimate.index) == 0 or due == len(stamps_s) or estimate.index[0] <= due:
        return
    raise RecordingError(
        f"The estimate begins at {stamps_s[estimate.index[0]]:.2f} s, but errors are counted from {latest_s:.2f} s on."
        " Start the estimate earlier, or increase burn_in_s, so that all errors count from a later time."
    )


def nothing_counts(recording: Recording, burn_in_s: float) -> str:
    """Return the error message for a run in which no row counts."""
    return (
        f"No error counts: burn_in_s is {burn_in_s:g}, the recording '{recording.name}' lasts "
        f"{recording.duration_s:.2f} s, and no row of its reference after the burn-in is known, scored and reached; "
        "give a shorter burn-in, or a recording with a reference."
    )


def position_error_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the position error (k, 3) in ENU [m]: estimate minus reference, or NaN if the reference is unknown."""
    return _error(estimate.position_m, recording.reference.enu_m, estimate)


def position_error_length_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the length (k,) of the position error [m], or NaN if the error is unknown or not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        length: FloatArray = np.sqrt(np.sum(position_error_m(estimate, recording) ** 2, axis=1))
    return np.where(np.isfinite(length), length, np.nan)


def velocity_error_mps(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the velocity error (k, 3) in ENU [m/s]: estimate minus reference, or NaN if the reference is unknown."""
    return _error(estimate.velocity_mps, recording.reference.velocity_mps, estimate)


def euler_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the errors (k, 3) of roll, pitch and yaw [rad], wrapped to (-pi, pi], NaN if the reference is unknown."""
    return wrap_angle(_error(estimate.euler_rad, recording.reference.euler_rad, estimate))


def inclination_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return the angle (k,) [rad] between the estimated and the reference vertical in the body frame.

    The angle is NaN if the reference is unknown.
    """
    truth = recording.reference.euler_rad
    if truth is None:
        return np.full(len(estimate.index), np.nan)
    return angle_between(vertical_in_body(estimate.euler_rad), vertical_in_body(truth[estimate.index]))


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles (k,) [rad] between the vectors ``a`` (k, 3) and ``b`` (k, 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))


def known(truth: FloatArray | None, estimate: Estimate, axes: tuple[int, ...] = (0, 1, 2)) -> BoolArray:
    """Return a mask (k,) of the rows of an estimate at which all ``axes`` of the reference are known."""
    return on_all(known_axes(truth, estimate.index), axes)


def counted_errors(estimate: Estimate, recording: Recording, counted: BoolArray) -> tuple[BoolArray, FloatArray]:
    """Return a mask (k,) of the ``counted`` rows with a position reference, and the position errors at these rows.

    The position errors (j, 3) [m] are returned only for the j rows that the mask selects.
    """
    rows = counted & known(recording.reference.enu_m, estimate)
    return rows, position_error_m(estimate, recording)[rows]


def rms_norm(vectors: FloatArray) -> float:
    """Return sqrt(mean |v|^2) over the k vectors (k, m). The result is NaN without vectors, and infinite on overflow.

    If a vector contains NaN, the result is NaN, because an estimate must not improve its metrics by not being finite.
    """
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def largest_norm(vectors: FloatArray) -> float:
    """Return max |v| over the k vectors (k, m), or NaN without vectors."""
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.max(np.sqrt(np.sum(vectors**2, axis=1))))


def rms(square: float, rows: float) -> float:
    """Return sqrt(square/rows) for a sum of squares over this number of rows, or NaN if the number is 0."""
    return math.sqrt(mean(square, rows))


def mean(total: float, rows: float) -> float:
    """Return total/rows, or NaN if the number of rows is 0."""
    return float(total / rows) if rows else float("nan")


def _error(value: FloatArray, truth: FloatArray | None, estimate: Estimate) -> FloatArray:
    return np.full_like(value, np.nan) if truth is None else np.asarray(value - rows_at(truth, estimate.index))
