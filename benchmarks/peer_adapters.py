"""Libraries without compilation: (timeline, model, runs) -> what runs so many at once and returns their positions [m].

The steps are all nominal, as in the workload of engines.py. Run r reads input and measurement number i + r for i.
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
    """The primitives of simdkalman, which take a stack of states."""
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
    """torch-kf in double precision on the CPU, with the covariance update that it takes by itself, on one thread.

    Several threads wait for each other in a loop, which counts as CPU time.
    """
    import torch
    from torch_kf import GaussianState, KalmanFilter

    torch.set_num_threads(1)
    F, _, Q = (torch.from_numpy(matrix) for matrix in full_model(timeline, model))
    kf = KalmanFilter(F, torch.eye(6, len(F), dtype=F.dtype), Q, torch.eye(6, dtype=F.dtype))

    def predict(state: tuple[Any, Any]) -> tuple[Any, Any]:
        after = kf.predict(GaussianState(*state))
        return after.mean, after.covariance

    def update(state: tuple[Any, Any], z: Any, R: Any) -> tuple[Any, Any]:  # noqa: ANN401 - a library without types
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
    """A loop over the steps for libraries whose prediction takes no input: B u is added after it."""
    m0, P0 = (array(np.repeat(first[None], runs, axis=0)) for first in start(timeline, model))
    B, given = array(full_model(timeline, model)[1]), timeline.measurements
    u, z, R = (array(onward(rows, runs)) for rows in (timeline.accel_enu_mps2, given.z, given.R))
    np.empty(30_000_000, np.uint8)  # once it is freed, glibc keeps memory; unmapping at each step costs 70 % more
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
    """Return the rows with as many of the first ones again behind the last as the latest run needs."""
    return np.resize(rows, (len(rows) + runs, *rows.shape[1:]))
