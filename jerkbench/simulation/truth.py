"""The true motion: the ground, ruts, vibration and the path put together; and force that is felt but not moved."""

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
    """The ground under the robot at each time.

    Attributes:
        height_m: (n,) height of the ground under the robot.
        slope: (n, 2) the profile's slope along the path (which has no direction in the plane), and the hill's along x.
        roll_rad: (n,) what the difference between left and right track adds to roll.
    """

    height_m: FloatArray
    slope: FloatArray
    roll_rad: FloatArray


class Terrain(NamedTuple):
    """Height h(s) + A sin(2 pi x/L), and roll r(s); s is the distance driven, x points east.

    h and r are sums of 36 waves with random phases, n from .03 to 1.2 cycles/m in geometric steps, of amplitude

        c sqrt(2 G_0 (n/n_0)^-2 dn)/(1 + (n/.6)^2),  G_0 = 1024e-6 m3,  n_0 = .1 cycles/m

    with c = ``roughness`` for h and .6 ``roughness`` (in radians) for r. The last factor is there because the track
    bridges waves shorter than itself. G_0 (n/n_0)^-2 is the displacement spectrum of ISO 8608; its class D has the
    geometric mean 1024e-6 m3 and class E 4096e-6 m3 (from 2048e-6), so that c = 1.5 (c^2 G_0 = 2304e-6) lies in
    class E and c = 2 in its middle.

    Source: ISO 8608:2016, Mechanical vibration - Road surface profiles - Reporting of measured data.

    Attributes:
        wavenumber_per_m: (36,) n [cycles/m].
        sine: (2, 36) coefficients of sin(2 pi n s) in h [m] and in r [rad].
        cosine: (2, 36) those of cos(2 pi n s).
        hill_height_m: A.
        hill_length_m: L.
    """

    wavenumber_per_m: FloatArray
    sine: FloatArray
    cosine: FloatArray
    hill_height_m: float
    hill_length_m: float

    def at(self, distance_m: FloatArray, east_m: FloatArray) -> Ground:
        """Return the ground (n,) after a distance (n,), at an absolute x (n,)."""
        value, slope = harmonics(distance_m, 2.0 * np.pi * self.wavenumber_per_m, self.sine, self.cosine)
        hill = 2.0 * np.pi / self.hill_length_m
        height = value[:, 0] + self.hill_height_m * np.sin(hill * east_m)
        slope_east = self.hill_height_m * hill * np.cos(hill * east_m)
        return Ground(height, np.column_stack([slope[:, 0], slope_east]), value[:, 1])


def draw_terrain(
    rng: np.random.Generator, roughness: float, roll_ratio: float, hill_height_m: float, hill_length_m: float
) -> Terrain:
    """Draw the phases of both profiles; ``roll_ratio`` is the roll's share of the roughness [rad/m]."""
    n = np.geomspace(MIN_CYCLES_PER_M, MAX_CYCLES_PER_M, WAVES)
    phases = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
    sizes = wave_amplitudes(n) * roughness * np.array([[1.0], [roll_ratio]])
    return Terrain(n, sizes * np.cos(phases), sizes * np.sin(phases), hill_height_m, hill_length_m)


def wave_amplitudes(wavenumber_per_m: FloatArray) -> FloatArray:
    """Amplitudes [m] for c = 1 of geometric wavenumbers (w,); a wave stands for the band around it, dn wide."""
    n = wavenumber_per_m
    half_step = np.sqrt(n[1] / n[0])
    width = n * (half_step - 1.0 / half_step)
    psd = REFERENCE_PSD_M3 * (n / REFERENCE_PER_M) ** -2.0
    return np.asarray(np.sqrt(2.0 * psd * width) / (1.0 + (n / TRACK_PER_M) ** 2))


# Ruts: the robot drops, is thrown and slowed, and its accelerometer feels more than it moves.


@dataclass(frozen=True)
class Ruts:
    """At each time t_r the robot drops into a rut and drives on at the lower level.

    With u = (t - t_r)/tau, the step H(u) = (1 + tanh u)/2 and the pulse B(u) = 1 - tanh^2 u::

        height -= drop H;  speed -= dip B;  pitch += pitch_0 B;  roll += roll_0 B
        distance -= dip tau (1 + tanh u)

    Attributes:
        times_s: t_r; empty: no rut.
        drop_m: how deep.
        tau_s: tau, how quickly.
        speed_dip_mps: dip.
        pitch_rad: pitch_0, nose down.
        roll_rad: roll_0, right side down.
    """

    times_s: tuple[float, ...]
    drop_m: float
    tau_s: float
    speed_dip_mps: float
    pitch_rad: float
    roll_rad: float

    def pulse(self, t_s: FloatArray) -> FloatArray:
        """Sum of B (n,) over the ruts."""
        return np.asarray(sum((1.0 - np.tanh((t_s - t) / self.tau_s) ** 2 for t in self.times_s), 0.0 * t_s))

    def steps(self, t_s: FloatArray) -> FloatArray:
        """Sum of H (n,): how many ruts it has dropped into."""
        return np.asarray(sum((0.5 * (1.0 + np.tanh((t_s - t) / self.tau_s)) for t in self.times_s), 0.0 * t_s))


