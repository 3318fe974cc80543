"""The timeline's steps, split further where there is a heading, with the times of the constraints."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.recording import Heading, Imu
from jerkbench.timeline import Timeline, merged_times, nanoseconds


class Events(NamedTuple):
    """The steps of one run: predict over dt with ``sample``, then what comes at the end of the step.

    Attributes:
        t_s: (n,) time at the end of each step.
        dt_s: (n,) its length; the first is 0.
        sample: (n,) which IMU sample covers it.
        update: (n,) row of the timeline's measurements, or -1.
        heading: (n,) row of the headings, or -1.
        constrained: (n,) whether the constraints are due.
        reference: (n,) row of the reference, or -1.
    """

    t_s: FloatArray
    dt_s: FloatArray
    sample: IntArray
    update: IntArray
    heading: IntArray
    constrained: BoolArray
    reference: IntArray


def merge_events(timeline: Timeline, imu: Imu, headings: Heading | None, constraint_interval_s: float) -> Events:
    """Put ``headings`` (None: there are none) between the steps of ``timeline``.

    The constraints are due at the first step that ends in a new interval of ``constraint_interval_s``.
    """
    known = nanoseconds(timeline.t_s)
    more = nanoseconds(headings.t_s if headings is not None else np.empty(0))
    more = more[(more >= known[0]) & (more <= known[-1])]
    t_ns = merged_times(known, more) if len(more) else known
    at = np.searchsorted(t_ns, known)
    update, reference, heading = np.full((3, len(t_ns)), -1, dtype=np.int64)
    update[at], reference[at] = timeline.update, timeline.reference
    if headings is not None:
        heading[np.searchsorted(t_ns, more)] = np.flatnonzero(np.isin(nanoseconds(headings.t_s), more))
    intervals = t_ns // max(round(constraint_interval_s * 1e9), 1)
    return Events(
        t_s=np.asarray(t_ns * 1e-9),
        dt_s=np.diff(t_ns, prepend=t_ns[0]) * 1e-9,
        sample=np.searchsorted(nanoseconds(imu.t_s), t_ns).astype(np.int64),
        update=update,
        heading=heading,
        constrained=np.diff(intervals, prepend=intervals[0]) > 0,
        reference=reference,
    )
