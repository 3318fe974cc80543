"""The innovations and R of a run's updates, from the numbers that are kept of each."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Updates


def updates_seen(t_s: FloatArray, seen: FloatArray) -> Updates:
    """Return the updates at ``t_s`` (m,) from ``seen`` (m, SEEN), in the order of `jerkbench.kinematic.arguments`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log_det = np.asarray(np.log(seen[:, 16]), dtype=np.float64)
    return Updates(t_s, seen[:, 0], seen[:, 1], seen[:, 3], seen[:, 4:10], seen[:, 10:16], log_det)
