"""The parameters of inertial navigation, their checks, and the process noise that they say."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import require_not_negative
from jerkbench.errors import PluginError, unknown
from jerkbench.inertial.mechanisation import SensorNoise
from jerkbench.parameters import Origin, Range
from jerkbench.recording import GRAVITY_MPS2

YAW_SOURCES = ("attitude", "track")

DEG_PER_H = np.deg2rad(1.0) / 3600.0
PER_SQRT_H = 1.0 / 60.0
MG = 1e-3 * GRAVITY_MPS2

GRADES = "ours: from a tactical sensor to a phone's on a vibrating vehicle"

INSTABILITIES = ("gyro_instability_deg_per_h", "accel_instability_mg")
SIGMAS = (
    *("angle_random_walk_deg_per_sqrt_h", "velocity_random_walk_mps_per_sqrt_h", *INSTABILITIES),
    *("gyro_turn_on_deg_per_h", "accel_turn_on_mg", "initial_yaw_sigma_rad"),
    *("zero_velocity_sigma_mps", "nonholonomic_sigma_mps", "wheel_scale_sigma"),
)
POSITIVE = (
    *(name for name in SIGMAS if name not in INSTABILITIES),
    *("gyro_correlation_s", "accel_correlation_s", "track_least_m"),
    *("constraint_interval_s", "still_window_s", "still_accel_mps2", "still_gyro_radps", "still_below_mps"),
)
DEFORMATION = ("gyro_scale_ppm", "accel_scale_ppm", "misalignment_mrad")
ARMS = ("antenna_m", "nonholonomic_point_m", "reference_point_m")


@dataclass(frozen=True)
class Eskf15Parameters:
    """The parameters of `eskf15`, and of the filters that are made of its parts.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: white noise of the accelerometer [m/s/sqrt(h)].
        gyro_instability_deg_per_h: sigma of the wandering part of the gyro's bias; 0: it is constant [deg/h].
        gyro_correlation_s: tau of it [s].
        accel_instability_mg: sigma of the wandering part of the accelerometer's bias; 0: it is constant [mg].
        accel_correlation_s: tau of it [s].
        gyro_turn_on_deg_per_h: one sigma of the gyro's bias at the start [deg/h].
        accel_turn_on_mg: one sigma of the accelerometer's bias at the start [mg].
        gyro_scale_ppm: one sigma of each scale factor of the gyro; 0, and so the next two: no such states [1e-6].
        accel_scale_ppm: one sigma of each scale factor of the accelerometer [1e-6].
        misalignment_mrad: one sigma of the tilt of each axis towards each other, in both sensors [mrad].
        gyro_bias_from_rest: whether the gyro's mean over the rest at the start is its first bias.
        yaw_source: first yaw, attitude (of the attitude filter) or track (of the fixes, whatever else there is).
        initial_yaw_sigma_rad: one sigma of the first yaw, where its source is no less sure itself [rad].
        track_least_m: how far apart two fixes have to be to show a course of the track [m].
        position_sigma_m: one sigma of each axis of a fix, in place of the reported covariance; null: as reported [m].
        antenna_m: lever arm from the IMU to the antenna, body: forward, left, up [m].
        use_velocity: whether the velocity is used.
        use_heading: whether a measured heading is used; one that is a course is taken for the body's.
        wheel_scale: whether the error of a wheel's scale is estimated; needs a velocity in the frame "speed".
        wheel_scale_sigma: one sigma of it at the start.
        zero_velocity: whether the vehicle is held when it stands still.
        zero_velocity_sigma_mps: one sigma of each axis then, and of the velocity at a start at rest [m/s].
        still_window_s: how long the IMU has to be still [s].
        still_accel_mps2: standard deviation of the accelerometer below which it is, three axes together [m/s2].
        still_gyro_radps: standard deviation of the gyro below which it is, three axes together [rad/s].
        still_below_mps: estimated speed below which it may be [m/s].
        nonholonomic: whether the vehicle does not move sideways and upwards.
        nonholonomic_sigma_mps: one sigma of each of the two [m/s].
        nonholonomic_point_m: where that holds, and where a wheel measures (rear axle), from the IMU, body [m].
        constraint_interval_s: time between two zero-velocity or non-holonomic updates [s].
        reference_point_m: the point whose position and velocity are given out, from the IMU, body [m].
        earth_rotation: whether the Earth's rotation is taken into account; needs the recording's origin, and a gyro
            from which the mean at rest was not taken.
        earth_curvature: whether gravity turns with the position.
    """

    title: ClassVar[str]
    invariant: ClassVar[bool]

    angle_random_walk_deg_per_sqrt_h: Annotated[
        float,
        Range(0.01, 60.0, log=True, source=GRADES),
        Origin("data sheet: the simulated field's IMU, 0.0017 rad/s and 0.02 m/s2 a sample at 100 Hz"),
    ] = 0.6
    velocity_random_walk_mps_per_sqrt_h: Annotated[
        float,
        Range(0.005, 20.0, log=True, source=GRADES),
        Origin("data sheet: the simulated field's IMU, 0.0017 rad/s and 0.02 m/s2 a sample at 100 Hz"),
    ] = 0.12
    gyro_instability_deg_per_h: Annotated[
        float, Range(0.1, 500.0, log=True, source=GRADES), Origin("ours, of the order of an industrial MEMS module")
    ] = 5.0
    gyro_correlation_s: Annotated[float, Origin("ours: long against an outage")] = 1000.0
    accel_instability_mg: Annotated[
        float, Range(0.005, 10.0, log=True, source=GRADES), Origin("ours, of the order of an industrial MEMS module")
    ] = 0.1
    accel_correlation_s: Annotated[float, Origin("ours: long against an outage")] = 1000.0
    gyro_turn_on_deg_per_h: Annotated[float, Origin("ours, of the order of an industrial MEMS module")] = 500.0
    accel_turn_on_mg: Annotated[float, Origin("ours, of the order of an industrial MEMS module")] = 10.0
    gyro_scale_ppm: Annotated[float, Origin("off: 18 states fewer")] = 0.0
    accel_scale_ppm: Annotated[float, Origin("off")] = 0.0
    misalignment_mrad: Annotated[float, Origin("off")] = 0.0
    gyro_bias_from_rest: bool = True
    yaw_source: str = "attitude"
    initial_yaw_sigma_rad: Annotated[float, Origin("ours: 3 degrees")] = 0.05
    track_least_m: float = 1.0
    position_sigma_m: float | None = None
    antenna_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    use_velocity: bool = True
    use_heading: bool = True
    wheel_scale: bool = False
    wheel_scale_sigma: Annotated[float, Origin("ours: 2 %, tyres")] = 0.02
    zero_velocity: bool = False
    zero_velocity_sigma_mps: Annotated[float, Origin("ours")] = 0.02
    still_window_s: float = 1.0
    still_accel_mps2: float = 0.1
    still_gyro_radps: float = 0.01
    still_below_mps: float = 0.3
    nonholonomic: bool = False
    nonholonomic_sigma_mps: Annotated[
        float, Range(0.02, 2.0, log=True, source="ours: from a car on rails to a tractor on a slope"), Origin("ours")
    ] = 0.2
    nonholonomic_point_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    constraint_interval_s: float = 0.1
    reference_point_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    earth_rotation: bool = False
    earth_curvature: bool = False

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.yaw_source not in YAW_SOURCES:
            raise PluginError(unknown(f"yaw_source of filter {self.title}", self.yaw_source, YAW_SOURCES))
        optional = ("position_sigma_m",) if self.position_sigma_m is not None else ()
        for name in (*POSITIVE, *optional):
            if not getattr(self, name) > 0:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; it must be positive.")
        for name in (*INSTABILITIES, *DEFORMATION):
            if not getattr(self, name) >= 0:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; it must be 0 (constant) or more.")
        require_not_negative(f"filter {self.title}", self, (*SIGMAS, *DEFORMATION, *optional))
        if len({getattr(self, name) > 0 for name in DEFORMATION}) == 2:
            raise PluginError(f"{self.title}: {', '.join(DEFORMATION)} belong together; give all three, or 0 for all.")
        for name in ARMS:
            if len(getattr(self, name)) != 3:
                raise PluginError(f"{self.title}.{name} is {getattr(self, name)}; give three: forward, left, up.")

    def sensor_noise(self) -> SensorNoise:
        """Return the process noise in SI units."""
        gyro, accel = self.gyro_instability_deg_per_h * DEG_PER_H, self.accel_instability_mg * MG
        return SensorNoise(
            angle=float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) * PER_SQRT_H) ** 2,
            velocity=(self.velocity_random_walk_mps_per_sqrt_h * PER_SQRT_H) ** 2,
            gyro_bias=float(2.0 * gyro**2 / self.gyro_correlation_s),
            accel_bias=float(2.0 * accel**2 / self.accel_correlation_s),
        )
