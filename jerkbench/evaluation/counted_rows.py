"""The stamps of an estimate at which errors count, where the reference knows something; and the errors there."""

import math
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Estimate
from jerkbench.geometry import vertical_in_body, wrap_angle
from jerkbench.recording import Recording, Reference

POSITION_AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_east": (0,), "_north": (1,), "_up": (2,)}
"""The part of a column's name for each error of position, and its axes."""

VELOCITY_AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_up": (2,)}
"""The same of velocity errors."""

OLDEST = 2 + 1e-6
"""Intervals of the reference that the last error may be older than the end; more than two by the rounding of stamps."""


class Rows(NamedTuple):
    """Which of k rows count; in each case only those whose reference is known on the axes in question.

    Attributes:
        position: (5, k) counted, for each of POSITION_AXES.
        velocity: (3, k) counted, for each of VELOCITY_AXES.
        both: (k,) counted, position and velocity known.
        whole: (k,) scored, the burn-in too.
        outage: (k,) counted, inside an outage.
        outages: (j, 2) the first and the last row inside each outage that the reference follows to its end, scored or
            not.
        outages_s: (j, 2) their times.
        outages_driven_m: (j,) how far the reference went between the two.
        start_s: time of the first counted row; infinite without one.
        sampled: (s,) the first row of each second whose position counts.
    """

    position: BoolArray
    velocity: BoolArray
    both: BoolArray
    whole: BoolArray
    outage: BoolArray
    outages: IntArray
    outages_s: FloatArray
    outages_driven_m: FloatArray
    start_s: float
    sampled: IntArray


def counting(index: IntArray, recording: Recording, counted: BoolArray) -> Rows:
    """Return what the rows ``index`` (k,) of the reference count for, given those (k,) that are counted at all."""
    reference = recording.reference
    located = known_axes(reference.enu_m, index)
    moving = known_axes(reference.velocity_mps, index)
    position = np.array([counted & on_all(located, axes) for axes in POSITION_AXES.values()])
    velocity = np.array([counted & on_all(moving, axes) for axes in VELOCITY_AXES.values()])
    t_s, complete = rows_at(reference.t_s, index), on_all(located, (0, 1, 2))
    start_s = first_counted_s(reference, index, counted)
    begin, end = recording.outages_s[:, :1], recording.outages_s[:, 1:]  # at the end itself a fix may already have come
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
    """Return (s,) the first row of each whole second that is ``counted`` (k,), of stamps ``t_s`` (k,) that increase."""
    places = np.flatnonzero(counted)
    _, first = np.unique(np.floor(t_s[places]), return_index=True)
    return np.asarray(places[first])


def first_counted_s(reference: Reference, index: IntArray, counted: BoolArray) -> float:
    """Return the time of the first row of ``index`` (k,), which increases, that is ``counted`` (k,); else infinity."""
    first = int(np.argmax(counted)) if len(counted) else 0
    return float(reference.t_s[index[first]]) if len(counted) and counted[first] else np.inf


def rows_at(values: Any, index: IntArray) -> Any:  # noqa: ANN401 - an array of the same type
    """Return ``values[index]``; a view of it where ``index``, which increases, leaves none out: that takes no time."""
    if len(index) and index[-1] - index[0] + 1 == len(index):
        return values[index[0] : index[-1] + 1]
    return values[index]


def on_all(known: BoolArray, axes: tuple[int, ...]) -> BoolArray:
    """Return (k,) whether all ``axes`` are ``known`` (k, 3); NumPy's `all` over threes takes ten times as long."""
    rows: BoolArray = known[:, axes[0]]
    for axis in axes[1:]:
        rows = rows & known[:, axis]
    return rows


def driven_m(reference: Reference) -> FloatArray:
    """Return (k,) the distance up to each row, straight from each known position to the next."""
    steps = np.zeros(len(reference.t_s))
    if reference.enu_m is not None:
        known = np.flatnonzero(np.isfinite(reference.enu_m).all(axis=1))
        steps[known[1:]] = np.linalg.norm(np.diff(reference.enu_m[known], axis=0), axis=1)
    return np.cumsum(steps)


def known_axes(truth: FloatArray | None, index: IntArray) -> BoolArray:
    """Return (k, 3) whether each axis of ``truth`` is a number."""
    return np.zeros((len(index), 3), bool) if truth is None else np.asarray(np.isfinite(rows_at(truth, index)))


def _outages(inside: BoolArray, t_s: FloatArray, recording: Recording) -> IntArray:
    """The first and the last row inside each outage, (j, k) rows, where the last is near the outage's end."""
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
    """Return (k,) which rows of the estimate count.

    The reference is scored there, the burn-in [s] is over, and something of the reference is known; with an empty
    reference the innovations count all the same. Whether the estimate itself is a number does not matter here: a filter
    must not improve its score by failing.
    """
    reference = recording.reference
    truths = (reference.enu_m, reference.velocity_mps, reference.euler_rad)
    something = [known_axes(truth, estimate.index).any(axis=1) for truth in truths]
    late = reference.t_s[estimate.index] >= burn_in_s
    return np.asarray(reference.scored[estimate.index] & late & (reference.empty | np.any(something, axis=0)))


