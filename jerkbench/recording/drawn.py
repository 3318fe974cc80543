"""The law by which a simulation drew the errors of a recording."""

from dataclasses import dataclass

from jerkbench.recording.streams import Imu, Position, Velocity


@dataclass(frozen=True, eq=False)
class Drawn:
    """The law of a simulation's errors, where it is linear and Gaussian; it holds for these streams and no others.

    Attributes:
        imu: each axis of each accelerometer sample has an error of its own, and nothing else is wrong with it.
        position: each axis has the error sqrt(1 - s) w + sqrt(s) b in its standard deviations: w is white, b a
            Gauss-Markov process of the time T, both of unit variance.
        velocity: alike, in ENU.
        accel_sigma_mps2: one sigma of the error of an accelerometer sample.
        position_share: s of position.
        position_time_s: T of position.
        velocity_share: s of velocity.
        velocity_time_s: T of velocity.
    """

    imu: Imu
    position: Position
    velocity: Velocity
    accel_sigma_mps2: float
    position_share: float
    position_time_s: float
    velocity_share: float
    velocity_time_s: float
