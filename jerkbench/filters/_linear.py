"""The common part of the linear estimators: the model of three axes, the start, one measurement update."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Filter
from jerkbench.timeline.timeline import Timeline


class StepModel(NamedTuple):
    """The model of one step for all three axes.

    Attributes:
        F: (n, n) A (x) I3.
        B: (n, 3) b (x) I3.
        Q: (n, n) Q (x) I3.
    """

    F: FloatArray
    B: FloatArray
    Q: FloatArray


class StepModels:
    """Step models of a filter, made once for each whole nanosecond."""

    def __init__(self, model: Filter, dt0_s: float) -> None:
        """Start without any."""
        self._model, self._dt0_s = model, dt0_s
        self._known: dict[int, StepModel] = {}

    def of(self, dt_s: float) -> StepModel:
        """Return the model of a step of ``dt_s``."""
        key = round(dt_s * 1e9)
        if key not in self._known:
            A, b, Q = self._model.axis_model(dt_s, self._dt0_s)
            self._known[key] = StepModel(_of_three_axes(A), _of_three_axes(b[:, None]), _of_three_axes(Q))
        return self._known[key]


def initial(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray]:
    """Return x (n,) and P (n, n) at the start of ``timeline``."""
    extra = np.repeat(model.initial_variances(), 3)
    P = np.diag(np.concatenate([np.zeros(6), extra]))
    P[:6, :6] = timeline.P0
    return np.concatenate([timeline.x0, np.zeros(len(extra))]), P


def updated(
    x: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x and P after an update; P in Joseph form, symmetrised."""
    PHt = P @ H.T
    K = np.linalg.solve(H @ PHt + R, PHt.T).T
    residual = np.eye(len(x)) - K @ H
    posterior = residual @ P @ residual.T + K @ R @ K.T
    return x + K @ innovation, 0.5 * (posterior + posterior.T)


def squared_distance(y: FloatArray, S: FloatArray) -> float:
    """Return y' S^-1 y."""
    return float(y @ np.linalg.solve(S, y))


def is_healthy(x: FloatArray, P: FloatArray) -> bool:
    """Whether the state is finite and the covariance positive definite."""
    if not (np.isfinite(x).all() and np.isfinite(P).all()):
        return False
    try:
        np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        return False
    return True


def _of_three_axes(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.kron(matrix, np.eye(3)), dtype=np.float64)
