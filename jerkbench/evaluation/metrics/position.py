"""Errors of position and velocity: root mean square, percentiles and drift."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import POSITION_AXES, VELOCITY_AXES
from jerkbench.evaluation.navigation_errors import known, mean, position_error_m, rms
from jerkbench.evaluation.sums import Summed
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "position_rmse")
@dataclass(frozen=True)
class PositionRmse(Summed):
    """Root mean square and largest position error, without any alignment.

    With e_i = p_i - p_ref,i [m], ENU, over the N counted rows whose reference is known on the axes in question::

        position_rmse_m             = sqrt(1/N sum |e_i|^2)                  east, north and up
        position_rmse_horizontal_m  = sqrt(1/N sum (e_east^2 + e_north^2))
        position_rmse_east_m, _north_m, _up_m                                each axis alone
        position_rmse_whole_m       = the first, over all scored rows: the burn-in counts too
        position_max_m              = max |e_i|

    NaN without a single such row.
    """

    reads_nees: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the seven values by column name."""
        each = zip(POSITION_AXES, sums.position_m2, sums.position_rows, strict=True)
        values = {f"position_rmse{name}_m": rms(square, rows) for name, square, rows in each}
        values["position_rmse_whole_m"] = rms(sums.whole_m2, sums.whole_rows)
        values["position_max_m"] = sums.position_max_m
        return values


# Velocity errors.


@register("metric", "velocity_rmse")
@dataclass(frozen=True)
class VelocityRmse(Summed):
    """Root mean square velocity error.

    With e_i = v_i - v_ref,i [m/s], ENU, over the N counted rows whose reference is known on the axes in question::

        velocity_rmse_mps             = sqrt(1/N sum |e_i|^2)                  east, north and up
        velocity_rmse_horizontal_mps  = sqrt(1/N sum (e_east^2 + e_north^2))
        velocity_rmse_up_mps          = sqrt(1/N sum e_up^2)

    NaN without a single such row.
    """

    reads_nees: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the three values by column name."""
        each = zip(VELOCITY_AXES, sums.velocity_m2ps2, sums.velocity_rows, strict=True)
        return {f"velocity_rmse{name}_mps": rms(square, rows) for name, square, rows in each}


# Percentiles of the position error.

PERCENTILES = (50, 68, 95, 99)


@register("metric", "percentiles")
@dataclass(frozen=True)
class Percentiles:
    """Percentiles of the length of the position error.

    With e_i = p_i - p_ref,i [m] over the N counted rows, position_pQ_m is the value that Q % of the |e_i| do not exceed
    (linear between the order statistics). Horizontal likewise, with east and north.

    NaN without a row. Not computed unless asked for: ``metrics=[percentiles]``.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the eight values by column name."""
        values: dict[str, float] = {}
        for name, axes in (("", (0, 1, 2)), ("_horizontal", (0, 1))):
            rows = counted & known(recording.reference.enu_m, estimate, axes)
            with np.errstate(over="ignore", invalid="ignore"):
                norm = np.sqrt(np.sum(position_error_m(estimate, recording)[rows][:, axes] ** 2, axis=1))
                percentiles = np.percentile(norm, PERCENTILES) if len(norm) else np.full(len(PERCENTILES), np.nan)
            values |= {f"position{name}_p{q}_m": float(v) for q, v in zip(PERCENTILES, percentiles, strict=True)}
        return values


# The growth of the position error while there is no aiding.


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift(Summed):
    """Growth of the position error over an outage, per second.

    With f(j) and l(j) the first and the last row inside outage j, as in the metric `outage`, and e_i the error [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error with which the outage began does not count. NaN without an outage of two rows.
    """

    reads_nees: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}
