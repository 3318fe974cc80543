"""Parts of a run in NumPy: step models, initial state, updates with an adapted R, and a recorder of the results."""

from collections.abc import Callable
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Adaptation, Fading, Filter, clocked, empty_memory, wants_truth
from jerkbench.estimate import Estimate, Updates
from jerkbench.kalman import squared_distance
from jerkbench.timeline import Timeline


class StepModels:
    """The models of the time steps of a filter, in a cache whose key is the length of the step in nanoseconds."""

    def __init__(self, model: Filter, dt0_s: float) -> None:
        self._model, self._dt0_s = model, dt0_s
        self._known: dict[int, tuple[Any, Any, Any]] = {}

    def of(self, dt_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return F (n, n), B (n, 3) and Q (n, n) of a step of ``dt_s`` seconds, from the cache if possible.

        The matrices are the Kronecker products of the model of one axis with I3.
        """
        key = round(dt_s * 1e9)
        if key not in self._known:
            A, b, Q = self._model.axis_model(dt_s, self._dt0_s)
            self._known[key] = np.kron(A, np.eye(3)), np.kron(b[:, None], np.eye(3)), np.kron(Q, np.eye(3))
        return self._known[key]

    def predicted(
        self, x: FloatArray, P: FloatArray, dt_s: float, u: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x (n,) and P (n, n) after a step of ``dt_s`` seconds with the input u (3,), and F (n, n)."""
        F, B, Q = self.of(dt_s)
        return F @ x + B @ u, F @ P @ F.T + Q, F


def initial(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray]:
    """Return the initial state x (n,) of the filter ``model`` and its covariance P (n, n) for a timeline."""
    extra = np.repeat(model.initial_variances(), 3)
    P = np.diag(np.concatenate([np.zeros(6), extra]))
    P[:6, :6] = timeline.P0
    return np.concatenate([timeline.x0, np.zeros(len(extra))]), P


# The measurement updates. In each update, the adaptation returns R, and a recorder stores the results.


class Recorder:
    """Stores the estimated states at the stamps of the reference, and the innovation and NIS of each update."""

    def __init__(self, timeline: Timeline) -> None:
        references, updates = timeline.visits
        self._timeline = timeline
        self._index = np.empty(references, dtype=np.int64)
        self._x, self._P = np.empty((references, 6)), np.empty((references, 6, 6))
        self._which = np.empty(updates, dtype=np.int64)
        self._counts, self._nis, self._nis_used, self._log_det = np.empty((4, updates))
        self._innovation, self._R = np.full((updates, 6), np.nan), np.full((updates, 6), np.nan)
        self._k = self._m = 0

    def state(self, reference: int, x: FloatArray, P: FloatArray) -> None:
        """Store the position and velocity (6,) and their covariance (6, 6) at a stamp of the reference."""
        self._index[self._k], self._x[self._k], self._P[self._k] = reference, x, P
        self._k += 1

    def update(
        self,
        which: int,
        rows: IntArray,
        innovation: FloatArray,
        R_diagonal: FloatArray,
        nis: float,
        nis_used: float,
        log_det: float = np.nan,
    ) -> None:
        """Store the innovation, the adapted variances and the NIS of one measurement update."""
        m = self._m
        self._which[m], self._counts[m] = which, len(rows)
        self._nis[m], self._nis_used[m], self._log_det[m] = nis, nis_used, log_det
        self._innovation[m, rows], self._R[m, rows] = innovation, R_diagonal
        self._m += 1

    def estimate(self, failure: str = "") -> Estimate:
        """Return an estimate that contains all states and updates that have been stored."""
        k, m = self._k, self._m
        t_s = np.asarray(self._timeline.measurements.t_ns[self._which[:m]] * 1e-9, dtype=np.float64)
        scalars = self._counts[:m], self._nis[:m], self._nis_used[:m]
        updates = Updates(t_s, *scalars, self._innovation[:m], self._R[:m], self._log_det[:m])
        index, x = self._index[:k], self._x[:k]
        return Estimate(index, x[:, :3], x[:, 3:], self._P[:k], self._timeline.euler_rad[index], updates, failure)


Innovate = Callable[[FloatArray, IntArray], tuple[FloatArray, FloatArray]]
"""A function that returns the innovation y (m,) and H P H' (m, m) for the measured values z (m,) and their rows."""


class AdaptedUpdates:
    """Adapts the measurement covariance R in each update of one run, and records the update.

    Attributes:
        recorder: The recorder, which stores the states and updates of the run.
        fading: The factor by which the adaptation multiplied the prior covariance in the latest update (1 by default).
    """

    def __init__(self, timeline: Timeline, adaptation: Adaptation, *, log_det: bool = True) -> None:
        """Select the covariances R of the updates: true covariances for an oracle, otherwise reported covariances."""
        self.measured, self.recorder, self._log_det = timeline.measurements, Recorder(timeline), log_det
        self._R = self.measured.covariances(true=wants_truth(adaptation))
        self._adaptation, self._memory = clocked(adaptation, timeline), empty_memory(adaptation)
        self._fade = self._adaptation.fade if isinstance(self._adaptation, Fading) else None

    def take(self, update: int, innovate: Innovate) -> tuple[FloatArray, FloatArray, IntArray]:
        """Adapt the covariance R of one update, and record the update. R is not adapted if no row is measured.

        Returns:
            The innovation y (m,), the adapted R (m, m), and the indices (m,) of the rows that were not dropped.
        """
        self.fading = 1.0
        z = self.measured.z[update]
        rows = np.flatnonzero(np.isfinite(z))
        block = np.ix_(rows, rows)
        R, (y, HPHt) = self._R[update][block], innovate(z[rows], rows)
        S = HPHt + self.measured.R[update][block]
        nis, log_det = squared_distance(y, S), np.linalg.slogdet(S)[1] if self._log_det else np.nan
        if rows.size and self._fade is not None:
            self.fading = self._fade(y, HPHt, R, rows, self._memory)
            HPHt = HPHt * self.fading
        if rows.size:
            R = self._adaptation.adapt(y, HPHt, R, rows, self._memory)
        retained = np.isfinite(np.diag(R))
        few = np.ix_(retained, retained)
        used = squared_distance(y[retained], HPHt[few] + R[few]) if retained.any() else np.nan
        self.recorder.update(update, rows, y, np.diag(R), nis, used, float(log_det))
        return y[retained], R[few], rows[retained]
