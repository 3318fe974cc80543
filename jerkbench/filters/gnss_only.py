"""The floor: no filter at all."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline.recorder import Recorder
from jerkbench.timeline.timeline import Timeline, build_timeline


@register("filter", "gnss_only")
@dataclass(frozen=True)
class GnssOnly:
    """Carries the last fix on with its velocity; uses no IMU.

    With the last measured p at t_p and v at t_v::

        p(t) = p + v (t - t_p),    v(t) = v,    P_pp = R_p + R_v (t - t_p)^2

    What a filter adds to this row is what it is worth. Axes are carried on separately, each from its own last
    measurement, so outages of position and of velocity alone are handled alike.
    """

    adaptations: ClassVar[tuple[str, ...]] = ("none",)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the carried-on fixes at the reference's stamps."""
        timeline = build_timeline(recording, attitude)
        recorder = Recorder(timeline)
        last, R, since = timeline.x0.copy(), timeline.P0.copy(), np.full(3, timeline.t_s[0])
        for t, update, reference in zip(timeline.t_s, timeline.update, timeline.reference, strict=True):
            if update >= 0:
                _take(timeline, update, t, last, R, since)
            if reference >= 0:
                x, P = _carried(t, last, R, since)
                recorder.state(reference, x, P)
        return recorder.estimate()


def _take(timeline: Timeline, update: int, t: float, last: FloatArray, R: FloatArray, since: FloatArray) -> None:
    """Put the rows that were measured in the place of the last ones."""
    z = timeline.measurements.z[update]
    rows = np.flatnonzero(np.isfinite(z))
    last[rows] = z[rows]
    R[rows, :] = R[:, rows] = 0.0
    R[np.ix_(rows, rows)] = timeline.measurements.R[update][np.ix_(rows, rows)]
    since[rows[rows < 3]] = t


def _carried(t: float, last: FloatArray, R: FloatArray, since: FloatArray) -> tuple[FloatArray, FloatArray]:
    """State and covariance at t: F x and F R F' with F = [[I, diag(t - since)], [0, I]]."""
    F = np.eye(6)
    F[[0, 1, 2], [3, 4, 5]] = t - since
    return F @ last, F @ R @ F.T
