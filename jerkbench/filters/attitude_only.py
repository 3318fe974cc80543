"""No navigation: the attitude filter alone, for recordings without position."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import nanoseconds


@register("filter", "attitude_only")
@dataclass(frozen=True)
class AttitudeOnlyFilter:
    """Hands the attitude on, and estimates neither position nor velocity.

    With the attitude filter's angles at the IMU's stamps t_i, at each stamp t of the reference from t_0 on::

        (roll, pitch, yaw)(t) = (roll, pitch, yaw)_i,    i = the last with t_i <= t;    p, v, P are NaN

    It is the one filter for a recording that has an attitude reference and nothing to navigate by (`broad`). The
    metrics of position and velocity have no value with it.
    """

    provenance = Provenance("own", "", "Hands the attitude on; it navigates by nothing.")

    adaptations: ClassVar[tuple[str, ...]] = ("none",)
    attitude_only: ClassVar[bool] = True

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the attitude at the reference's stamps that the IMU covers."""
        return attitude_at_reference(attitude.t_s, attitude.euler_rad, recording)


def attitude_at_reference(t_s: FloatArray, euler_rad: FloatArray, recording: Recording) -> Estimate:
    """Return angles (n, 3) at ``t_s`` (n,) as an estimate: at each stamp of the reference those of the last until then.

    Stamps that they do not cover have none.
    """
    imu, stamps = nanoseconds(t_s), nanoseconds(recording.reference.t_s)
    index = np.flatnonzero((stamps >= imu[0]) & (stamps <= imu[-1])).astype(np.int64)
    sample = np.searchsorted(imu, stamps[index], side="right") - 1
    absent = np.full((len(index), 3), np.nan)
    covariance = np.full((len(index), 6, 6), np.nan)
    return Estimate(index, absent, absent, covariance, euler_rad[sample], attitude_only=True)
