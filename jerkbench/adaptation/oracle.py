"""The ceiling: the true covariance of each measurement."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("adaptation", "oracle")
@dataclass(frozen=True)
class Oracle:
    """R is the covariance that each measurement's error was really drawn from.

    Only a simulation (or a simulated disturbance of a recording) knows it; a fixed offset counts as its square on its
    axis. No adaptation of R can be expected to do better: what lies between `none` and this row is what there is to
    gain. Where nothing is known beyond the reported R it equals `none`.
    """

    provenance = Provenance("own", "", "A reference that is told the true R; no method.")

    wants_true_covariance: ClassVar[bool] = True

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R, which the run has already replaced by the true one."""
        return R
