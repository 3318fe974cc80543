"""The fixes themselves, without any filter, as a yardstick."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline


@register("filter", "gnss_only")
@dataclass(frozen=True)
class GnssOnly:
    """Carries the last fix on with its velocity; uses no IMU.

    With the last measured p at t_p and v at t_v::

        p(t) = p + v (t - t_p),    v(t) = v,    P_pp = R_p + R_v (t - t_p)^2

    What a filter adds to this row is what it is worth. Axes are carried on separately, each from its own last
    measurement, so outages of position and of velocity alone are handled alike.
    """

    provenance = Provenance("own", "", "The floor: the last fix, carried on with its velocity.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    uses_imu: ClassVar[bool] = False

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the carried-on fixes at the reference's stamps."""
        timeline = build_timeline(recording, attitude)
        steps = np.flatnonzero(timeline.reference >= 0)
        last, R, since_s = _after_updates(timeline)
        latest = np.cumsum(timeline.update >= 0)[steps]  # row 0 is the start
        x, P = _carried(timeline.t_s[steps, None] - since_s[latest], last[latest], R[latest])
        index = timeline.reference[steps]
        return Estimate(index, x[:, :3], x[:, 3:], P, timeline.euler_rad[index])


def _after_updates(timeline: Timeline) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what was measured last, at the start and after each of m - 1 updates.

    Returns:
        The rows (m, 6), their covariance (m, 6, 6) and the times of the positions (m, 3).
    """
    steps = np.flatnonzero(timeline.update >= 0)
    measured, axes = timeline.update[steps], np.arange(6)
    z = np.concatenate([timeline.x0[None], timeline.measurements.z[measured]])
    R = np.concatenate([timeline.P0[None], timeline.measurements.R[measured]])
    latest = np.maximum.accumulate(np.where(np.isfinite(z), np.arange(len(z))[:, None], 0))  # of each axis
    i, j = latest[:, :, None], latest[:, None, :]  # axes that were measured apart are not correlated
    together = np.where(i == j, R[i, axes[:, None], axes], 0.0)
    since_s = np.concatenate([timeline.t_s[:1], timeline.t_s[steps]])[latest[:, :3]]
    return z[latest, axes], together, since_s


def _carried(dt_s: FloatArray, last: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """States (k, 6) and covariances (k, 6, 6): F x and F R F' with F = [[I, D], [0, I]], D = diag(dt) of (k, 3)."""
    x, P = last.copy(), R.copy()
    x[:, :3] += dt_s * last[:, 3:]
    P[:, :3] += dt_s[:, :, None] * R[:, 3:]
    P[:, :, :3] += P[:, :, 3:] * dt_s[:, None, :]
    return x, P
