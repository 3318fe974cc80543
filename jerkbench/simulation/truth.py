"""The true motion: path, terrain, vibration and ruts put together."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.simulation.motion import Path
from jerkbench.simulation.terrain import Ground, Ruts, Terrain, Vibration


@dataclass(frozen=True, eq=False)
class Truth:
    """True motion at n times; the first one is the start.

    Attributes:
        t_s: (n,) times.
        enu_m: (n, 3) position, (0, 0, 0) at the start.
        velocity_mps: (n, 3) in ENU.
        euler_rad: (n, 3) roll, pitch, yaw; yaw is not wrapped.
    """

    t_s: FloatArray
    enu_m: FloatArray
    velocity_mps: FloatArray
    euler_rad: FloatArray


class Course(NamedTuple):
    """The motion in the plane, at n times.

    Attributes:
        speed_mps: (n,) horizontal speed.
        distance_m: (n,) distance driven.
        yaw_rad: (n,) heading of the path.
        velocity_mps: (n, 2) east and north.
        en_m: (n, 2) east and north.
    """

    speed_mps: FloatArray
    distance_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    en_m: FloatArray


def simulate_truth(t_s: FloatArray, path: Path, terrain: Terrain, vibration: Vibration, ruts: Ruts) -> Truth:
    """Return the true motion at equidistant times (n,).

    With the slope f along the path and l to its left, the angles are

        pitch = -atan(f) (positive is nose down),  roll = atan(l) + r(s),  yaw of the path,

    each plus vibration and ruts. The vertical velocity is the derivative of the height that the robot drives over.
    Vibration comes with the first movement, growing over the ramp: while it stands it is at rest.
    """
    course = drive_course(t_s, path, ruts)
    ground = terrain.at(course.distance_m, course.en_m[:, 0])
    shaking = vibration.grown(t_s, path.stand_s, path.ramp_s)
    up = ground.height_m - ground.height_m[0] - ruts.drop_m * ruts.steps(t_s)
    climb = ground.slope[:, 0] * course.speed_mps + ground.slope[:, 1] * course.velocity_mps[:, 0]
    tip = ruts.pulse(t_s)[:, None] * np.array([ruts.roll_rad, ruts.pitch_rad, 0.0])
    climb -= ruts.drop_m / (2.0 * ruts.tau_s) * ruts.pulse(t_s)
    return Truth(
        t_s=t_s,
        enu_m=np.column_stack([course.en_m, up]) + shaking.enu_m,
        velocity_mps=np.column_stack([course.velocity_mps, climb]) + shaking.velocity_mps,
        euler_rad=_lean(course, ground) + tip + shaking.euler_rad,
    )


def drive_course(t_s: FloatArray, path: Path, ruts: Ruts) -> Course:
    """Return the motion in the plane; east and north by Simpson's rule over each interval."""
    fine_t_s = np.empty(2 * len(t_s) - 1)  # the times, and the middle between each two
    fine_t_s[::2], fine_t_s[1::2] = t_s, 0.5 * (t_s[:-1] + t_s[1:])
    yaw = path.yaw_rad_at(fine_t_s)
    speed = path.speed_mps_at(fine_t_s) - ruts.speed_dip_mps * ruts.pulse(fine_t_s)
    velocity = speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    areas = np.diff(t_s)[:, None] / 6.0 * (velocity[:-1:2] + 4.0 * velocity[1::2] + velocity[2::2])
    en = np.vstack([np.zeros((1, 2)), np.cumsum(areas, axis=0)])
    distance = path.distance_m_at(t_s) - 2.0 * ruts.tau_s * ruts.speed_dip_mps * ruts.steps(t_s)
    return Course(speed[::2], distance, yaw[::2], velocity[::2], en)


def _lean(course: Course, ground: Ground) -> FloatArray:
    """Roll, pitch and yaw (n, 3) of a robot that lies on the ground."""
    forward = ground.slope[:, 0] + ground.slope[:, 1] * np.cos(course.yaw_rad)
    leftward = -ground.slope[:, 1] * np.sin(course.yaw_rad)
    return np.column_stack([np.arctan(leftward) + ground.roll_rad, -np.arctan(forward), course.yaw_rad])
