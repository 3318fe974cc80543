"""Error of the displacement over a driven distance: drift, without what was wrong before."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import driven_m
from jerkbench.evaluation.navigation_errors import known, position_error_m, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "relative_error")
@dataclass(frozen=True)
class RelativeError:
    """Error of the displacement over a fixed distance, relative to it.

    With e_i = p_i - p_ref,i at the N counted rows, s_i the distance that the reference has driven up to row i, and j(i)
    the first row with s_j >= s_i + d::

        relative_error_percent = 100/d sqrt(mean over i of |e_j(i) - e_i|^2)

    Nothing is rotated or aligned: attitude errors are errors of the displacement. Rows within the last d metres begin
    no stretch; NaN without any. Not computed unless asked for: ``metrics=[relative_error]``.

    Source: Geiger, Lenz and Urtasun, "Are we ready for autonomous driving?", CVPR 2012, 3.2, without the alignment.

    Attributes:
        distance_m: d [m].
    """

    default: ClassVar[bool] = False

    distance_m: float = 50.0

    def __post_init__(self) -> None:
        """Check the distance."""
        if not self.distance_m > 0:
            raise PluginError(f"metric relative_error: distance_m is {self.distance_m}; it must be more than 0.")

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        error = position_error_m(estimate, recording)[rows]
        if len(error) == 0:
            return {"relative_error_percent": np.nan}
        begin, end = _stretches(driven_m(recording.reference)[estimate.index[rows]], self.distance_m)
        return {"relative_error_percent": 100 * rms_norm(error[end] - error[begin]) / self.distance_m}


def _stretches(driven_m: FloatArray, distance_m: float) -> tuple[IntArray, IntArray]:
    """Return the rows at which stretches begin, and those at which they end."""
    end = np.searchsorted(driven_m, driven_m + distance_m * (1 - 1e-12))
    begin = np.flatnonzero(end < len(driven_m))
    return np.asarray(begin, dtype=np.int64), np.asarray(end[begin], dtype=np.int64)
