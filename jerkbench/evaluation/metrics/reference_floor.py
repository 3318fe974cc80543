"""The floor that the reference's own errors put under an RMSE."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "reference_floor")
@dataclass(frozen=True)
class ReferenceFloor:
    """The position RMSE that a perfect estimate would have, as the reference is not perfect.

    With s_ia one standard deviation of the reference's position on axis a, over the N counted rows that have it::

        reference_floor_m = sqrt(1/N sum_i sum_a s_ia^2)

    An RMSE near it says nothing about the filter, and differences of two RMSEs below it get no verdict. NaN where the
    recording does not say how good its reference is (``reference_sigma`` of a table).
    """

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        sigma_m = recording.reference.sigma_m
        rows = counted & known(recording.reference.enu_m, estimate)
        return {"reference_floor_m": np.nan if sigma_m is None else rms_norm(sigma_m[estimate.index[rows]])}