# Vibration of engine and tracks, as true motion.

_SINES = 14
LOWEST_HZ = 8.0
MAX_VIBRATION_HZ = 35.0
AXIS_SHARE = np.array([0.7, 0.7, 1.0])
"""Rms of east, north and up, in parts of the nominal one."""


class Vibration(NamedTuple):
    """14 sines between 8 and 35 Hz, one at a random place in each 14th of the band.

    Each axis d(t) = sum_i a_i sin(w_i t) + b_i cos(w_i t) has its own random phases, and all sines have the same
    acceleration (displacements, those of an angle: the same amplitude). With an envelope E(t) the
    displacement is E d and the velocity E d' + E' d, so that position and velocity stay consistent.

    Attributes:
        frequency_radps: (14,) w.
        sine: (6, 14) a: east, north, up [m], roll, pitch, yaw [rad].
        cosine: (6, 14) b.
    """

    frequency_radps: FloatArray
    sine: FloatArray
    cosine: FloatArray

    def grown(self, t_s: FloatArray, begin_s: float, ramp_s: float) -> Way:
        """Return the motion at times (n,) that grows over ``ramp_s`` from ``begin_s`` on."""
        u = (t_s - begin_s) / ramp_s
        return self.at(t_s, smoothstep(u), smoothstep_rate(u) / ramp_s)

    def at(self, t_s: FloatArray, envelope: FloatArray, envelope_rate: FloatArray) -> Way:
        """Return the motion at times (n,) under an envelope (n,) and its derivative [1/s]."""
        bare, rate = harmonics(t_s, self.frequency_radps, self.sine, self.cosine)
        shaped = envelope[:, None] * bare
        velocity = envelope[:, None] * rate[:, :3] + envelope_rate[:, None] * bare[:, :3]
        return Way(shaped[:, :3], velocity, shaped[:, 3:])


def draw_vibration(rng: np.random.Generator, accel_mps2: float, angle_rad: float) -> Vibration:
    """Draw frequencies and phases.

    Args:
        rng: the stream of the vibration.
        accel_mps2: rms of the vertical acceleration; a horizontal axis has .7 of it.
        angle_rad: rms of roll, of pitch and of yaw.
    """
    band = (MAX_VIBRATION_HZ - LOWEST_HZ) / _SINES
    w = 2.0 * np.pi * (LOWEST_HZ + band * (np.arange(_SINES) + rng.uniform(size=_SINES)))
    phases = rng.uniform(0.0, 2.0 * np.pi, (6, _SINES))
    unit = np.sqrt(2.0 / _SINES)  # amplitude of each of 14 sines whose sum has an rms of one
    shift = accel_mps2 * unit * np.multiply.outer(AXIS_SHARE, w**-2.0)
    sizes = np.vstack([shift, np.full((3, _SINES), angle_rad * unit)])
    return Vibration(w, sizes * np.cos(phases), sizes * np.sin(phases))


# Specific force that the accelerometer feels though the robot does not move so: ruts and impacts.

IMPACT_S = 0.02


def inner_times(t_s: FloatArray, per_sample: int) -> FloatArray:
    """Times (n, m) in the middle of ``per_sample`` parts of each interval; ``t_s`` (n + 1,) are the interval's ends."""
    parts = (np.arange(per_sample) + 0.5) / per_sample
    return np.asarray(t_s[:-1, None] + np.diff(t_s)[:, None] * parts)


def rut_force(
    inner_s: FloatArray, times_s: tuple[float, ...], force_mps2: tuple[float, ...], decay_s: float
) -> FloatArray:
    """Return (n, m, 3): ``force_mps2`` from each time on, decaying as exp(-t/``decay_s``)."""
    size = np.zeros_like(inner_s)
    for start in times_s:
        since = inner_s - start
        size += np.where(since >= 0.0, np.exp(-np.maximum(since, 0.0) / decay_s), 0.0)
    return np.asarray(size[:, :, None] * np.asarray(force_mps2))


def draw_impacts(rng: np.random.Generator, per_s: float, begin_s: float, end_s: float) -> FloatArray:
    """Draw the times of a Poisson process between two times, sorted."""
    length = max(0.0, end_s - begin_s)
    return np.sort(begin_s + length * rng.uniform(size=rng.poisson(per_s * length)))


def impact_force(inner_s: FloatArray, times_s: FloatArray, peak_mps2: float) -> FloatArray:
    """Return (n, m, 3): at each time a half sine of 20 ms, upwards in the body."""
    force = np.zeros((inner_s.size, 3))
    flat = inner_s.ravel()
    for start in times_s:
        hit = slice(*np.searchsorted(flat, (start, start + IMPACT_S)))
        force[hit, 2] += peak_mps2 * np.sin(np.pi * (flat[hit] - start) / IMPACT_S)
    return force.reshape(*inner_s.shape, 3)


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
