"""The attitude plugin ``reference``: the attitude of the recording's reference."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows, require_positive
from jerkbench.attitude.common import COMPENSATIONS, attitude_from
from jerkbench.errors import RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("attitude", "reference")
@dataclass(frozen=True)
class ReferenceAttitude:
    """Roll, pitch and yaw of the reference: it separates errors of the attitude from those of the navigation.

    At each stamp of the IMU stands the attitude of the reference's stamp nearest to it that has all three angles;
    nothing is interpolated. The simulated fields have a reference at every sample of the IMU. The input of the
    navigation filter is that of `tilt`.

    It is a bound, not a competitor: what a filter gains here over `tilt` is what a better attitude could bring. A
    reference that is slower than the IMU lags by up to half its interval.

    Attributes:
        compensation: midpoint or endpoint.
        gap_s: how far the nearest stamp of the reference may be from a sample of the IMU.
    """

    compensation: str = "midpoint"
    gap_s: float = 0.1

    def __post_init__(self) -> None:
        """Check the compensation and the gap."""
        require_known("compensation of attitude reference", self.compensation, COMPENSATIONS)
        require_positive("attitude reference", self, ("gap_s",))

    def require(self, load: Callable[[], Recording]) -> None:
        """Check, before a sweep begins, that the reference of the recording of ``load`` has an attitude all along.

        Raises:
            RecordingError: the reference has no attitude, or a gap in it.
        """
        self._angles(load())

    def estimate(self, recording: Recording) -> Attitude:
        """Return attitude and ENU acceleration at the IMU's stamps.

        Raises:
            RecordingError: the reference has no attitude, or none near enough to a sample.
        """
        return attitude_from(recording.inertial, self._angles(recording), self.compensation)

    def _angles(self, recording: Recording) -> FloatArray:
        """Roll, pitch and yaw (n, 3) at the IMU's stamps."""
        reference = recording.reference
        euler_rad = np.empty((0, 3)) if reference.euler_rad is None else reference.euler_rad
        known = np.isfinite(euler_rad).all(axis=1)
        if not known.any():
            raise RecordingError(
                f"{recording.name} has a reference without attitude; take the attitude tilt or gyro_only."
            )
        t_s, euler_rad = reference.t_s[known], euler_rad[known]
        rows = nearest_rows(t_s, recording.inertial.t_s)
        away_s = np.abs(t_s[rows] - recording.inertial.t_s)
        if away_s.max() > self.gap_s:
            worst = int(np.argmax(away_s))
            raise RecordingError(
                f"{recording.name}: the reference's attitude nearest to {recording.inertial.t_s[worst]:.2f} s is"
                f" {away_s[worst]:.2f} s away; raise gap_s (now {self.gap_s} s) or take the attitude tilt."
            )
        return euler_rad[rows]
