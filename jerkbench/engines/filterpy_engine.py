"""The reference engine, which runs filterpy's KalmanFilter one step at a time and defines the correct results."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    Fading,
    Filter,
    clocked,
    empty_memory,
    wants_truth,
)
from jerkbench.errors import require_known
from jerkbench.estimate import Estimate
from jerkbench.kalman import (
    ROUNDING,
    gain_and_rest,
    innovation_factor,
    is_positive_definite,
    joseph,
    moved,
    rounding_noise,
    spread_by,
    squared_distance_by,
    without_measured,
)
from jerkbench.numpy_run import Recorder, StepModels, initial
from jerkbench.plugins import register
from jerkbench.timeline import Timeline


@register("engine", "filterpy")
@dataclass(frozen=True)
class FilterpyEngine:
    """Runs any filter with any adaptation on filterpy.kalman.KalmanFilter.

    In the following equations of an update, H = [I6 0], y = z - H x, and R is adapted before the update::

        S = H P H' + R = L L',    K = P H' S^-1 (by L),    x = x + K y
        joseph:  P = (I - K H) P (I - K H)' + K R K', symmetrised
        paper:   P = P - K S K', as in the paper (rounding errors grow to 1e-5 m after 15 000 steps)

    A run ends at an update if S is not numerically symmetric and positive definite (`jerkbench.kalman.ROUNDING`). A run
    also ends if P after the update is not positive definite up to rounding (`jerkbench.kalman.INDEFINITE`), or if a
    posterior variance consists only of rounding errors (`jerkbench.kalman.spread_by`).

    Source: R. R. Labbe, filterpy 2 (MIT).

    Attributes:
        covariance: name of the form of the covariance update, "joseph" or "paper".
    """

    covariance: str = "joseph"

    def __post_init__(self) -> None:
        require_known("covariance update", self.covariance, ("joseph", "paper"))

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Run the filter ``model`` with ``adaptation`` over ``timeline``. The estimate ends if the filter diverges."""
        t, run = timeline, _Run(timeline, model, adaptation, joseph=self.covariance == "joseph")
        steps = zip(t.dt_s.tolist(), t.sample.tolist(), t.update.tolist(), t.reference.tolist(), strict=True)
        for dt, sample, update, reference in steps:
            if dt > 0:
                run.predict(dt, t.accel_enu_mps2[sample, :, None])
            if update >= 0 and (failure := run.update(update)):
                return run.recorder.estimate(failure)
            if reference >= 0:
                run.recorder.state(reference, run.kf.x[:6, 0], run.kf.P[:6, :6])
        return run.recorder.estimate()


