"""Input (besides its timeline) and result of a run whose metrics are summed as it goes, without a trajectory."""

from dataclasses import dataclass
from typing import NamedTuple

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Attitude, Updates
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import Timeline


@dataclass(frozen=True, eq=False)
class Scoring:
    """The weights of a run's errors, at the k stamps of the reference that it visits.

    Attributes:
        truth: (k, 6) position and velocity of the reference; 0 where a velocity is not known.
        counted: (k,) 1 where the errors count, else 0.
        whole: (k,) 1 where they count with the burn-in, else 0.
        moving: (k,) 1 where the velocity errors count, else 0.
        outage: (k,) 1 where they count for the outages, else 0.
        marks: (j,) rows whose position errors are kept, with their covariance.
        start_s: from when on updates count.
    """

    truth: FloatArray
    counted: FloatArray
    whole: FloatArray
    moving: FloatArray
    outage: FloatArray
    marks: IntArray
    start_s: float


class Run(NamedTuple):
    """A run without its filter."""

    timeline: Timeline
    scoring: Scoring


class RecordedRun(NamedTuple):
    """A run of an estimator, which sees the recording itself; ``timeline`` is that of recording and attitude."""

    recording: Recording
    attitude: Attitude
    timeline: Timeline
    scoring: Scoring


class Streamed(NamedTuple):
    """Sums over a run, of squares where nothing else is said, and what its updates saw.

    Attributes:
        position_m2: (3,) east, north, up.
        velocity_m2ps2: (3,) likewise.
        whole_m2: of the position, with the burn-in.
        outage_m2: of the position, inside the outages.
        largest_m2: the largest of the position, where it counts.
        farthest_m2: the largest of all.
        nees: sum of e' P^-1 e.
        nees_position: the same of the position alone.
        nis_per_row: sum of nis/m over the updates that count.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were kept.
        nis_used_updates: their number.
        marked_m: (j, 3) position errors at the marks.
        marked_m2: (j, 6) the upper triangle of their covariance, row by row.
        updates: what the updates saw, or none where they were not kept.
        euler_rad: (k, 3) roll, pitch, yaw of the run itself; None: those of the timeline, or not kept.
    """

    position_m2: FloatArray
    velocity_m2ps2: FloatArray
    whole_m2: float
    outage_m2: float
    largest_m2: float
    farthest_m2: float
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
