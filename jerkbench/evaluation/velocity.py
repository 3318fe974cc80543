"""Velocity errors."""

from dataclasses import dataclass

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, rms_norm, velocity_error_mps
from jerkbench.plugins import register
from jerkbench.recording import Recording

AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_up": (2,)}
"""What the column's name says, and the axes that it takes."""


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
        error = velocity_error_mps(estimate, recording)
        truth = recording.reference.velocity_mps
        return {
            f"velocity_rmse{name}_mps": rms_norm(error[counted & known(truth, estimate, axes)][:, axes])
            for name, axes in AXES.items()
        }
