"""Vibration of engine and tracks, as true motion."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.simulation.harmonics import harmonics

SINES = 14
LOWEST_HZ = 8.0
HIGHEST_HZ = 35.0
AXIS_SHARE = np.array([0.7, 0.7, 1.0])
"""Rms of east, north and up, in parts of the nominal one."""


@dataclass(frozen=True, eq=False)
class Shaking:
    """The motion of the vibration, at n times.

    Attributes:
        enu_m: (n, 3) displacement.
        velocity_mps: (n, 3) its derivative.
        euler_rad: (n, 3) roll, pitch, yaw.
    """

    enu_m: FloatArray
    velocity_mps: FloatArray
    euler_rad: FloatArray


@dataclass(frozen=True, eq=False)
class Vibration:
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

    def at(self, t_s: FloatArray, envelope: FloatArray, envelope_rate: FloatArray) -> Shaking:
        """Return the motion at times (n,) under an envelope (n,) and its derivative [1/s]."""
        bare, rate = harmonics(t_s, self.frequency_radps, self.sine, self.cosine)
        shaped = envelope[:, None] * bare
        velocity = envelope[:, None] * rate[:, :3] + envelope_rate[:, None] * bare[:, :3]
        return Shaking(shaped[:, :3], velocity, shaped[:, 3:])


def draw_vibration(rng: np.random.Generator, accel_mps2: float, angle_rad: float) -> Vibration:
    """Draw frequencies and phases.

    Args:
        rng: the stream of the vibration.
        accel_mps2: rms of the vertical acceleration; a horizontal axis has .7 of it.
        angle_rad: rms of roll, of pitch and of yaw.
    """
    band = (HIGHEST_HZ - LOWEST_HZ) / SINES
    w = 2.0 * np.pi * (LOWEST_HZ + band * (np.arange(SINES) + rng.uniform(size=SINES)))
    phases = rng.uniform(0.0, 2.0 * np.pi, (6, SINES))
    unit = np.sqrt(2.0 / SINES)  # amplitude of each of 14 sines whose sum has an rms of one
    shift = accel_mps2 * unit * np.multiply.outer(AXIS_SHARE, w**-2.0)
    sizes = np.vstack([shift, np.full((3, SINES), angle_rad * unit)])
    return Vibration(w, sizes * np.cos(phases), sizes * np.sin(phases))
