"""A plain loop with filterpy, with which the engines are compared."""

from collections.abc import Callable
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Filter
from jerkbench.timeline import Timeline

Loop = Callable[[Timeline, Filter], tuple[FloatArray, FloatArray]]


def filterpy_loop(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray]:
    """Run a plain loop over filterpy's KalmanFilter, and return the states and the diagonals of P, (n, 9) each."""
    kf = _filterpy_filter(timeline, model)
    steps = zip(timeline.dt_s.tolist(), timeline.sample.tolist(), timeline.update.tolist(), strict=True)
    u, z, R = timeline.accel_enu_mps2[:, :, None], timeline.measurements.z[:, :, None], timeline.measurements.R
    n = len(timeline.dt_s)
    x, variance = np.empty((n, kf.dim_x)), np.empty((n, kf.dim_x))
    for k, (dt, sample, update) in enumerate(steps):
        if dt > 0:
            kf.predict(u=u[sample])
        if update >= 0:
            kf.update(z[update], R=R[update])
        x[k], variance[k] = kf.x[:, 0], np.diag(kf.P)
    return x, variance


def full_model(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return F, B and Q of the nominal step for three axes."""
    A, b, Q = model.axis_model(timeline.dt0_s, timeline.dt0_s)
    return np.kron(A, np.eye(3)), np.kron(b[:, None], np.eye(3)), np.kron(Q, np.eye(3))


def start(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray]:
    """Return the initial state and its covariance."""
    extra = np.repeat(model.initial_variances(), 3)
    x, P = np.concatenate([timeline.x0, np.zeros(len(extra))]), np.diag(np.concatenate([np.zeros(6), extra]))
    P[:6, :6] = timeline.P0
    return x, P


def _filterpy_filter(timeline: Timeline, model: Filter) -> Any:  # noqa: ANN401 - filterpy has no types
    from filterpy.kalman import KalmanFilter

    x, P = start(timeline, model)
    kf = KalmanFilter(dim_x=len(x), dim_z=6, dim_u=3)
    kf.F, kf.B, kf.Q = full_model(timeline, model)
    kf.x, kf.P, kf.H = x[:, None], P, np.eye(6, len(x))
    return kf
