"""The recorder of a run: its states and updates, in arrays that are made once."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.estimate import Estimate, Updates
from jerkbench.timeline.timeline import Timeline


class Recorder:
    """States at the reference's stamps and what each update saw, in the order in which they come."""

    def __init__(self, timeline: Timeline) -> None:
        """Make room for every stamp of the reference and every update of ``timeline``."""
        references, updates = int((timeline.reference >= 0).sum()), int((timeline.update >= 0).sum())
        self._timeline = timeline
        self._index = np.empty(references, dtype=np.int64)
        self._x, self._P = np.empty((references, 6)), np.empty((references, 6, 6))
        self._which = np.empty(updates, dtype=np.int64)
        self._counts, self._nis, self._nis_used, self._log_det = np.empty((4, updates))
        self._innovation, self._R = np.full((updates, 6), np.nan), np.full((updates, 6), np.nan)
        self._k = self._m = 0

    def state(self, reference: int, x: FloatArray, P: FloatArray) -> None:
        """Keep position, velocity and their covariance at a stamp of the reference."""
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
        """Keep what an update saw."""
        m = self._m
        self._which[m], self._counts[m] = which, len(rows)
        self._nis[m], self._nis_used[m], self._log_det[m] = nis, nis_used, log_det
        self._innovation[m, rows], self._R[m, rows] = innovation, R_diagonal
        self._m += 1

    def estimate(self, failure: str = "") -> Estimate:
        """Return what was collected so far."""
        k, m = self._k, self._m
        t_s = np.asarray(self._timeline.measurements.t_ns[self._which[:m]] * 1e-9, dtype=np.float64)
        scalars = self._counts[:m], self._nis[:m], self._nis_used[:m]
        updates = Updates(t_s, *scalars, self._innovation[:m], self._R[:m], self._log_det[:m])
        index, x = self._index[:k], self._x[:k]
        return Estimate(index, x[:, :3], x[:, 3:], self._P[:k], self._timeline.euler_rad[index], updates, failure)
