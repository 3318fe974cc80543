"""Data sets of a simulated farm robot: with white noise, with correlated errors (`field`), and on rougher ground."""

from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_axes, require_multiple, require_not_negative, require_positive
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Recording
from jerkbench.simulation.motion import Path
from jerkbench.simulation.sensors import MAX_SAMPLES, Sensors
from jerkbench.simulation.truth import (
    Ruts,
    Truth,
    draw_impacts,
    draw_terrain,
    draw_vibration,
    impact_force,
    inner_times,
    rut_force,
    simulate_truth,
)

DURATIONS = ("duration_s", "ramp_s", "pass_s", "turn_s", "speed_change_s", "rut_tau_s", "rut_force_decay_s")
POSITIVE = (*DURATIONS, "sensor_rate_hz", "speed_mps", "turn_speed_mps", "hill_length_m")
_NOT_NEGATIVE = ("stand_s", "roughness", "roll_ratio_radpm", "vibration_mps2", "vibration_rad", "impacts_per_s")


SENSOR_SAMPLES = 10
"""Number of internal samples of the accelerometer per IMU sample, at the default rates. They are in memory only for a
short time."""


@register("dataset", "field_white")
@dataclass(frozen=True)
class FieldWhite(Sensors):
    """A simulated farm robot that drives back and forth over rough ground, with RTK-fixed GNSS and white noise.

    Results published up to version 0.2 are based on this data set, so its data never change.

    The robot is first stationary, then accelerates, then drives straight passes. Between two passes, the robot makes a
    headland turn of 180 degrees, alternately to the left and to the right. The speed is a sum of quintic smoothsteps.
    The yaw rate in a turn of duration T is +-(pi/T) (1 - cos(2 pi t/T)).

    The height z depends on the travelled distance s and on the coordinate x (east)::

        z = h(s) + A sin(2 pi x/L),  h = sum_i c sqrt(2 G_i dn_i)/(1 + (n_i/.6)^2) sin(2 pi n_i s + phi_i)
        G_i = 1024e-6 m3 (n_i/.1)^-2,  36 waves, n from .03 to 1.2 cycles/m in geometric steps
        pitch = -atan(forward slope) (nose down is positive),  roll = atan(left slope) + r(s)

    The roll profile r(s) is the same sum as h(s), but with other random phases and with 0.6 c instead of c. Vibration
    is part of the true motion. The vibration consists of 14 sines between 8 and 35 Hz, whose amplitude grows during the
    first ramp, so that the robot is stationary at the start. Let u = (t - t_r)/tau, H = (1 + tanh u)/2 and B = 1 -
    tanh^2 u. A rut at the time t_r lowers the height of the robot by drop H and the speed by dip B, and adds a pitch
    and a roll that are proportional to B.

    The accelerometer also measures false forces, which do not move the robot. The false forces are the forces of ruts
    and the forces of impacts. The force of an impact is an upward half sine of 20 ms. All simulated vehicles have the
    same equations and parameters of the sensors, which are described below.

    Source: ISO 8608:2016 for the spectrum G (c = 1.5 gives 2304e-6 m3 at .1 cycles/m, which is class E of the
    standard). The robot is fictitious and has the sensors of a small field robot.

    Attributes:
        duration_s: duration of the drive [s].
        sensor_rate_hz: internal rate of the accelerometer [Hz]. At this rate, false forces are added and the specific
            force is limited to the range of the sensor. Then the internal samples are averaged to IMU samples.
        stand_s: duration for which the robot is stationary at the start [s].
        ramp_s: time in which the robot reaches its speed, and in which the vibration reaches its amplitude [s].
        pass_s: duration of a pass, including speed changes [s].
        turn_s: duration of a turn of 180 degrees [s].
        speed_mps: speed on a pass [m/s].
        turn_speed_mps: speed in a turn [m/s].
        speed_change_s: duration of each speed change between a pass and a turn [s].
        heading_rad: initial heading, from east towards north [rad].
        roughness: c, factor on the amplitudes of the terrain [-].
        roll_ratio_radpm: amplitude factor of the roll profile r(s), divided by c [rad/m].
        hill_height_m: A, amplitude of the hill [m].
        hill_length_m: L, wavelength of the hill [m].
        vibration_mps2: rms of the vertical vibration [m/s2]. The vibration east and north is 0.7 times as large.
        vibration_rad: rms of the vibration of roll, of pitch and of yaw [rad].
        ruts: whether the ground has ruts.
        rut_times_s: times at which the robot drives into a rut [s].
        rut_drop_m: drop, depth of a rut [m].
        rut_tau_s: tau, time constant of a rut [s].
        rut_speed_dip_mps: dip, decrease of the speed in a rut [m/s].
        rut_pitch_rad: maximum pitch in a rut [rad].
        rut_roll_rad: maximum roll in a rut [rad].
        rut_force_mps2: false specific force (forward, left, up) at the time of a rut [m/s2].
        rut_force_decay_s: time in which the false force of a rut falls to 1/e [s].
        impacts_per_s: mean number of impacts per second [1/s]. The impacts are a Poisson process, which starts at the
            end of the ramp.
        impact_mps2: peak specific force of an impact [m/s2].
        false_forces: whether the accelerometer measures the false forces of ruts and impacts.
    """

    seeded: ClassVar[bool] = True
    recording_name: ClassVar[str] = "field_white"

    duration_s: float = 150.0
    sensor_rate_hz: float = 1000.0
    stand_s: float = 3.0
    ramp_s: float = 3.0
    pass_s: float = 20.0
    turn_s: float = 6.0
    speed_mps: float = 1.5
    turn_speed_mps: float = 0.8
    speed_change_s: float = 2.0
    heading_rad: float = 0.3
    roughness: float = 1.5
    roll_ratio_radpm: float = 0.6
    hill_height_m: float = 0.4
    hill_length_m: float = 60.0
    vibration_mps2: float = 0.3
    vibration_rad: float = 5e-4
    ruts: bool = False
    rut_times_s: tuple[float, ...] = (45.0, 90.0)
    rut_drop_m: float = 0.05
    rut_tau_s: float = 0.08
    rut_speed_dip_mps: float = 0.3
    rut_pitch_rad: float = 0.06
    rut_roll_rad: float = 0.07
    rut_force_mps2: tuple[float, ...] = (0.7, 0.4, 1.0)
    rut_force_decay_s: float = 0.3
    impacts_per_s: float = 0.0
    impact_mps2: float = 45.0
    false_forces: bool = True

    def __post_init__(self) -> None:
        self.check_sensors(self._what)
        require_positive(self._what, self, POSITIVE)
        require_not_negative(self._what, self, _NOT_NEGATIVE)
        require_axes(self._what, self, ("rut_force_mps2",), positive=False)
        require_multiple(self._what, self, "sensor_rate_hz", "imu_rate_hz")
        self.check_length(self._what, self.duration_s)
        self._check_counts()
        self._check_times()

    def load(self, seed: int) -> Recording:
        """Return the recording of the simulated drive with ``seed``."""
        truth = self.truth(seed)
        return self.record(self.recording_name, truth, seed, self.stand_s, self._false_force(truth.t_s, seed))

    def fingerprint(self) -> str:
        """Return an empty string, because the data set does not read files."""
        return ""

    def truth(self, seed: int) -> Truth:
        """Return the true motion from t = 0 on, sampled at the rate of the IMU."""
        t_s = np.arange(round(self.duration_s * self.imu_rate_hz) + 1) / self.imu_rate_hz
        hill = self.roll_ratio_radpm, self.hill_height_m, self.hill_length_m
        terrain = draw_terrain(stream(seed, "dataset", "terrain"), self.unless_silent("terrain", self.roughness), *hill)
        sizes = (self.unless_silent("vibration", size) for size in (self.vibration_mps2, self.vibration_rad))
        vibration = draw_vibration(stream(seed, "dataset", "vibration"), *sizes)
        return simulate_truth(t_s, self._path(), terrain, vibration, self._ruts())

    def _path(self) -> Path:
        return Path(*(getattr(self, f.name) for f in fields(Path)))

    def _ruts(self) -> Ruts:
        ruts = Ruts(*(getattr(self, f"rut_{f.name}") for f in fields(Ruts)))
        return ruts if self.ruts else replace(ruts, times_s=())

    def _false_force(self, t_s: FloatArray, seed: int) -> FloatArray | None:
        """Return the false forces (n, m, 3) at m times in each of n IMU intervals, or None if they are disabled."""
        impacts_per_s = self.unless_silent("impacts", self.impacts_per_s)
        if not self.false_forces or not (self.ruts or impacts_per_s):
            return None
        inner = inner_times(t_s, round(self.sensor_rate_hz / self.imu_rate_hz))
        begin = self.stand_s + self.ramp_s
        impacts = draw_impacts(stream(seed, "dataset", "impacts"), impacts_per_s, begin, self.duration_s)
        ruts = rut_force(inner, self._ruts().times_s, self.rut_force_mps2, self.rut_force_decay_s)
        return ruts + impact_force(inner, impacts, self.impact_mps2)

    @property
    def _what(self) -> str:
        return f"dataset {self.recording_name}"

    def _check_counts(self) -> None:
        """Check that the impacts, the passes and the internal samples of the accelerometer fit into memory."""
        counts = {
            "sensor_rate_hz": self.duration_s * self.sensor_rate_hz / SENSOR_SAMPLES,
            "impacts_per_s": self.duration_s * self.impacts_per_s,
            "pass_s": self.duration_s / (self.pass_s + self.turn_s),
        }
        for name in (name for name, count in counts.items() if count > MAX_SAMPLES):
            raise PluginError(
                f"{self._what}: {name} is {getattr(self, name)}, which needs too much memory for a duration of"
                f" {self.duration_s:g} s; decrease duration_s, or correct {name}."
            )

    def _check_times(self) -> None:
        """Check that the speed changes fit into a pass, and that no rut is before the robot moves."""
        if self.pass_s < 2.0 * self.speed_change_s:
            raise PluginError(
                f"{self._what}: pass_s is {self.pass_s} and speed_change_s is {self.speed_change_s}; pass_s must be at"
                " least twice speed_change_s, because a pass contains two speed changes."
            )
        earliest = self.stand_s + 10.0 * self.rut_tau_s  # the effect B of a rut is below 1e-8 at 10 tau before the rut
        if any(t < earliest for t in self._ruts().times_s):
            raise PluginError(
                f"{self._what}: rut_times_s is {self.rut_times_s}; each rut must be at {earliest:g} s or later, so that"
                " the robot moves before the rut."
            )
        if self.duration_s * self.gnss_rate_hz < 1:
            raise PluginError(
                f"{self._what}: duration_s is {self.duration_s}; with gnss_rate_hz={self.gnss_rate_hz}, duration_s must"
                f" be at least {1.0 / self.gnss_rate_hz:g} s."
            )