class _Run:
    """The state of one run: the filter of filterpy, the step models, the memory of the adaptation, and the results."""

    def __init__(self, timeline: Timeline, model: Filter, adaptation: Adaptation, *, joseph: bool) -> None:
        adaptation = clocked(adaptation, timeline)
        self.timeline, self.adaptation, self.joseph = timeline, adaptation, joseph
        measured = timeline.measurements
        self.z, self.reported = measured.z, measured.R
        self.R = measured.covariances(true=wants_truth(adaptation))
        self.kf = _new_filter(timeline, model)
        self.memory = empty_memory(adaptation, len(self.kf.x))
        self.fade = adaptation.fade if isinstance(adaptation, Fading) else None
        self.adapt_prior = adaptation.adapt_prior if isinstance(adaptation, AdaptingPrior) else None
        self.adapt_gain = adaptation.adapt_gain if isinstance(adaptation, AdaptingGain) else None
        self.since = np.eye(len(self.kf.x)), np.zeros_like(self.kf.P)  # F and Q of all steps since the last update
        self.models = StepModels(model, timeline.dt0_s)
        self.recorder = Recorder(timeline)

    def predict(self, dt: float, u: FloatArray) -> None:
        """Predict the state over ``dt`` seconds with the acceleration ``u`` (3, 1) in ENU [m/s2]."""
        F, B, Q = self.models.of(dt)
        self.kf.predict(u=u, B=B, F=F, Q=Q)
        if self.adapt_prior is not None:
            self.since = F @ self.since[0], F @ self.since[1] @ F.T + Q

    def update(self, update: int) -> str:
        """Adapt R and update the filter with row ``update`` of the measurements.

        Returns the reason if the filter has diverged, otherwise an empty string. The adaptation may also change the
        prior covariance. The adaptation is not called if no component was measured.
        """
        kf, z, memory = self.kf, self.z[update], self.memory
        rows = np.flatnonzero(np.isfinite(z))
        block = np.ix_(rows, rows)
        innovation, HPHt, R = z[rows] - kf.x[rows, 0], kf.P[block], self.R[update][block]
        factor = innovation_factor(HPHt + self.reported[update][block])
        nis = used = log_det = np.nan
        variances, healthy = np.full(len(rows), np.nan), False
        if factor is not None:
            nis, log_det = squared_distance_by(innovation, factor), 2.0 * float(np.log(np.diag(factor)).sum())
            if rows.size and self.fade is not None:
                kf.P = kf.P * self.fade(innovation, HPHt, R, rows, memory)
            if rows.size and self.adapt_prior is not None:
                P = self.adapt_prior(kf.x[:, 0], kf.P, *self.since, innovation, R, rows, memory)
                kf.P, self.since = 0.5 * (P + P.T), (np.eye(len(P)), np.zeros_like(P))
            if rows.size:
                R = self.adaptation.adapt(innovation, kf.P[block], R, rows, memory)
            variances, (used, healthy) = np.diag(R), self._correct(innovation, R, rows)
        self.recorder.update(update, rows, innovation, variances, nis, used, log_det)
        time_s = float(self.timeline.measurements.t_ns[update] * 1e-9)
        return "" if healthy else f"the covariance is no longer positive definite at {time_s:.2f} s"

    def _correct(self, innovation: FloatArray, R: FloatArray, rows: IntArray) -> tuple[float, bool]:
        """Update with the rows whose variance is finite. Return the NIS of these rows, and the result of `_is_sound`.

        The update of filterpy is not used, because filterpy inverts S, which is not accurate enough after a gap in the
        measurements (see `jerkbench.kalman`).
        """
        finite = np.isfinite(np.diag(R))
        if not finite.any():
            return np.nan, self._is_sound(np.zeros(len(self.kf.x)))
        kf, R, y, rows = self.kf, R[np.ix_(finite, finite)], innovation[finite], rows[finite]
        prior = kf.P
        PHt = prior[:, rows]
        S = PHt[rows] + R
        factor = innovation_factor(S)
        if factor is None:
            return np.nan, False
        if self.adapt_gain is None:
            K, rest = gain_and_rest(PHt, R, factor, rows)
            step = moved(PHt, y, R, factor, rows)
        else:
            K = self.adapt_gain(kf.x[:, 0], prior, y, R, rows, self.memory)
            step, rest = K @ y, without_measured(K, rows)
        kf.x = kf.x + step[:, None]
        kf.P = joseph(prior, K, rest, R) if self.joseph or self.adapt_gain else prior - K @ S @ K.T
        return squared_distance_by(y, factor), self._is_sound(spread_by(K, rest, prior, R, rows))

    def _is_sound(self, spread: FloatArray) -> bool:
        """Return whether x is finite and P is positive definite, after an increase of variances that are too small.

        The argument ``spread`` (n,) is the scale of the rounding errors of the variances
        (`jerkbench.kalman.spread_by`).
        """
        variances = np.diag(self.kf.P).copy()
        left = variances > ROUNDING * spread
        self.kf.P = self.kf.P + np.diag(rounding_noise(variances, spread))
        return bool(left.all() and np.isfinite(self.kf.x).all() and is_positive_definite(self.kf.P))


def _new_filter(timeline: Timeline, model: Filter) -> Any:  # noqa: ANN401 - filterpy has no types
    from filterpy.kalman import KalmanFilter  # this import takes a second, because it loads pyplot

    x, P = initial(timeline, model)
    kf = KalmanFilter(dim_x=len(x), dim_z=6)
    kf.x, kf.P = x[:, None], P
    return kf
