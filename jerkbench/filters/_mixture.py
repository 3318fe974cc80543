"""Kinematic filters that run side by side and are mixed at each update: the algorithm of `imm`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Adaptation, Filter
from jerkbench.estimate import Estimate
from jerkbench.filters.common import StepModels, initial
from jerkbench.kalman import is_healthy, squared_distance, updated
from jerkbench.optional import clocked, empty_memory, wants_truth
from jerkbench.timeline import Recorder, Timeline


@dataclass(frozen=True)
class WithInertState:
    """The baseline with a third state that does nothing.

    Attributes:
        baseline: the filter itself.
        variance: initial variance of the third state, that of the filter it is mixed with.
    """

    baseline: Filter
    variance: float

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (3, 3), b (3,), Q (3, 3) for a step of ``dt`` seconds."""
        A, b, Q = np.eye(3), np.zeros(3), np.zeros((3, 3))
        A[:2, :2], b[:2], Q[:2, :2] = self.baseline.axis_model(dt, dt0)
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return (1,) the variance of the third state."""
        return np.array([self.variance])


def embedded(model: Filter, like: Filter) -> Filter:
    """Return ``model`` with as many states as ``like``, or itself where it has them."""
    wanted = like.initial_variances()
    return model if len(model.initial_variances()) >= len(wanted) else WithInertState(model, float(wanted[0]))


def mixed_start(
    timeline: Timeline, models: Sequence[Filter], transitions: FloatArray, mu: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mixed states (k, n), covariances (k, n, n) and weights c (k,) of k filters at the start."""
    starts = [initial(timeline, model) for model in models]
    return mixed(np.array([x for x, _ in starts]), np.array([P for _, P in starts]), mu, transitions)


class Mixture:
    """The state of one run: the filters and the weights c of the mixed states."""

    def __init__(
        self,
        timeline: Timeline,
        models: Sequence[Filter],
        transitions: FloatArray,
        mu: FloatArray,
        adaptation: Adaptation,
    ) -> None:
        """Start all filters from the timeline's start."""
        self.timeline, self.transitions = timeline, transitions
        self.models = [StepModels(model, timeline.dt0_s) for model in models]
        self.x, self.P, self.weights = mixed_start(timeline, models, transitions, mu)
        measured = timeline.measurements
        self.R = measured.covariances(true=wants_truth(adaptation))
        self.adaptation, self.memory = clocked(adaptation, timeline), empty_memory(adaptation)
        self.recorder = Recorder(timeline)

    def to_the_end(self) -> Estimate:
        """Go through the timeline; stops at the first sign of divergence."""
        t = self.timeline
        steps = zip(t.dt_s.tolist(), t.sample.tolist(), t.update.tolist(), t.reference.tolist(), strict=True)
        for k, (dt, sample, update, reference) in enumerate(steps):
            if dt > 0:
                self._predict(dt, t.accel_enu_mps2[sample])
            if update >= 0 and not self._update(update):
                return self.recorder.estimate(f"the covariance is no longer positive definite at {t.t_s[k]:.2f} s")
            if reference >= 0:
                x, P = combined(self.x, self.P, self.weights)
                self.recorder.state(reference, x[:6], P[:6, :6])
        return self.recorder.estimate()

    def _predict(self, dt: float, u: FloatArray) -> None:
        for j, models in enumerate(self.models):
            F, B, Q = models.of(dt)
            self.x[j], self.P[j] = F @ self.x[j] + B @ u, F @ self.P[j] @ F.T + Q

    def _update(self, row: int) -> bool:
        """Adapt R by the combined prediction, update all, weigh and mix; return whether all are healthy."""
        rows, R = self._adapted(row)
        if not len(rows):
            return True
        z, H = self.timeline.measurements.z[row], np.eye(self.x.shape[1])[rows]
        log_likelihood = np.empty(len(self.models))
        for j in range(len(self.models)):
            y = z[rows] - self.x[j, rows]
            log_likelihood[j] = log_density(y, self.P[j][np.ix_(rows, rows)] + R)
            self.x[j], self.P[j] = updated(self.x[j], self.P[j], y, H, R)
        if not all(is_healthy(x, P) for x, P in zip(self.x, self.P, strict=True)):
            return False
        mu = weighed(self.weights, log_likelihood)
        self.x, self.P, self.weights = mixed(self.x, self.P, mu, self.transitions)
        return True

    def _adapted(self, row: int) -> tuple[IntArray, FloatArray]:
        """Return the rows that are used, and their R, from the innovation of the combined prediction, which is kept."""
        x, P = combined(self.x, self.P, self.weights)
        measured = self.timeline.measurements
        rows = np.flatnonzero(np.isfinite(measured.z[row]))
        block = np.ix_(rows, rows)
        y, HPHt = measured.z[row, rows] - x[rows], P[block]
        S = HPHt + measured.R[row][block]
        nis, log_det = squared_distance(y, S), float(np.linalg.slogdet(S)[1])
        R = self.adaptation.adapt(y, HPHt, self.R[row][block], rows, self.memory)
        kept = np.isfinite(np.diag(R))
        few = np.ix_(kept, kept)
        used = squared_distance(y[kept], HPHt[few] + R[few]) if kept.any() else float("nan")
        self.recorder.update(row, rows, y, np.diag(R), nis, used, log_det)
        return rows[kept], R[few]


def mixed(
    x: FloatArray, P: FloatArray, mu: FloatArray, transitions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mixed states (k, n), covariances (k, n, n) and the weights c (k,) that a cycle begins with."""
    joint = transitions * mu[:, None]
    c = joint.sum(axis=0)
    parts = [combined(x, P, joint[:, j] / c[j]) for j in range(len(c))]
    return np.array([x for x, _ in parts]), np.array([P for _, P in parts]), c


def combined(x: FloatArray, P: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean (n,) and covariance (n, n) of a mixture of normal distributions."""
    mean = weights @ x
    deviation = x - mean
    spread = np.einsum("j,ja,jb->ab", weights, deviation, deviation)
    return mean, np.tensordot(weights, P, axes=1) + spread


def weighed(c: FloatArray, log_likelihood: FloatArray) -> FloatArray:
    """Return mu (k,); the largest likelihood is taken out first, so that none underflows to nothing but the smaller."""
    likely = c * np.exp(log_likelihood - log_likelihood.max())
    return np.asarray(likely / likely.sum())


def log_density(y: FloatArray, S: FloatArray) -> float:
    """Return log N(y; 0, S)."""
    log_det = np.linalg.slogdet(S)[1]
    return float(-0.5 * (squared_distance(y, S) + log_det + len(y) * np.log(2.0 * np.pi)))