def require_begin(estimate: Estimate, recording: Recording, burn_in_s: float) -> None:
    """Require that an estimate leaves nothing out at its begin that counts.

    Errors count from the burn-in [s] on, or from the first fix where that is later.

    Raises:
        RecordingError: it begins later.
    """
    fix_s = float(recording.position.t_s[0]) if recording.position is not None else 0.0
    stamps_s, latest_s = recording.reference.t_s, max(burn_in_s, fix_s)
    due = int(np.searchsorted(stamps_s, latest_s))
    if len(estimate.index) == 0 or due == len(stamps_s) or estimate.index[0] <= due:
        return
    raise RecordingError(
        f"The estimate begins at {stamps_s[estimate.index[0]]:.2f} s, and errors count from {latest_s:.2f} s on; let it"
        " begin earlier, or let the errors of all methods count later (burn_in_s)."
    )


def nothing_counts(recording: Recording, burn_in_s: float) -> str:
    """Return the sentence for a run of which no row counts."""
    return (
        f"No error counts: burn_in_s is {burn_in_s:g}, the recording '{recording.name}' lasts "
        f"{recording.duration_s:.2f} s, and no row of its reference after the burn-in is known, scored and reached; "
        "give a shorter burn-in, or a recording with a reference."
    )


def position_error_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) estimate less reference, ENU [m]; NaN where the reference is not known."""
    return _error(estimate.position_m, recording.reference.enu_m, estimate)


def position_error_length_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k,) the length of the position error [m]; NaN where it is not known or not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        length: FloatArray = np.sqrt(np.sum(position_error_m(estimate, recording) ** 2, axis=1))
    return np.where(np.isfinite(length), length, np.nan)


def velocity_error_mps(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) estimate less reference, ENU [m/s]; NaN where the reference is not known."""
    return _error(estimate.velocity_mps, recording.reference.velocity_mps, estimate)


def euler_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) roll, pitch, yaw less reference, each wrapped to (-pi, pi]; NaN where it is not known."""
    return wrap_angle(_error(estimate.euler_rad, recording.reference.euler_rad, estimate))


def inclination_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k,) the angle between estimated and true vertical, seen from the body; NaN where it is not known."""
    truth = recording.reference.euler_rad
    if truth is None:
        return np.full(len(estimate.index), np.nan)
    return angle_between(vertical_in_body(estimate.euler_rad), vertical_in_body(truth[estimate.index]))


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angle (k,) [rad] between the rows of two (k, 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))


def known(truth: FloatArray | None, estimate: Estimate, axes: tuple[int, ...] = (0, 1, 2)) -> BoolArray:
    """Return (k,) whether all ``axes`` of the reference are numbers at the estimate's rows."""
    return on_all(known_axes(truth, estimate.index), axes)


def counted_errors(estimate: Estimate, recording: Recording, counted: BoolArray) -> tuple[BoolArray, FloatArray]:
    """Return which rows (k,) are ``counted`` and have a reference of the position, and the errors (j, 3) there."""
    rows = counted & known(recording.reference.enu_m, estimate)
    return rows, position_error_m(estimate, recording)[rows]


def timed_errors(
    estimate: Estimate, recording: Recording, counted: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (j,), errors of the position (j, 3) and their lengths (j,) at the rows of `counted_errors`."""
    rows, error = counted_errors(estimate, recording, counted)
    with np.errstate(over="ignore", invalid="ignore"):
        return recording.reference.t_s[estimate.index[rows]], error, np.linalg.norm(error, axis=1)


def rms_norm(vectors: FloatArray) -> float:
    """Return sqrt(mean |v|^2) over the rows of (k, m); NaN without rows, infinite where it overflows.

    A NaN is not left out: an estimate that is not a number must not improve its own score.
    """
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def largest_norm(vectors: FloatArray) -> float:
    """Return max |v| over the rows of (k, m); NaN without rows."""
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.max(np.sqrt(np.sum(vectors**2, axis=1))))


def rms(square: float, rows: float) -> float:
    """Return sqrt(square/rows) of a sum of squares over so many rows; NaN without rows."""
    return math.sqrt(mean(square, rows))


def mean(total: float, rows: float) -> float:
    """Return total/rows; NaN without rows."""
    return float(total / rows) if rows else float("nan")


def _error(value: FloatArray, truth: FloatArray | None, estimate: Estimate) -> FloatArray:
    return np.full_like(value, np.nan) if truth is None else np.asarray(value - rows_at(truth, estimate.index))
