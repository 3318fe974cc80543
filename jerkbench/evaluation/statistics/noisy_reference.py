"""An RMSE against a reference that has errors of its own."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.blocks import RecordingInterval, block_interval


@dataclass(frozen=True)
class AgainstNoise:
    """The RMSE as measured, and with the reference's own noise taken out.

    Attributes:
        raw: against the reference as it is, with its block-bootstrap interval.
        own: sqrt(raw^2 - sigma^2); 0 where the reference explains all of it.
        low: lower end of its interval; NaN where the recording is too short for one.
        high: upper end.
        sigma: root mean square of the reference's error, over the same rows.
    """

    raw: RecordingInterval
    own: float
    low: float
    high: float
    sigma: float


def without_reference_noise(squares: FloatArray, variances: FloatArray, confidence: float = 0.95) -> AgainstNoise:
    """Return the RMSE of (n,) squared errors, of which ``variances`` (n,) are expected of the reference alone.

    Errors of filter and reference that do not know each other add up in the squares::

        mean |p - r|^2 = mean |p - p_true|^2 + mean trace(R_reference)

    so the reference's part is taken from each row before the mean, and the moving-block bootstrap is that of the
    rows. A reference made of the same fixes as the filter's is no such reference.
    """
    raw = block_interval(squares, confidence)
    variance = float(np.mean(variances)) if len(variances) else np.nan
    own, low, high = (
        float(np.sqrt(max(0.0, end**2 - variance))) if np.isfinite(end) else np.nan
        for end in (raw.rmse, raw.low, raw.high)
    )
    return AgainstNoise(raw, own, low, high, float(np.sqrt(variance)))
