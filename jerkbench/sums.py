"""The sums of a run: the numbers that the built-in metrics need in place of a trajectory."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Attitude, Updates
from jerkbench.recording import Recording
from jerkbench.timeline import AS_REPORTED, RScale, Timeline, with_r_scale


class Sums(NamedTuple):
    """Sums over the rows of a run; which rows, `jerkbench.evaluation.counted_rows` says.

    Attributes:
        position_m2: (5,) sum of |e|^2 over the axes of each of POSITION_AXES.
        position_rows: (5,) their number.
        position_max_m: the largest |e|; NaN without rows.
        whole_m2: sum of |e|^2, the burn-in too.
        whole_rows: their number.
        velocity_m2ps2: (3,) sum of |e|^2 over the axes of each of VELOCITY_AXES.
        velocity_rows: (3,) their number.
        nees: sum of e' P^-1 e, position and velocity.
        nees_rows: their number.
        nees_position: sum of e' P^-1 e of position, over ``position_rows[0]`` rows.
        nis_per_row: sum over updates of nis/m, reported R.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were not dropped.
        nis_used_updates: their number.
        outage_m2: sum of |e|^2 of position inside outages.
        outage_rows: their number.
        outage_ends_m: (j,) |e| at the end of each outage.
        outage_driven_m: (j,) how far the reference went in each.
        outage_drifts_mps: (j,) change of e from its first to its last row, per second; NaN where they are one.
        outages: number of outages of the recording, reached or not.
        sampled_m: (s, 3) position errors once a second, at the first row that counts.
        sampled_m2: (s, 6) the upper triangle of their covariance, row by row.
    """

    position_m2: FloatArray
    position_rows: FloatArray
    position_max_m: float
    whole_m2: float
    whole_rows: float
    velocity_m2ps2: FloatArray
    velocity_rows: FloatArray
    nees: float
    nees_rows: float
    nees_position: float
    nis_per_row: float
    nis_updates: float
    nis_used_per_row: float
    nis_used_updates: float
    outage_m2: float
    outage_rows: float
    outage_ends_m: FloatArray
    outage_driven_m: FloatArray
    outage_drifts_mps: FloatArray
    outages: int
    sampled_m: FloatArray
    sampled_m2: FloatArray

    @property
    def sampled_covariance_m2(self) -> FloatArray:
        """(s, 3, 3) covariances of the position once a second."""
        return self.sampled_m2[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


# Input (besides its timeline) and result of a run whose metrics are summed as it goes, without a
# trajectory.


@dataclass(frozen=True, eq=False)
class ErrorWeights:
    """The weights of a run's errors, at the k stamps of the reference that it visits.

    Attributes:
        truth: (k, 6) position and velocity of the reference; 0 where a velocity is not known.
        counted: (k,) 1 where the errors count, else 0.
        whole: (k,) 1 where they count with the burn-in, else 0.
        moving: (k,) 1 where the velocity errors count, else 0.
        outage: (k,) 1 where they count for the outages, else 0.
        marks: (j,) rows whose position errors are kept.
        start_s: from when on updates count.
        consistency: whether covariances are asked for: the sums of e' P^-1 e, and those of the marked rows. They take a
            quarter of a run without a trajectory.
        limit_m: a run with a larger position error strays.
    """

    truth: FloatArray
    counted: FloatArray
    whole: FloatArray
    moving: FloatArray
    outage: FloatArray
    marks: IntArray
    start_s: float
    consistency: bool = True
    limit_m: float = math.inf


class Run(NamedTuple):
    """A run without its filter."""

    timeline: Timeline
    scoring: ErrorWeights


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """A run of an estimator, which sees the recording itself.

    Attributes:
        reported: the recording, with the covariances that the receiver reports.
        attitude: its attitude.
        timeline: that of `recording` and the attitude.
        scoring: what the errors count for.
        r_scale: what the estimator is told of those covariances.
    """

    reported: Recording
    attitude: Attitude
    timeline: Timeline
    scoring: ErrorWeights
    r_scale: RScale = AS_REPORTED

    @cached_property
    def recording(self) -> Recording:
        """The recording as the estimator is told it; made where it is asked for, which takes longer than a run."""
        return with_r_scale(self.reported, self.r_scale)


SUMS = 17
"""Sums that a run adds up, the first thirteen parts of `Streamed`: each has a place in the array of them."""
POSITION_SQUARES, VELOCITY_SQUARES = 0, 3
WHOLE, OUTAGE, LARGEST, STRAYED, ROWS_LEFT, NEES, NEES_POSITION, NIS, UPDATES, NIS_USED, UPDATES_USED = range(6, SUMS)


class Streamed(NamedTuple):
    """Sums over a run, of squares where nothing else is said, and what its updates saw.

    Attributes:
        position_m2: (3,) east, north, up.
        velocity_m2ps2: (3,) likewise.
        whole_m2: of the position, with the burn-in.
        outage_m2: of the position, inside the outages.
        largest_m2: the largest of the position, where it counts.
        strayed_m2: the first of the position beyond the limit; 0: there is none.
        rows_left: how many rows there were from that one on.
        nees: sum of e' P^-1 e; NaN where it was not wanted.
        nees_position: the same of the position alone.
        nis_per_row: sum of nis/m over the updates that count.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were kept.
        nis_used_updates: their number.
        marked_m: (j, 3) position errors at the marks.
        marked_m2: (j, 6) the upper triangle of their covariance, row by row; NaN where it was not wanted.
        updates: what the updates saw, or none where they were not kept.
        euler_rad: (k, 3) roll, pitch, yaw of the run itself; None: those of the timeline, or not kept.
    """

    position_m2: FloatArray
    velocity_m2ps2: FloatArray
    whole_m2: float
    outage_m2: float
    largest_m2: float
    strayed_m2: float
    rows_left: float
    nees: float
    nees_position: float
    nis_per_row: float
    nis_updates: float
    nis_used_per_row: float
    nis_used_updates: float
    marked_m: FloatArray
    marked_m2: FloatArray
    updates: Updates
    euler_rad: FloatArray | None = None

    @classmethod
    def of(cls, sums: FloatArray, marked: FloatArray, updates: Updates, euler_rad: FloatArray | None = None) -> Self:
        """Return these from ``sums`` (SUMS,) and ``marked`` (j, 9), error and covariance at the marks."""
        squares, numbers = sums[:WHOLE], sums[WHOLE:].tolist()
        return cls._make([squares[:3], squares[3:], *numbers, marked[:, :3], marked[:, 3:], updates, euler_rad])
