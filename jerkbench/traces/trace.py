"""A trace: the errors of a real receiver's fixes, with the covariances that it reported."""

from dataclasses import dataclass, field

import numpy as np

from jerkbench.arrays import FloatArray, frozen, require, require_times
from jerkbench.errors import RecordingError

LEAST_ROWS = 10
"""A shorter trace has neither a distribution nor a correlation."""


@dataclass(frozen=True)
class About:
    """Where a trace comes from.

    Attributes:
        recording: the fixes.
        reference: what they were compared with.
        licence: of the data that it was derived from; empty: not stated.
        origin: where those data are; empty: not stated.
        offset_m: constant (east, north, up) that was taken off the errors: their median, or zeros.
    """

    recording: str
    reference: str
    licence: str = ""
    origin: str = ""
    offset_m: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Trace:
    """Fixes less reference, in ENU; what is missing in time was a gap.

    Attributes:
        t_s: (m,) times, from 0 on.
        error_m: (m, 3) east, north, up.
        covariance_m2: (m, 3, 3) as the receiver reported it.
        about: where it comes from.
    """

    t_s: FloatArray
    error_m: FloatArray
    covariance_m2: FloatArray
    about: About = field(default_factory=lambda: About("unknown", "unknown"))

    def __post_init__(self) -> None:
        """Check shapes, times, errors and covariances."""
        m = len(self.t_s)
        if m < LEAST_ROWS:
            raise RecordingError(f"A trace of {m} fixes says too little; it needs {LEAST_ROWS}.")
        for name, shape in {"t_s": (m,), "error_m": (m, 3), "covariance_m2": (m, 3, 3)}.items():
            object.__setattr__(self, name, frozen(self, name, getattr(self, name), shape))
        require_times(self, self.t_s)
        require(np.isfinite(self.error_m).all(axis=1), self, "error_m", "the error is no number")
        smallest = np.linalg.eigvalsh(self.covariance_m2)[:, 0]
        require(smallest > 0, self, "covariance_m2", "the covariance is not positive definite")

    @property
    def interval_s(self) -> float:
        """The usual interval between fixes (median)."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def period_s(self) -> float:
        """After so long it begins anew: its length and one interval."""
        return float(self.t_s[-1] - self.t_s[0]) + self.interval_s

    def local_moment_m2(self, window_s: float) -> FloatArray:
        """Return (m, 3, 3) the mean of e e' over the fixes within half a window of each, itself included."""
        squares = self.error_m[:, :, None] * self.error_m[:, None, :]
        sums = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(squares, axis=0)])
        first = np.searchsorted(self.t_s, self.t_s - 0.5 * window_s - 1e-9)
        last = np.searchsorted(self.t_s, self.t_s + 0.5 * window_s + 1e-9)
        return np.asarray((sums[last] - sums[first]) / (last - first)[:, None, None])