@register("dataset", "field")
@dataclass(frozen=True)
class Field(FieldWhite):
    """The simulated farm robot with correlated sensor errors: coloured noise, a latency, and an error of the lever arm.

    A filter that assumes white noise is overconfident on this data set, as it is on real fixes. In the following list
    of the sources of the defaults, the fraction is the fraction of the error variance that is correlated in time, and
    the time is the correlation time.

    - Position (fraction 0.7, time 5 s): measured with the receiver of rtklib_drive_0708 at rest (33 s, 145 fixed
      solutions). The autocorrelation of these fixes at lags of 0.25 to 3 s fits .72 exp(-t/4.7 s) east, .58 exp(-t/1.8
      s) north and .82 exp(-t/6.7 s) up. The position errors of comma2k19 in motion have longer correlation times: 5.8,
      12.7 and 17.9 s with a fraction of 1.
    - Velocity (fraction 0.5, time 2 s): measured on comma2k19 over 60 s. The autocorrelation of the difference between
      wheel speed and reference speed fits .53 exp(-t/1.9 s).
    - Heading (fraction 0.5, time 30 s), latency (0.01 s) and lever arm (1, 1, 2 cm): assumptions, which no recording
      confirms. The latency is the error that remains after lags were estimated. The error of the lever arm remains
      after the arm was measured with a tape.

    The path of the robot, the ground and all other parameters are the same as in `field_white`.
    """

    recording_name: ClassVar[str] = "field"

    position_coloured_share: float = 0.7
    position_coloured_time_s: float = 5.0
    velocity_coloured_share: float = 0.5
    velocity_coloured_time_s: float = 2.0
    heading_coloured_share: float = 0.5
    heading_coloured_time_s: float = 30.0
    position_latency_s: float = 0.01
    lever_arm_error_m: tuple[float, ...] = (0.01, 0.01, 0.02)


