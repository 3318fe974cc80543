"""Extrapolation of the position fixes without a filter, as a baseline for comparisons."""

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
    """Extrapolates the last position fix with the last measured velocity, without a filter and without the IMU.

    The estimate at the time t is extrapolated from the last measured position p, at the time t_p, and the last measured
    velocity v::

        p(t) = p + v (t - t_p),    v(t) = v,    P_pp = R_p + R_v (t - t_p)^2

    The difference between the errors of a filter and of `gnss_only` shows the benefit of the filter. Each axis is
    extrapolated from the last measurement of this axis, so position and velocity may have outages at different times.
    """

    provenance = Provenance("own", "", "Lower bound: the last fix, extrapolated with its velocity.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    uses_imu: ClassVar[bool] = False

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the extrapolated position fixes at the time stamps of the reference."""
        timeline = build_timeline(recording, attitude)
        steps = np.flatnonzero(timeline.reference >= 0)
        last, R, since_s = _after_updates(timeline)
        latest = np.cumsum(timeline.update >= 0)[steps]  # row 0 of the arrays contains the initial values
        x, P = _carried(timeline.t_s[steps, None] - since_s[latest], last[latest], R[latest])
        index = timeline.reference[steps]
        return Estimate(index, x[:, :3], x[:, 3:], P, timeline.euler_rad[index])


def _after_updates(timeline: Timeline) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the latest measurement of each axis (m, 6), its covariance (m, 6, 6) and the position times (m, 3) [s].

    Row 0 contains the initial values. Row k contains the values after the k-th update.
    """
    steps = np.flatnonzero(timeline.update >= 0)
    measured, axes = timeline.update[steps], np.arange(6)
    z = np.concatenate([timeline.x0[None], timeline.measurements.z[measured]])
    R = np.concatenate([timeline.P0[None], timeline.measurements.R[measured]])
    latest = np.maximum.accumulate(np.where(np.isfinite(z), np.arange(len(z))[:, None], 0))
    i, j = latest[:, :, None], latest[:, None, :]  # errors of measurements at different times are uncorrelated
    together = np.where(i == j, R[i, axes[:, None], axes], 0.0)
    since_s = np.concatenate([timeline.t_s[:1], timeline.t_s[steps]])[latest[:, :3]]
    return z[latest, axes], together, since_s


def _carried(dt_s: FloatArray, last: FloatArray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the extrapolated values F x (k, 6) and their covariance F R F' (k, 6, 6).

    The extrapolation matrix is F = [[I, D], [0, I]] with D = diag(dt).
    """
    x, P = last.copy(), R.copy()
    x[:, :3] += dt_s * last[:, 3:]
    P[:, :3] += dt_s[:, :, None] * R[:, 3:]
    P[:, :, :3] += P[:, :, 3:] * dt_s[:, None, :]
    return x, P
