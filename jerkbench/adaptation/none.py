"""No adaptation."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("adaptation", "none")
@dataclass(frozen=True)
class NoAdaptation:
    """R as the receiver reports it.

    The row that every adaptation has to beat.

    Source: the Kalman filter (R. E. Kalman, 1960, doi:10.1115/1.3662552).
    """

    provenance = Provenance("published", "doi:10.1115/1.3662552")
    changes_nothing: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R
