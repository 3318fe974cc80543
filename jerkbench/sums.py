"""The sums of a run: the numbers that the built-in metrics need in place of a trajectory."""

from typing import NamedTuple

from jerkbench.arrays import FloatArray


class Sums(NamedTuple):
    """Sums over the rows of a run; which rows, `jerkbench.evaluation.counted_stamps` says.

    Attributes:
        position_m2: (5,) sum of |e|^2 over the axes of each of POSITION_AXES.
        position_rows: (5,) their number.
        position_max_m: the largest |e|; NaN without rows.
        whole_m2: sum of |e|^2, the burn-in too.
        whole_rows: their number.
        velocity_m2ps2: (3,) sum of |e|^2 over the axes of each of VELOCITY_AXES.
        velocity_rows: (3,) their number.
        nees: sum of e' P^-1 e, position and velocity.
        nees_rows: their number.
        nees_position: sum of e' P^-1 e of position, over ``position_rows[0]`` rows.
        nis_per_row: sum over updates of nis/m, reported R.
        nis_updates: their number.
        nis_used_per_row: the same with the S that was used and the rows that were not dropped.
        nis_used_updates: their number.
        outage_m2: sum of |e|^2 of position inside outages.
        outage_rows: their number.
        outage_ends_m: (j,) |e| at the end of each outage.
        outage_driven_m: (j,) how far the reference went in each.
        outage_drifts_mps: (j,) change of e from its first to its last row, per second; NaN where they are one.
        outages: number of outages of the recording, reached or not.
        sampled_m: (s, 3) position errors once a second, at the first row that counts.
        sampled_m2: (s, 6) the upper triangle of their covariance, row by row.
    """

    position_m2: FloatArray
    position_rows: FloatArray
    position_max_m: float
    whole_m2: float
    whole_rows: float
    velocity_m2ps2: FloatArray
    velocity_rows: FloatArray
    nees: float
    nees_rows: float
    nees_position: float
    nis_per_row: float
    nis_updates: float
    nis_used_per_row: float
    nis_used_updates: float
    outage_m2: float
    outage_rows: float
    outage_ends_m: FloatArray
    outage_driven_m: FloatArray
    outage_drifts_mps: FloatArray
    outages: int
    sampled_m: FloatArray
    sampled_m2: FloatArray

    @property
    def sampled_covariance_m2(self) -> FloatArray:
        """(s, 3, 3) covariances of the position once a second."""
        return self.sampled_m2[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
