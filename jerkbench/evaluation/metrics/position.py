"""Metrics of position and velocity errors: RMSE with its interval and floor, percentiles, relative error."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate, Sums
from jerkbench.evaluation.correlated_errors import block_interval
from jerkbench.evaluation.counted_rows import (
    POSITION_AXES,
    VELOCITY_AXES,
    counted_errors,
    known,
    position_error_m,
    rms,
    rms_norm,
)
from jerkbench.evaluation.evaluated_run import Summed
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "position_rmse")
@dataclass(frozen=True)
class PositionRmse(Summed):
    """Root mean square and largest position error, without any alignment.

    Let e_i = p_i - p_ref,i be the position error in ENU [m], at the N counted rows whose reference is known on the axes
    of the value::

        position_rmse_m             = sqrt(1/N sum |e_i|^2)                  east, north and up
        position_rmse_horizontal_m  = sqrt(1/N sum (e_east^2 + e_north^2))
        position_rmse_east_m, _north_m, _up_m                                separate axes
        position_rmse_whole_m       = position_rmse_m over all scored rows, including the burn-in
        position_max_m              = max |e_i|

    A value is NaN if no counted row has a known reference.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "position_rmse_m": Column("Position RMSE (3-D)", section=1),
        "position_rmse_whole_m": Column("Position RMSE (3-D), burn-in included"),
        "position_rmse_horizontal_m": Column(section=2),
        "position_rmse_up_m": Column(section=3),
        "position_max_m": Column("Largest position error (3-D)", section=4),
    }

    reads_covariance: ClassVar[bool] = False
    reads_velocity: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the seven values of the metric by column name."""
        each = zip(POSITION_AXES, sums.position_m2.tolist(), sums.position_rows.tolist(), strict=True)
        values = {f"position_rmse{name}_m": rms(square, rows) for name, square, rows in each}
        values["position_rmse_whole_m"] = rms(sums.with_burn_in_m2, sums.rows_with_burn_in)
        values["position_max_m"] = sums.position_max_m
        return values


@register("metric", "velocity_rmse")
@dataclass(frozen=True)
class VelocityRmse(Summed):
    """Root mean square velocity error.

    Let e_i = v_i - v_ref,i be the velocity error in ENU [m/s], at the N counted rows whose reference is known on the
    axes of the value::

        velocity_rmse_mps             = sqrt(1/N sum |e_i|^2)                  east, north and up
        velocity_rmse_horizontal_mps  = sqrt(1/N sum (e_east^2 + e_north^2))
        velocity_rmse_up_mps          = sqrt(1/N sum e_up^2)

    A value is NaN if no counted row has a known reference.
    """

    columns: ClassVar[Mapping[str, Column]] = {"velocity_rmse_mps": Column("Velocity RMSE (3-D)", section=5)}

    reads_covariance: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        each = zip(VELOCITY_AXES, sums.velocity_m2ps2.tolist(), sums.velocity_rows.tolist(), strict=True)
        return {f"velocity_rmse{name}_mps": rms(square, rows) for name, square, rows in each}


PERCENTILES = (50, 68, 95, 99)


@register("metric", "percentiles")
@dataclass(frozen=True)
class Percentiles:
    """Percentiles of the length of the position error.

    Let e_i = p_i - p_ref,i be the position error [m]. The metric position_pQ_m is the Q % quantile of |e_i| over the
    counted rows (interpolated linearly between order statistics). The metric position_horizontal_pQ_m uses only the
    east and north components of e_i.

    The values are NaN if no row is counted. The metric is computed only on request: ``metrics=[percentiles]``.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the eight values of the metric by column name."""
        values: dict[str, float] = {}
        for name, axes in (("", (0, 1, 2)), ("_horizontal", (0, 1))):
            rows = counted & known(recording.reference.enu_m, estimate, axes)
            with np.errstate(over="ignore", invalid="ignore"):
                norm = np.sqrt(np.sum(position_error_m(estimate, recording)[rows][:, axes] ** 2, axis=1))
                percentiles = np.percentile(norm, PERCENTILES) if len(norm) else np.full(len(PERCENTILES), np.nan)
            values |= {f"position{name}_p{q}_m": float(v) for q, v in zip(PERCENTILES, percentiles, strict=True)}
        return values


@register("metric", "reference_floor")
@dataclass(frozen=True)
class ReferenceFloor:
    """The position RMSE that a perfect estimate would have, because of the errors of the reference.

    Let s_ia be the standard deviation of the reference position on axis a at row i [m]. The sums include the N counted
    rows whose reference is known::

        reference_floor_m = sqrt(1/N sum_i sum_a s_ia^2)

    An RMSE near the floor contains no information about the filter. If the difference of two RMSEs is smaller than the
    floor, the comparison of the methods is undecided. The floor is NaN if the recording does not contain the accuracy
    of its reference (``reference_sigma`` of a table).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "reference_floor_m": Column("Floor of the position RMSE (3-D): sigma of the reference"),
    }

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value of the metric by column name."""
        sigma_m = recording.reference.sigma_m
        rows = counted & known(recording.reference.enu_m, estimate)
        return {"reference_floor_m": np.nan if sigma_m is None else rms_norm(sigma_m[estimate.index[rows]])}


@register("metric", "one_recording")
@dataclass(frozen=True)
class OneRecording:
    """Interval of the position RMSE from one recording, by a moving-block bootstrap.

    The errors of successive rows are correlated. The blocks of the bootstrap are therefore at least twelve times as
    long as the correlation time of the squared errors::

        position_rmse_low_m, position_rmse_high_m   95 % interval of position_rmse_m
        error_correlation_rows                      rows that count as one: 1 + 2 sum of the autocorrelations of |e_i|^2

    The interval is valid for other parts of the same drive, but not for other drives. The interval is NaN if the
    recording is shorter than 75 times error_correlation_rows. By default, the metric is computed only for combinations
    without random parts, which have only one run.

    Source: Künsch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17 (1989).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "position_rmse_low_m": Column("Position RMSE (3-D), lower end of the interval from one recording"),
        "position_rmse_high_m": Column("Position RMSE (3-D), upper end of the interval from one recording"),
        "error_correlation_rows": Column(judged=False),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        _, error = counted_errors(estimate, recording, counted)
        with np.errstate(over="ignore", invalid="ignore"):
            interval = block_interval(np.sum(error**2, axis=1))
        return {
            "position_rmse_low_m": interval.low,
            "position_rmse_high_m": interval.high,
            "error_correlation_rows": interval.correlation,
        }
