"""Functions (timeline, model, runs) -> function that returns the positions [m] of a batch, for simdkalman and torch-kf.

All steps have the nominal length, as in the workload of engines.py. Run r uses input and measurement i + r as its input
and measurement i.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from plain_loops import full_model, start

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Filter
from jerkbench.timeline import Timeline

Run = Callable[[], FloatArray]


def simdkalman_runs(timeline: Timeline, model: Filter, runs: int) -> Run:
    """Return a batch that uses the primitives of simdkalman, which accept a stack of states."""
    from simdkalman.primitives import predict, update

    F, _, Q = full_model(timeline, model)
    H = np.eye(6, len(F))
    return step_by_step(
        timeline,
        model,
        runs,
        np.asarray,
        lambda state: predict(*state, F, Q),
        lambda state, z, R: update(*state, H, R, z),
    )


def torch_kf_runs(timeline: Timeline, model: Filter, runs: int) -> Run:
    """Return a batch that uses torch-kf in double precision on one CPU thread, with its default covariance update.

    Several threads would wait for each other in busy loops, and busy loops increase the CPU time.
    """
    import torch
    from torch_kf import GaussianState, KalmanFilter

    torch.set_num_threads(1)
    F, _, Q = (torch.from_numpy(matrix) for matrix in full_model(timeline, model))
    kf = KalmanFilter(F, torch.eye(6, len(F), dtype=F.dtype), Q, torch.eye(6, dtype=F.dtype))

    def predict(state: tuple[Any, Any]) -> tuple[Any, Any]:
        after = kf.predict(GaussianState(*state))
        return after.mean, after.covariance

    def update(state: tuple[Any, Any], z: Any, R: Any) -> tuple[Any, Any]:  # noqa: ANN401 - the library has no types
        after = kf.update(GaussianState(*state), z, measurement_noise=R)
        return after.mean, after.covariance

    return step_by_step(timeline, model, runs, torch.from_numpy, predict, update)


def step_by_step(
    timeline: Timeline,
    model: Filter,
    runs: int,
    array: Callable[[FloatArray], Any],
    predict: Callable[..., tuple[Any, Any]],
    update: Callable[..., tuple[Any, Any]],
) -> Run:
    """Return a loop over the steps for libraries without an input. B u is added after the prediction."""
    m0, P0 = (array(np.repeat(first[None], runs, axis=0)) for first in start(timeline, model))
    B, given = array(full_model(timeline, model)[1]), timeline.measurements
    u, z, R = (array(onward(rows, runs)) for rows in (timeline.accel_enu_mps2, given.z, given.R))
    np.empty(30_000_000, np.uint8)  # prevents that glibc unmaps memory in each step (70 % slower)
    steps = list(zip(timeline.dt_s.tolist(), timeline.sample.tolist(), timeline.update.tolist(), strict=True))

    def run() -> FloatArray:
        state, position_m = (m0[..., None], P0), array(np.empty((runs, len(steps), 3)))
        for k, (dt, i, j) in enumerate(steps):
            if dt > 0:
                m, P = predict(state)
                state = m + B @ u[i : i + runs, :, None], P
            if j >= 0:
                state = update(state, z[j : j + runs, :, None], R[j : j + runs])
            position_m[:, k] = state[0][:, :3, 0]
        return np.asarray(position_m)

    return run


def onward(rows: FloatArray, runs: int) -> FloatArray:
    """Return the rows, followed by as many of the first rows as the last run needs."""
    return np.resize(rows, (len(rows) + runs, *rows.shape[1:]))
