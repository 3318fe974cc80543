"""One run of the inertial navigation before it begins."""

from typing import NamedTuple

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.inertial.earth import Earth
from jerkbench.inertial.error_model import SensorNoise
from jerkbench.inertial.events import Events
from jerkbench.inertial.state import NavigationState
from jerkbench.recording import Heading, Imu
from jerkbench.timeline import Timeline


class Constraints(NamedTuple):
    """What the vehicle cannot do.

    Attributes:
        still: (n,) whether it stands still at each IMU sample; all False: no zero-velocity update.
        still_below_mps: only when the estimated speed is below.
        still_sigma_mps: one sigma of each axis of the velocity when it stands.
        sideways_sigma_mps: one sigma of the velocity sideways and upwards in the body; 0: no such constraint.
        sideways_point_m: (3,) where that holds, from the IMU, in the body.
    """

    still: BoolArray
    still_below_mps: float
    still_sigma_mps: float
    sideways_sigma_mps: float
    sideways_point_m: FloatArray


class Settings(NamedTuple):
    """Everything about a run that is not measured.

    Attributes:
        noise: of the sensors.
        earth: gravity and rotation.
        antenna_m: (3,) from the IMU, in the body.
        reference_point_m: (3,) the point whose position is given out, from the IMU, in the body.
        velocity_frame: of rows 3 to 5 of z: "enu" (of the antenna), "body" (of the IMU), or "speed" (body, of the
            wheel).
        wheel_m: (3,) where the wheel measures, from the IMU, in the body.
        constraints: what the vehicle cannot do.
        invariant: whether a correction goes in on the group SE_2(3), and the covariance of that error stays as it is.
    """

    noise: SensorNoise
    earth: Earth
    antenna_m: FloatArray
    reference_point_m: FloatArray
    velocity_frame: str
    wheel_m: FloatArray
    constraints: Constraints
    invariant: bool = False


class Journey(NamedTuple):
    """Everything that a run needs besides its adaptation; `jerkbench.inertial.run.InertialRun` takes the same.

    Attributes:
        imu: the samples.
        timeline: the measurements.
        headings: measured headings, or None.
        events: the steps.
        start: state and covariance (n, n) at the begin.
        settings: what is not measured.
    """

    imu: Imu
    timeline: Timeline
    headings: Heading | None
    events: Events
    start: tuple[NavigationState, FloatArray]
    settings: Settings
