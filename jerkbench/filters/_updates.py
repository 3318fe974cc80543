"""The measurement updates of an estimator whose state begins with position and velocity."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation, Fading
from jerkbench.filters._linear import squared_distance, updated
from jerkbench.memory import empty_memory
from jerkbench.optional import clocked, wants_truth
from jerkbench.timeline.recorder import Recorder
from jerkbench.timeline.timeline import Timeline


class MeasurementUpdates:
    """The measurement updates of one run, with the adaptation's memory."""

    def __init__(self, timeline: Timeline, adaptation: Adaptation, recorder: Recorder) -> None:
        """Start with an empty memory; an adaptation that asks for the true covariances gets them."""
        measured = timeline.measurements
        adaptation = clocked(adaptation, timeline)
        self.measured, self.adaptation, self.recorder = measured, adaptation, recorder
        self.R = measured.covariances(true=wants_truth(adaptation))
        self.memory = empty_memory(adaptation)
        self.fade = adaptation.fade if isinstance(adaptation, Fading) else None

    def __call__(self, row: int, x: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x and P after the measurement ``row``, and the prior covariance that it took, which may be faded.

        Where every row of it is dropped the state stays as it is.
        """
        z = self.measured.z[row]
        rows = np.flatnonzero(np.isfinite(z))
        block = np.ix_(rows, rows)
        innovation, R = z[rows] - x[rows], self.R[row][block]
        S = P[block] + self.measured.R[row][block]
        nis, log_det = squared_distance(innovation, S), float(np.linalg.slogdet(S)[1])
        if self.fade is not None and len(rows):
            P = P * self.fade(innovation, P[block], R, rows, self.memory)
        prior = P
        R = self.adaptation.adapt(innovation, P[block], R, rows, self.memory) if len(rows) else R
        kept, used = np.isfinite(np.diag(R)), float("nan")
        if kept.any():
            few = np.ix_(kept, kept)
            used = squared_distance(innovation[kept], P[block][few] + R[few])
            x, P = updated(x, P, innovation[kept], np.eye(len(x))[rows[kept]], R[few])
        self.recorder.update(row, rows, innovation, np.diag(R), nis, used, log_det)
        return x, P, prior
