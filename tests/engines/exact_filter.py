"""A Kalman filter in sixty decimal digits: what both engines should come to, whatever the gaps."""

from decimal import Decimal, localcontext

import numpy as np

from decimals import exact, numbers, solve

DIGITS = 60


class ExactRun:
    """One run; the filter's matrices and the adaptation are in doubles, as its plugins give them."""

    def __init__(self, timeline, model, adaptation):
        extra = np.repeat(model.initial_variances(), 3)
        P0 = np.diag(np.concatenate([np.zeros(6), extra]))
        P0[:6, :6] = timeline.P0
        self.timeline, self.model, self.adaptation = timeline, model, adaptation
        self.x, self.P = exact(np.concatenate([timeline.x0, np.zeros(len(extra))])), exact(P0)
        self.memory = np.zeros(adaptation.memory_size() if hasattr(adaptation, "memory_size") else 0)

    def states(self):
        """Return x (k, 6) and P (k, 6, 6) at the stamps of the reference."""
        with localcontext() as context:
            context.prec = DIGITS
            kept = list(self._steps())
        return tuple(map(np.array, zip(*kept, strict=True)))

    def _steps(self):
        t = self.timeline
        for k, dt in enumerate(t.dt_s.tolist()):
            if dt > 0:
                A, b, Q = self.model.axis_model(dt, t.dt0_s)
                F, B, Q = (exact(np.kron(matrix, np.eye(3))) for matrix in (A, b[:, None], Q))
                self.x = F @ self.x + B @ exact(t.accel_enu_mps2[t.sample[k]])
                self.P = F @ self.P @ F.T + Q
            if t.update[k] >= 0:
                self._update(t.update[k])
            if t.reference[k] >= 0:
                yield numbers(self.x[:6]), numbers(self.P[:6, :6])

    def _update(self, which):
        z, R = self.timeline.measurements.z[which], self.timeline.measurements.R[which]
        rows = np.flatnonzero(np.isfinite(z))
        block = np.ix_(rows, rows)
        y, HPHt, R = exact(z[rows]) - self.x[rows], self.P[block], R[block]
        if hasattr(self.adaptation, "fade"):
            factor = Decimal(float(self.adaptation.fade(numbers(y), numbers(HPHt), R, rows, self.memory)))
            self.P, HPHt = self.P * factor, HPHt * factor
        R = self.adaptation.adapt(numbers(y), numbers(HPHt), R, rows, self.memory)
        kept = np.isfinite(np.diag(R))
        used = rows[kept]
        W = self.P[used]
        Kt = solve(W[:, used] + exact(R[np.ix_(kept, kept)]), W)
        self.x, self.P = self.x + y[kept] @ Kt, self.P - W.T @ Kt
