"""Velocity errors."""

from dataclasses import dataclass

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import VELOCITY_AXES
from jerkbench.evaluation.navigation_errors import rms
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "velocity_rmse")
@dataclass(frozen=True)
class VelocityRmse:
    """Root mean square velocity error.

    With e_i = v_i - v_ref,i [m/s], ENU, over the N counted rows whose reference is known on the axes in question::

        velocity_rmse_mps             = sqrt(1/N sum |e_i|^2)                  east, north and up
        velocity_rmse_horizontal_mps  = sqrt(1/N sum (e_east^2 + e_north^2))
        velocity_rmse_up_mps          = sqrt(1/N sum e_up^2)

    NaN without a single such row.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        each = zip(VELOCITY_AXES, sums.velocity_m2ps2, sums.velocity_rows, strict=True)
        return {f"velocity_rmse{name}_mps": rms(square, rows) for name, square, rows in each}
