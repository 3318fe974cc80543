"""True motion of a robot from path, terrain, ruts and vibration, and false specific force of its accelerometer."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.simulation.motion import Path, Way, harmonics, smoothstep, smoothstep_rate

WAVES = 36
MAX_CYCLES_PER_M = 1.2
MIN_CYCLES_PER_M = 0.03
REFERENCE_PER_M = 0.1
REFERENCE_PSD_M3 = 1024e-6
TRACK_PER_M = 0.6


class Ground(NamedTuple):
    """Height and inclination of the ground under the robot at n times.

    Attributes:
        height_m: (n,) height of the ground [m].
        slope: (n, 2) slope of the terrain waves along the path, and slope of the hill towards the east [-].
        roll_rad: (n,) roll due to the height difference of the left and the right track [rad].
    """

    height_m: FloatArray
    slope: FloatArray
    roll_rad: FloatArray


class Terrain(NamedTuple):
    """Terrain with the height h(s) + A sin(2 pi x/L) and the roll r(s) at the distance s and the east coordinate x.

    The functions h and r are sums of 36 waves with random phases. The wavenumbers n of the waves are geometrically
    spaced from 0.03 to 1.2 cycles/m. The amplitude of a wave depends on the roughness c::

        c sqrt(2 G_0 (n/n_0)^-2 dn)/(1 + (n/0.6)^2),  G_0 = 1024e-6 m3,  n_0 = 0.1 cycles/m

    For the height h, c is ``roughness``. For the roll r, c is ``roughness`` times ``roll_ratio``. The denominator
    reduces short waves, because the track of the robot bridges them. The displacement spectrum of ISO 8608 is G_0
    (n/n_0)^-2. The geometric mean of G_0 is 1024e-6 m3 in class D and 4096e-6 m3 in class E, which starts at 2048e-6
    m3. Therefore, the roughness c = 1.5 (c^2 G_0 = 2304e-6 m3) is in class E, and c = 2 is the geometric mean of class
    E.

    Source: ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data.

    Attributes:
        wavenumber_per_m: (36,) wavenumbers n [cycles/m].
        sine: (2, 36) coefficients of sin(2 pi n s) in h [m] and r [rad].
        cosine: (2, 36) coefficients of cos(2 pi n s) in h [m] and r [rad].
        hill_height_m: amplitude A of the hill [m].
        hill_length_m: wavelength L of the hill [m].
    """

    wavenumber_per_m: FloatArray
    sine: FloatArray
    cosine: FloatArray
    hill_height_m: float
    hill_length_m: float

    def at(self, distance_m: FloatArray, east_m: FloatArray) -> Ground:
        """Return the ground at n positions, given by their distances from the start and their east coordinates."""
        value, slope = harmonics(distance_m, 2.0 * np.pi * self.wavenumber_per_m, self.sine, self.cosine)
        hill = 2.0 * np.pi / self.hill_length_m
        height = value[:, 0] + self.hill_height_m * np.sin(hill * east_m)
        slope_east = self.hill_height_m * hill * np.cos(hill * east_m)
        return Ground(height, np.column_stack([slope[:, 0], slope_east]), value[:, 1])


def draw_terrain(
    rng: np.random.Generator, roughness: float, roll_ratio: float, hill_height_m: float, hill_length_m: float
) -> Terrain:
    """Return a terrain with random phases. ``roll_ratio`` is the ratio of roll to height amplitude [rad/m]."""
    n = np.geomspace(MIN_CYCLES_PER_M, MAX_CYCLES_PER_M, WAVES)
    phases = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
    sizes = wave_amplitudes(n) * roughness * np.array([[1.0], [roll_ratio]])
    return Terrain(n, sizes * np.cos(phases), sizes * np.sin(phases), hill_height_m, hill_length_m)


def wave_amplitudes(wavenumber_per_m: FloatArray) -> FloatArray:
    """Return the height amplitudes (w,) [m] of waves with geometrically spaced wavenumbers (w,) for the roughness 1."""
    n = wavenumber_per_m
    half_step = np.sqrt(n[1] / n[0])
    width = n * (half_step - 1.0 / half_step)
    psd = REFERENCE_PSD_M3 * (n / REFERENCE_PER_M) ** -2.0
    return np.asarray(np.sqrt(2.0 * psd * width) / (1.0 + (n / TRACK_PER_M) ** 2))


# Ruts, in which the robot drops, tilts and slows down.


@dataclass(frozen=True)
class Ruts:
    """Ruts into which the robot drops at the times t_r. After a rut, the robot continues on the lower level.

    The change of the motion contains a step H(u) = (1 + tanh u)/2 and a pulse B(u) = 1 - tanh^2 u with u = (t -
    t_r)/tau::

        height -= drop H;  speed -= dip B;  pitch += pitch_0 B;  roll += roll_0 B
        distance -= dip tau (1 + tanh u)

    Attributes:
        times_s: times t_r of the ruts; an empty tuple for a path without ruts [s].
        drop_m: depth of each rut, called drop in the equations [m].
        tau_s: time constant tau of the step and of the pulse [s].
        speed_dip_mps: maximum decrease of the speed in a rut, called dip in the equations [m/s].
        pitch_rad: maximum pitch pitch_0 in a rut, positive for nose down [rad].
        roll_rad: maximum roll roll_0 in a rut, positive for right side down [rad].
    """

    times_s: tuple[float, ...]
    drop_m: float
    tau_s: float
    speed_dip_mps: float
    pitch_rad: float
    roll_rad: float

    def pulse(self, t_s: FloatArray) -> FloatArray:
        """Return the sum (n,) of the pulses B of all ruts at the times ``t_s``."""
        return np.asarray(sum((1.0 - np.tanh((t_s - t) / self.tau_s) ** 2 for t in self.times_s), 0.0 * t_s))

    def steps(self, t_s: FloatArray) -> FloatArray:
        """Return the sum (n,) of the steps H of all ruts at the times ``t_s``."""
        return np.asarray(sum((0.5 * (1.0 + np.tanh((t_s - t) / self.tau_s)) for t in self.times_s), 0.0 * t_s))


# Vibration that the engine and the tracks cause. It is part of the true motion.

_SINES = 14
LOWEST_HZ = 8.0
MAX_VIBRATION_HZ = 35.0
AXIS_SHARE = np.array([0.7, 0.7, 1.0])
"""Ratio of the rms of the acceleration in east, north and up to the nominal rms."""


class Vibration(NamedTuple):
    """Vibration of 14 sines from 8 to 35 Hz, with one random frequency in each of 14 equal parts of the band.

    The motion of each axis is d(t) = sum_i a_i sin(w_i t) + b_i cos(w_i t) with independent random phases. The sines of
    a displacement have equal acceleration amplitudes, and the sines of an angle have equal angle amplitudes. If an
    envelope E(t) scales the vibration, the displacement is E d, and the velocity is its derivative E d' + E' d.

    Attributes:
        frequency_radps: (14,) angular frequencies w [rad/s].
        sine: (6, 14) coefficients a of the sines for east, north, up [m] and roll, pitch, yaw [rad].
        cosine: (6, 14) coefficients b of the cosines for east, north, up [m] and roll, pitch, yaw [rad].
    """

    frequency_radps: FloatArray
    sine: FloatArray
    cosine: FloatArray

    def grown(self, t_s: FloatArray, start_s: float, ramp_s: float) -> Way:
        """Return the vibration at n times. The envelope increases from 0 at ``start_s`` to 1 within ``ramp_s``."""
        u = (t_s - start_s) / ramp_s
        return self.at(t_s, smoothstep(u), smoothstep_rate(u) / ramp_s)

    def at(self, t_s: FloatArray, envelope: FloatArray, envelope_rate: FloatArray) -> Way:
        """Return the vibration at n times, scaled by the envelope (n,) with the derivative ``envelope_rate`` (n,)."""
        bare, rate = harmonics(t_s, self.frequency_radps, self.sine, self.cosine)
        shaped = envelope[:, None] * bare
        velocity = envelope[:, None] * rate[:, :3] + envelope_rate[:, None] * bare[:, :3]
        return Way(shaped[:, :3], velocity, shaped[:, 3:])


def draw_vibration(rng: np.random.Generator, accel_mps2: float, angle_rad: float) -> Vibration:
    """Return a vibration with random frequencies and phases.

    Args:
        rng: random stream of the vibration.
        accel_mps2: rms of the vertical acceleration; the rms of each horizontal acceleration is 0.7 times as large
            [m/s2].
        angle_rad: rms of each of the angles roll, pitch and yaw [rad].
    """
    band = (MAX_VIBRATION_HZ - LOWEST_HZ) / _SINES
    w = 2.0 * np.pi * (LOWEST_HZ + band * (np.arange(_SINES) + rng.uniform(size=_SINES)))
    phases = rng.uniform(0.0, 2.0 * np.pi, (6, _SINES))
    unit = np.sqrt(2.0 / _SINES)  # amplitude of each sine with which the sum has an rms of 1
    shift = accel_mps2 * unit * np.multiply.outer(AXIS_SHARE, w**-2.0)
    sizes = np.vstack([shift, np.full((3, _SINES), angle_rad * unit)])
    return Vibration(w, sizes * np.cos(phases), sizes * np.sin(phases))


# False specific force in ruts and impacts: the accelerometer measures it, but the vehicle does not move accordingly.

IMPACT_S = 0.02


def inner_times(t_s: FloatArray, per_sample: int) -> FloatArray:
    """Divide each of the n intervals between the times ``t_s`` into m equal parts.

    Return the centres (n, m) of the parts.
    """
    parts = (np.arange(per_sample) + 0.5) / per_sample
    return np.asarray(t_s[:-1, None] + np.diff(t_s)[:, None] * parts)


def rut_force(
    inner_s: FloatArray, times_s: tuple[float, ...], force_mps2: tuple[float, ...], decay_s: float
) -> FloatArray:
    """Return a force (n, m, 3) that jumps to ``force_mps2`` at the time of each rut, and then decays exponentially."""
    size = np.zeros_like(inner_s)
    for start in times_s:
        since = inner_s - start
        size += np.where(since >= 0.0, np.exp(-np.maximum(since, 0.0) / decay_s), 0.0)
    return np.asarray(size[:, :, None] * np.asarray(force_mps2))


def draw_impacts(rng: np.random.Generator, per_s: float, start_s: float, end_s: float) -> FloatArray:
    """Return the sorted times of impacts: a Poisson process with the rate ``per_s`` from ``start_s`` to ``end_s``."""
    length = max(0.0, end_s - start_s)
    return np.sort(start_s + length * rng.uniform(size=rng.poisson(per_s * length)))


def impact_force(inner_s: FloatArray, times_s: FloatArray, peak_mps2: float) -> FloatArray:
    """Return the force (n, m, 3) of impacts in the body frame: an upward half sine of 20 ms after each impact."""
    force = np.zeros((inner_s.size, 3))
    flat = inner_s.ravel()
    for start in times_s:
        hit = slice(*np.searchsorted(flat, (start, start + IMPACT_S)))
        force[hit, 2] += peak_mps2 * np.sin(np.pi * (flat[hit] - start) / IMPACT_S)
    return force.reshape(*inner_s.shape, 3)


@dataclass(frozen=True, eq=False)
class Truth:
    """True motion of the vehicle at n times, of which the first is the start of the drive.

    Attributes:
        t_s: (n,) times [s].
        enu_m: (n, 3) position in ENU, which is (0, 0, 0) at the start [m].
        velocity_mps: (n, 3) velocity in ENU [m/s].
        euler_rad: (n, 3) roll, pitch and unwrapped yaw [rad].
    """

    t_s: FloatArray
    enu_m: FloatArray
    velocity_mps: FloatArray
    euler_rad: FloatArray


class Course(NamedTuple):
    """Horizontal motion of the vehicle at n times.

    Attributes:
        speed_mps: (n,) horizontal speed [m/s].
        distance_m: (n,) distance from the start [m].
        yaw_rad: (n,) heading of the path [rad].
        velocity_mps: (n, 2) velocity: east and north [m/s].
        en_m: (n, 2) position: east and north [m].
    """

    speed_mps: FloatArray
    distance_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    en_m: FloatArray


def simulate_truth(t_s: FloatArray, path: Path, terrain: Terrain, vibration: Vibration, ruts: Ruts) -> Truth:
    """Return the true motion at equidistant times (n,).

    The slope f of the ground along the path and the slope l to the left determine pitch and roll::

        pitch = -atan(f) (positive is nose down),  roll = atan(l) + r(s)

    The yaw is the yaw of the path. The angles of the vibration and of the ruts are added to pitch, roll and yaw. The
    vertical velocity is the derivative of the height. The vibration starts when the robot starts to move, and its
    amplitude increases during the acceleration.
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
    """Return the horizontal motion. Positions are integrals of the velocity, computed by Simpson's rule."""
    fine_t_s = np.empty(2 * len(t_s) - 1)  # the times, and the centres of the intervals
    fine_t_s[::2], fine_t_s[1::2] = t_s, 0.5 * (t_s[:-1] + t_s[1:])
    yaw = path.yaw_rad_at(fine_t_s)
    speed = path.speed_mps_at(fine_t_s) - ruts.speed_dip_mps * ruts.pulse(fine_t_s)
    velocity = speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    areas = np.diff(t_s)[:, None] / 6.0 * (velocity[:-1:2] + 4.0 * velocity[1::2] + velocity[2::2])
    en = np.vstack([np.zeros((1, 2)), np.cumsum(areas, axis=0)])
    distance = path.distance_m_at(t_s) - 2.0 * ruts.tau_s * ruts.speed_dip_mps * ruts.steps(t_s)
    return Course(speed[::2], distance, yaw[::2], velocity[::2], en)


def _lean(course: Course, ground: Ground) -> FloatArray:
    """Return the roll, pitch and yaw (n, 3) of a robot that is aligned with the ground."""
    forward = ground.slope[:, 0] + ground.slope[:, 1] * np.cos(course.yaw_rad)
    leftward = -ground.slope[:, 1] * np.sin(course.yaw_rad)
    return np.column_stack([np.arctan(leftward) + ground.roll_rad, -np.arctan(forward), course.yaw_rad])