@register("dataset", "field_ruts")
@dataclass(frozen=True)
class FieldRuts(Field):
    """The simulated farm robot (`field`) that falls into two ruts, at 45 and 90 s.

    All other equations and parameters are the same as in `field`.
    """

    recording_name: ClassVar[str] = "field_ruts"

    ruts: bool = True


@register("dataset", "field_vibration")
@dataclass(frozen=True)
class FieldVibration(Field):
    """The simulated farm robot (`field`) on rougher ground, with vibration of 2 m/s2 rms and 0.3 impacts/s.

    The factor c of the terrain is 2.5 (c^2 G = 6400e-6 m3 at .1 cycles/m, still class E of ISO 8608). All other
    equations and parameters are the same as in `field`.
    """

    recording_name: ClassVar[str] = "field_vibration"

    roughness: float = 2.5
    vibration_mps2: float = 2.0
    impacts_per_s: float = 0.3


@register("dataset", "field_headland")
@dataclass(frozen=True)
class FieldHeadland(Field):
    """The simulated farm robot (`field`) at higher speed: 2 m/s, short passes, turns of 3.5 s at 1.6 m/s.

    All other equations and parameters are the same as in `field`.
    """

    recording_name: ClassVar[str] = "field_headland"

    pass_s: float = 10.0
    turn_s: float = 3.5
    speed_mps: float = 2.0
    turn_speed_mps: float = 1.6
