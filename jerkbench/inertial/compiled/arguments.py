"""Arguments of the compiled run, and its results."""

from typing import NamedTuple

from jerkbench.arrays import FloatCube, FloatMatrix, FloatVector, IntVector


class Flow(NamedTuple):
    """The events of a run, as in `jerkbench.inertial.events.Events`, and the data that they point to.

    Attributes:
        dt_s: (n,) lengths of the steps.
        sample: (n,) row of the IMU.
        update: (n,) row of z, or -1.
        heading: (n,) row of yaw, or -1.
        constrained: (n,) 1 where a constraint is due, else 0.
        reference: (n,) row of the reference, or -1.
        accel_mps2: (s, 3).
        gyro_radps: (s, 3).
        still: (s,) 1 where the vehicle stands still, else 0.
        z: (m, 6) measurements, NaN where there is none.
        R: (m, 6, 6) what the adaptation gets.
        reported: (m, 6, 6) what the receiver reported.
        yaw: (h, 2) measured yaw [rad] and its sigma.
    """

    dt_s: FloatVector
    sample: IntVector
    update: IntVector
    heading: IntVector
    constrained: IntVector
    reference: IntVector
    accel_mps2: FloatMatrix
    gyro_radps: FloatMatrix
    still: IntVector
    z: FloatMatrix
    R: FloatCube
    reported: FloatCube
    yaw: FloatMatrix


class Given(NamedTuple):
    """What is not measured, as in `jerkbench.inertial.run.Settings`.

    Attributes:
        noise: (4,) power densities: angle, velocity, gyro bias, accelerometer bias.
        rotates: whether the Earth turns.
        rate_radps: (3,) the Earth's rate, ENU.
        per_radius: 1/R [1/m].
        antenna_m: (3,) lever arm.
        point_m: (3,) the point whose position is given out.
        frame: of the velocity: 0 ENU, 1 body, 2 a wheel's speed.
        wheel_m: (3,) lever arm of the wheel.
        still_below_mps: only when the estimated speed is below.
        still_sigma_mps: one sigma of the velocity at rest.
        sideways_sigma_mps: one sigma of the velocity sideways and upwards; 0: no such constraint.
        sideways_m: (3,) lever arm of that.
        nowhere: (3,) no lever arm.
    """

    noise: FloatVector
    rotates: bool
    rate_radps: FloatVector
    per_radius: float
    antenna_m: FloatVector
    point_m: FloatVector
    frame: int
    wheel_m: FloatVector
    still_below_mps: float
    still_sigma_mps: float
    sideways_sigma_mps: float
    sideways_m: FloatVector
    nowhere: FloatVector


class Kept(NamedTuple):
    """Room for what a run leaves; where there is one row, each state or update writes it anew.

    Attributes:
        reference: (k,) rows of the reference that were visited.
        x: (k, 6) position and velocity there.
        P: (k, 36) their covariance.
        dcm: (k, 9) the attitude.
        which: (m,) rows of z that were taken.
        seen: (m, SEEN) what each update saw.
        places: (6,) room for the numbers of rows.
    """

    reference: IntVector
    x: FloatMatrix
    P: FloatMatrix
    dcm: FloatMatrix
    which: IntVector
    seen: FloatMatrix
    places: IntVector
