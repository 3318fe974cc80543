"""The simulated farm robot: with sensors whose noise is white, as it is by default, and on other kinds of field."""

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
"""Samples within the accelerometer to one of the IMU, at the default rates: these are held for a short time only."""


@register("dataset", "field_white")
@dataclass(frozen=True)
class FieldWhite(Sensors):
    """A simulated farm robot that drives to and fro over rough ground, with RTK-fixed GNSS whose noise is white.

    The robot of the numbers published up to version 0.2; it stays what it was, to the bit.

    It stands, ramps up, then drives straight passes with headland turns of 180 degrees to alternating sides. Speed is
    a sum of quintic smoothsteps; the yaw rate in a turn of length T is +-(pi/T) (1 - cos(2 pi t/T)).

    Height over the distance s and absolute x (east)::

        z = h(s) + A sin(2 pi x/L),  h = sum_i c sqrt(2 G_i dn_i)/(1 + (n_i/.6)^2) sin(2 pi n_i s + phi_i)
        G_i = 1024e-6 m3 (n_i/.1)^-2,  36 waves, n from .03 to 1.2 cycles/m in geometric steps
        pitch = -atan(forward slope) (nose down is positive),  roll = atan(left slope) + r(s)

    with r like h, .6 c for c. Vibration is true motion: 14 sines between 8 and 35 Hz; it grows with the first ramp,
    so that the robot stands still at the start. A rut at t_r, with u = (t - t_r)/tau, H = (1 + tanh u)/2 and
    B = 1 - tanh^2 u, lowers the height by drop H and the speed by dip B and adds pitch and roll times B.

    The accelerometer also feels false forces, with which the robot does not move: ruts, and impacts of 20 ms, a half
    sine upwards. The sensors are those of every simulated vehicle, below.

    Source: ISO 8608:2016 for G (c = 1.5 gives 2304e-6 m3 at .1 cycles/m, in its class E); the robot itself is
    an invention, with the sensors of a small field robot.

    Attributes:
        duration_s: length of the drive.
        sensor_rate_hz: rate at which false forces and the range act within the accelerometer, before it averages.
        stand_s: how long it stands at the start.
        ramp_s: how long it takes to reach its speed, and the vibration its strength.
        pass_s: length of a pass, speed changes included.
        turn_s: length of a turn of 180 degrees.
        speed_mps: speed on a pass.
        turn_speed_mps: speed in a turn.
        speed_change_s: how long a change between these two takes, at the end of a pass and at the start of the next.
        heading_rad: first heading, from east towards north.
        roughness: c of the terrain.
        roll_ratio_radpm: c of the roll profile over c [rad/m].
        hill_height_m: A.
        hill_length_m: L.
        vibration_mps2: rms of the vertical vibration; east and north have .7 of it.
        vibration_rad: rms of the vibration of roll, of pitch and of yaw.
        ruts: whether there are ruts.
        rut_times_s: when they come.
        rut_drop_m: drop.
        rut_tau_s: tau.
        rut_speed_dip_mps: dip.
        rut_pitch_rad: pitch at its peak.
        rut_roll_rad: roll at its peak.
        rut_force_mps2: false specific force (forward, left, up) at the moment of a rut.
        rut_force_decay_s: time in which it falls to 1/e.
        impacts_per_s: rate of the impacts (Poisson), from the end of the ramp on.
        impact_mps2: peak of an impact.
        false_forces: whether ruts and impacts act on the accelerometer.
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
        """Check that every choice exists, the rates fit and every number makes sense."""
        self.check_sensors(self._what)
        require_positive(self._what, self, POSITIVE)
        require_not_negative(self._what, self, _NOT_NEGATIVE)
        require_axes(self._what, self, ("rut_force_mps2",), positive=False)
        require_multiple(self._what, self, "sensor_rate_hz", "imu_rate_hz")
        self.check_length(self._what, self.duration_s)
        self._check_counts()
        self._check_times()

    def load(self, seed: int) -> Recording:
        """Return the drive that belongs to ``seed``."""
        truth = self.truth(seed)
        return self.record(self.recording_name, truth, seed, self.stand_s, self._false_force(truth.t_s, seed))

    def fingerprint(self) -> str:
        """Return the empty string: it reads no data."""
        return ""

    def truth(self, seed: int) -> Truth:
        """Return the true motion from t = 0 on, at the IMU's rate."""
        t_s = np.arange(round(self.duration_s * self.imu_rate_hz) + 1) / self.imu_rate_hz
        hill = self.roll_ratio_radpm, self.hill_height_m, self.hill_length_m
        terrain = draw_terrain(stream(seed, "dataset", "terrain"), self.heard("terrain", self.roughness), *hill)
        sizes = (self.heard("vibration", size) for size in (self.vibration_mps2, self.vibration_rad))
        vibration = draw_vibration(stream(seed, "dataset", "vibration"), *sizes)
        return simulate_truth(t_s, self._path(), terrain, vibration, self._ruts())

    def _path(self) -> Path:
        return Path(*(getattr(self, f.name) for f in fields(Path)))

    def _ruts(self) -> Ruts:
        ruts = Ruts(*(getattr(self, f"rut_{f.name}") for f in fields(Ruts)))
        return ruts if self.ruts else replace(ruts, times_s=())

    def _false_force(self, t_s: FloatArray, seed: int) -> FloatArray | None:
        """Return (n, m, 3) within each of the n intervals between ``t_s``, or None where there is none."""
        impacts_per_s = self.heard("impacts", self.impacts_per_s)
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
        """Check that what happens within a sample, and how often, can be held in memory."""
        counts = {
            "sensor_rate_hz": self.duration_s * self.sensor_rate_hz / SENSOR_SAMPLES,
            "impacts_per_s": self.duration_s * self.impacts_per_s,
            "pass_s": self.duration_s / (self.pass_s + self.turn_s),
        }
        for name in (name for name, count in counts.items() if count > MAX_SAMPLES):
            raise PluginError(
                f"{self._what}: {name} is {getattr(self, name)}; over {self.duration_s:g} s it is more than memory"
                " should hold: shorten the drive, or correct it."
            )

    def _check_times(self) -> None:
        """Check that a pass has room for its speed changes, and that nothing happens before the robot moves."""
        if self.pass_s < 2.0 * self.speed_change_s:
            given = f"pass_s is {self.pass_s} and speed_change_s is {self.speed_change_s}"
            raise PluginError(f"{self._what}: {given}; a pass needs room for two speed changes.")
        earliest = self.stand_s + 10.0 * self.rut_tau_s  # there 1 - tanh^2 is below 1e-8
        if any(t < earliest for t in self._ruts().times_s):
            given = f"rut_times_s is {self.rut_times_s}"
            raise PluginError(f"{self._what}: {given}; the first rut can come at {earliest:g} s, when the robot moves.")
        if self.duration_s * self.gnss_rate_hz < 1:
            least = f"at {self.gnss_rate_hz} Hz of GNSS it must be at least {1.0 / self.gnss_rate_hz:g} s."
            raise PluginError(f"{self._what}: duration_s is {self.duration_s}; {least}")


