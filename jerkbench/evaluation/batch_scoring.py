"""The scoring of a run that keeps no trajectory: its counted rows and its sums."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Metric, Reading, Summarising
from jerkbench.estimate import Estimate, Updates
from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.counted_stamps import counting, known_axes
from jerkbench.evaluation.sums import Scored, scoring_of
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline


def can_stream(metric: Metric) -> bool:
    """Whether the metric needs no trajectory."""
    return isinstance(metric, Summarising | Reading)


def scored(recording: Recording, timeline: Timeline, burn_in_s: float) -> Scored | None:
    """Return how runs over ``timeline`` are scored, or None where that needs a trajectory.

    It does where the reference does not know a whole position at each of its stamps, or parts of a velocity, and where
    nothing counts.
    """
    outline = outline_of(timeline)
    counted = counted_rows(outline, recording, burn_in_s)
    rows = counting(outline.index, recording, counted)
    located = known_axes(recording.reference.enu_m, outline.index).all()
    if not (located and counted.any() and (rows.velocity == rows.velocity[0]).all()):
        return None
    return Scored(scoring_of(recording, outline.index, rows), rows, counted, outline)


def outline_of(timeline: Timeline) -> Estimate:
    """Return an estimate without position, velocity and covariance (NaN)."""
    index = timeline.reference[timeline.reference >= 0]
    return outlined(index, timeline.euler_rad[index])


def outlined(index: IntArray, euler_rad: FloatArray) -> Estimate:
    """Return the same for rows ``index`` (k,) of the reference, with the attitude (k, 3) there."""
    unknown = np.broadcast_to(np.nan, (len(index), 6, 6))
    return Estimate(index, unknown[:, 0, :3], unknown[:, 0, :3], unknown, euler_rad)


def with_updates(outline: Estimate, updates: Updates) -> Estimate:
    """Return the outline with what the updates saw."""
    return Estimate(
        outline.index, outline.position_m, outline.velocity_mps, outline.covariance, outline.euler_rad, updates
    )
