"""The ground: a random profile over the distance, a second one for roll, and a hill."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.simulation.harmonics import harmonics

WAVES = 36
SHORTEST_PER_M = 1.2
LONGEST_PER_M = 0.03
REFERENCE_PER_M = 0.1
REFERENCE_PSD_M3 = 1024e-6
TRACK_PER_M = 0.6


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground under the robot at each time.

    Attributes:
        height_m: (n,) height of the ground under the robot.
        slope: (n, 2) the profile's slope along the path (which has no direction in the plane), and the hill's along x.
        roll_rad: (n,) what the difference between left and right track adds to roll.
    """

    height_m: FloatArray
    slope: FloatArray
    roll_rad: FloatArray


@dataclass(frozen=True, eq=False)
class Terrain:
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
    n = np.geomspace(LONGEST_PER_M, SHORTEST_PER_M, WAVES)
    phases = rng.uniform(0.0, 2.0 * np.pi, (2, WAVES))
    sizes = wave_amplitudes(n) * roughness * np.array([[1.0], [roll_ratio]])
    return Terrain(n, sizes * np.cos(phases), sizes * np.sin(phases), hill_height_m, hill_length_m)


def wave_amplitudes(wavenumber_per_m: FloatArray) -> FloatArray:
    """Amplitudes [m] for c = 1 of geometric wavenumbers (w,); a wave stands for the band around it, dn wide."""
    n = wavenumber_per_m
    half_step = np.sqrt(n[1] / n[0])
    width = n * (half_step - 1.0 / half_step)
    psd = REFERENCE_PSD_M3 * (n / REFERENCE_PER_M) ** -2.0
    amplitudes: FloatArray = np.sqrt(2.0 * psd * width) / (1.0 + (n / TRACK_PER_M) ** 2)
    return amplitudes