@register("dataset", "field")
@dataclass(frozen=True)
class Field(FieldWhite):
    """The simulated farm robot with sensors whose errors last: coloured noise, a latency, a lever arm. Version 2.

    A filter that takes each measurement's noise for new is too sure of itself here, as it is on real fixes. Where the
    defaults come from:

    - position, share .7 and 5 s: the receiver of rtklib_drive_0708 at rest (33 s, 145 fixed solutions), whose
      autocorrelation from .25 to 3 s fits .72 exp(-t/4.7 s) east, .58 exp(-t/1.8 s) north, .82 exp(-t/6.7 s) up. The
      one of comma2k19, under way, lasts longer: shares of 1 and 5.8, 12.7 and 17.9 s.
    - velocity, share .5 and 2 s: the wheel speed of comma2k19 against its reference (60 s), .53 exp(-t/1.9 s).
    - heading, share .5 and 30 s; latency .01 s and arm (1, 1, 2) cm: assumed, as what is left when lags were estimated
      and the arm was measured with a tape; no recording here shows them.

    The robot's way, the ground and the parameters are those of `field_white`.
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

    Everything else, equations and parameters too, as in `field`.
    """

    recording_name: ClassVar[str] = "field_ruts"

    ruts: bool = True


@register("dataset", "field_vibration")
@dataclass(frozen=True)
class FieldVibration(Field):
    """The simulated farm robot (`field`) on rougher ground, shaken at 2 m/s2 rms, with an impact every 3 s.

    The terrain's c is 2.5 (c^2 G = 6400e-6 m3 at .1 cycles/m, still class E of ISO 8608). Everything else, equations
    and parameters too, as in `field`.
    """

    recording_name: ClassVar[str] = "field_vibration"

    roughness: float = 2.5
    vibration_mps2: float = 2.0
    impacts_per_s: float = 0.3


@register("dataset", "field_headland")
@dataclass(frozen=True)
class FieldHeadland(Field):
    """The simulated farm robot (`field`) in a hurry: 2 m/s, short passes, turns of 3.5 s at 1.6 m/s.

    Everything else, equations and parameters too, as in `field`.
    """

    recording_name: ClassVar[str] = "field_headland"

    pass_s: float = 10.0
    turn_s: float = 3.5
    speed_mps: float = 2.0
    turn_speed_mps: float = 1.6
